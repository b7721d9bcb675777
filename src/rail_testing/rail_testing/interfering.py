"""What a test does to its corridor: messages of its own, faults, switches, kills, interception."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rail_corridor.equipment.registry import kind_of
from rail_corridor.errors import InputError, did_you_mean
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.loading.schema import fault_fields, fault_kinds
from rail_corridor.plan.plan import Plan
from rail_corridor.scenario.model import Scenario
from rail_corridor.stepped.corridor import SteppedCorridor
from rail_corridor.stepped.interference import Interference
from rail_msgs_py.publisher import CorridorPublisher

from .interception import Interception, Interceptor, InterceptorError
from .scenario_source import times_of
from .under_test import NodesUnderTest


class InterferingMixin:
    """The part of `rail_testing.corridor.Corridor` that interferes."""

    _scenario: Scenario
    _plan: Plan | None
    _session: SteppedCorridor | None
    _interference: Interference | None
    _under_test: NodesUnderTest

    def __init__(self) -> None:
        self._interceptions: dict[str, Interception] = {}
        self._publishers: dict[str, CorridorPublisher] = {}
        #: Nodes that the test has killed.
        self._killed: set[str] = set()

    def _running(self) -> SteppedCorridor:
        raise NotImplementedError

    def _kind(self, topic: str) -> Any:
        raise NotImplementedError

    def _expect(self, node: str) -> None:
        raise NotImplementedError

    def _interceptors_after_tick(self) -> None:
        """Let what is late come nearer; raise what a function has raised."""
        for topic, interception in self._interceptions.items():
            interception.tick()
            if interception.error is not None:
                error, interception.error = interception.error, None
                said = f"{type(error).__name__}: {error}"
                raise InterceptorError(f"interceptor of {topic}: {said}") from error

    def _unfinished(self, what: str) -> SteppedCorridor:
        """The run, which has to go on for what is done to it to matter."""
        session = self._running()
        if session.finished:
            raise InputError("the run has come to its end", field="call", value=what)
        return session

    def _interfere(self) -> Interference:
        self._unfinished("interfere")
        assert self._interference is not None
        return self._interference

    def publish(self, topic: str, message: Any) -> None:
        """Send a message of ROS, a view of `rail_msgs_py`, or a serialised message.

        Raises
        ------
        InputError
            If it is none of the topic.
        """
        session = self._unfinished("publish")
        known = kind_of(topic)
        kinds = () if known is None else (known.type, known.view, bytes)
        if known is not None and not isinstance(message, tuple(filter(None, kinds))):
            raise InputError(f"must be of {known.type.__name__}", field=topic, value=message)
        if topic not in self._publishers:
            self._publishers[topic] = session.publisher(topic, type(message))
        publisher = self._publishers[topic]
        sent = message.to_cdr() if hasattr(message, "to_cdr") else message
        session.call(lambda: publisher.publish(sent))

    def inject(self, fault: Mapping[str, Any]) -> None:
        """Let a fault of the scenario's kinds befall it, from now on if it does not say when.

        Parameters
        ----------
        fault : mapping
            As in the list ``faults`` of a scenario, with ``kind``.

        Raises
        ------
        InputError
            If it is wrong.
        LookupError
            If it is of a kind that is read at the start alone, and the run has begun.
        """
        given: Any = fault
        if not isinstance(given, Mapping):
            reason = "must be a mapping with kind, as in the list of a scenario"
            raise InputError(reason, field="faults", value=given)
        if self._session is not None:
            self._unfinished("inject")
        data = self._scenario.model_dump(mode="json", exclude_unset=True)
        kind = str(fault.get("kind", ""))
        if not fault_fields(kind):
            reason = f"is no kind of fault{did_you_mean(kind, fault_kinds())}"
            raise InputError(reason, field="kind", value=kind)
        complete = {**times_of(kind, self._next_s), **fault}
        data["faults"] = [*data.get("faults", ()), complete]
        changed = scenario_from_data(data, directory=Path.cwd())
        if self._session is not None:
            self._interfere().change_faults(changed)
        self._scenario, self._plan = changed, None

    def can_be_switched(self, node: str) -> bool:
        """Whether equipment can be switched off and on."""
        return self._interfere().can_be_switched(node)

    def switch_off(self, node: str) -> None:
        """Switch equipment off: it answers every tick with silence."""
        self._interfere().switch(node, on=False)

    def switch_on(self, node: str) -> None:
        """Switch equipment on: it knows nothing of what was before."""
        self._interfere().switch(node, on=True)

    def kill(self, node: str) -> None:
        """End a node as if its process had been killed."""
        process = self._under_test.process_of(node)
        if process is None:
            self._interfere().kill(node)
        else:
            process.kill()
            self._interfere().announce_gone(node)
        self._killed.add(node)

    def restart(self, node: str) -> None:
        """Start a node anew, whether or not it is alive: one under test from what made it.

        Raises
        ------
        InputError
            If a node under test was handed over ready made, or runs elsewhere already.
        StalledError
            If one in another process is not ready in time.
        """
        process = self._under_test.process_of(node)
        if process is not None:
            if process.running:
                self.kill(node)
            self._under_test.forgive(node)
            self._interfere().start_elsewhere([node], process.start)
            self._expect(node)
            return
        self._killed.add(node)
        make = self._under_test.maker_of(node, self._running())
        self._interfere().restart(node, make)

    def intercept(self, topic: str, function: Interceptor | None) -> Interception | None:
        """Let a function have every message of a topic before anybody else.

        Parameters
        ----------
        topic : str
        function : callable, optional
            Takes the ROS message, which it may change, and returns what goes on: a message,
            several, none (None), or `Late` ones. Without it everything passes again.
        """
        session = self._running()
        line = session.delivery.line(topic)
        if not line.writers and self._kind(topic) is not None:
            reason = (
                "is sent in another process: messages are intercepted where all nodes are in one"
            )
            raise InputError(reason, field="topic", value=topic)
        before = self._interceptions.pop(topic, None)
        if before is not None:
            before.remove()
        if function is None:
            return None
        made = Interception(line, self._kind(topic), function)
        self._interceptions[topic] = made
        return made

    @property
    def _next_s(self) -> float:
        """Simulated time of the next tick [s]."""
        ticks = 0 if self._session is None else self._session.ticks
        return ticks * self._scenario.tick_s
