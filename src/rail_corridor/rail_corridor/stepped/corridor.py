"""A corridor that is stepped: it runs a tick when it is told to, and stands as long as it likes.

All nodes are in this process, on a context and an executor of their own; nothing is spun between
calls. The digest is that of ``rail run``.
"""

from __future__ import annotations

import contextlib
import gc
import math
import shutil
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from std_msgs.msg import String

from rail_corridor.equipment.registry import kind_of, node_kinds
from rail_corridor.errors import InputError
from rail_corridor.plan.plan import (
    REPORT,
    WORLD,
    Placement,
    check_external,
    make_plan,
)
from rail_corridor.report.intake import names_read
from rail_corridor.report.observer import Observer
from rail_corridor.report.report import make_report
from rail_corridor.run.host import destroy_nodes, make_context, make_node
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.delivery import LocalReader
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.topics.qos import ESTIMATE
from rail_msgs_py.topics.tick import CLOCK, FAILED, READY, WAITING
from rail_msgs_py.topics.topic import Topic

from .site_processes import SiteProcesses
from .truth import Truth, truth_of

if TYPE_CHECKING:
    from rail_corridor.equipment.node_spec import NodeSpec
    from rail_msgs_py.delivery import LocalDelivery
    from rail_msgs_py.tap import Tap

#: Wall time between two looks whether a step is over, where something outside is waited for [s].
_LOOK_S = 0.02
#: Wall time for what other processes have said of a tick, where some of them have failed [s].
_SETTLE_S = 0.3


class StalledError(RuntimeError):
    """A step has not ended in the wall time that it was given."""


class SteppedCorridor:
    """One run of a scenario, tick by tick.

    Parameters
    ----------
    scenario : Scenario
    domain : int, optional
        ROS domain; that of the environment if not given.
    timeout_s : float
        As ``--timeout`` of ``rail run``.
    external : iterable of str
        Full names of nodes of the plan that are not made: somebody else answers for them.
    attached : tuple of str
        Full names of further nodes whose ``<node>/done`` each tick waits for.
    tap : callable, optional
        Is told of everything that nodes publish.
    placement : 'one', 'site' or 'node'
        Where nodes are: all in this process, or the world and the report here and the others in
        processes of their own.
    switches : bool
        Whether equipment of this process offers the services of its life cycle.
    intercepts : bool
        Whether messages can be intercepted and looked back at; what was sent is kept for that.
    scratch : str or Path, optional
        Folder in which it makes one of its own; that for temporary files if not given.

    Raises
    ------
    InputError
        If an external node is not of the plan.
    """

    def __init__(
        self,
        scenario: Scenario,
        *,
        domain: int | None = None,
        timeout_s: float = 30.0,
        external: Iterable[str] = (),
        attached: tuple[str, ...] = (),
        tap: Tap | None = None,
        placement: Placement = "one",
        switches: bool = False,
        intercepts: bool = True,
        scratch: str | Path | None = None,
    ) -> None:
        self.scenario = scenario
        self._external, self._switches = tuple(external), switches
        self._directory = Path(tempfile.mkdtemp(prefix="rail_corridor_", dir=scratch))
        #: Wall time without an answer after which the world gives a node up [s].
        self.timeout_s = timeout_s
        try:
            self.plan = make_plan(
                scenario,
                self._directory,
                timeout_s=timeout_s,
                observed=False,
                external=self._external,
                attached=attached,
                observers=(REPORT,),
            )
            check_external(self.plan, self._external, attached)
        except BaseException:
            self._remove_directory()
            raise
        groups = self.plan.groups(placement, None, self._external)
        here = [name for name, specs in groups.items() if any(s.name == WORLD for s in specs)]
        self._processes = 1 + len(groups) - len(here)
        elsewhere = {name: specs for name, specs in groups.items() if name not in here}
        #: Nodes in other processes; None if there are none.
        self.sites = SiteProcesses(elsewhere, domain, names_read(self.plan)) if elsewhere else None
        self.context = make_context(tap)
        self.delivery.intercepts = intercepts
        rclpy.init(
            context=self.context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        #: The nodes that are alive, by their full names.
        self.nodes: dict[str, Any] = {}
        #: Nodes that were killed; what was under way to one would find no handle if it were gone.
        self.dead: list[Any] = []
        #: Full names of nodes that were ended and not started anew.
        self.gone: set[str] = set()
        #: Spins all nodes of this process.
        # rclpy has crashes told on standard error, which a test may have replaced.
        with contextlib.redirect_stderr(sys.__stderr__):
            self.executor = EventsExecutor(context=self.context)
        self.observer = Observer(
            self.plan,
            lambda: None,
            context=self.context,
            alone=not (self._external or elsewhere),
        )
        for spec in (spec for name in here for spec in groups[name]):
            self.nodes[spec.name] = self.made(spec)
        self.world = self.nodes[WORLD]
        self._hear_failures()
        for node in (self.observer, *self.nodes.values()):
            self.executor.add_node(node)
        self._started = self._closed = self._stepping = False
        #: Wall time that a tick waits for nodes that may be late, by their names [s].
        self.patience: dict[str, float] = {}

    # Before the first tick ---------------------------------------------------------------

    def start(self) -> None:
        """Connect everything; then the world stands before its first tick.

        Raises
        ------
        StalledError
            If nodes are not ready in twice the time-out.
        """
        if self._started:
            return
        self._started = True
        self.delivery.settle(self.executor)
        self._run_until(0, 3.0 * self.timeout_s + 10.0)
        # What is there by now stays: looking through it for garbage took a tenth of every tick.
        gc.collect()
        gc.freeze()

    @property
    def delivery(self) -> LocalDelivery:
        """Delivery of the messages of this process."""
        delivery: LocalDelivery = self.context.delivery
        return delivery

    def made(self, spec: NodeSpec) -> Any:
        """One of the scenario's own nodes, new."""
        return make_node(spec, self.context, self._switches)

    def add_node(self, node: Any, name: str | None = None) -> None:
        """Spin one more node with the corridor."""
        self.nodes[name or node.get_fully_qualified_name()] = node
        self.executor.add_node(node)

    def announce_ready(self, name: str) -> None:
        """Say on behalf of a node that does not know the corridor that it is ready."""
        self.observer.publisher(READY).publish(String(data=name))

    def _hear_failures(self) -> None:
        """Let the report know of failures in the tick in which they are told, in this process."""

        def take(raw: bytes) -> None:
            self.observer.intake.take_failed(deserialize_message(raw, FAILED.type))

        def refuse(error: Exception) -> None:
            raise error

        reader = LocalReader(self.observer, refuse, take)
        self.delivery.line(FAILED.name()).readers.append(reader)

    def ready_again(self, names: Iterable[str], *, others_dead: bool = False) -> set[str]:
        """Set that is filled with those of some nodes that say from now on that they are ready.

        With ``others_dead`` also with those that say that they lack connections.
        """
        heard: set[str] = set()
        wanted, begun = {*names}, False

        def hear(name: str) -> None:
            if begun and name in wanted:
                heard.add(name)

        self.observer.listen(READY, lambda message: hear(message.data))
        if others_dead:
            self.observer.listen(WAITING, lambda message: hear(message.name))
        self.spin(lambda: False, _SETTLE_S)  # what was said before is kept for late listeners
        begun = True
        return heard

    def is_elsewhere(self, name: str) -> bool:
        """Whether a node is in another process."""
        return name not in self.nodes and (name in self._external or name in (self.sites or ()))

    def is_sink(self, name: str) -> bool:
        """Whether a tick ends only when a node of the plan is done."""
        return node_kinds()[self.spec(name).kind].sink

    def when_tick_begins(self, callback: Callable[[int], None]) -> None:
        """Call back with the stamp [ns] of every tick."""
        self.observer.stream_in(CLOCK, lambda raw: callback(clock_from_cdr(raw)))

    def publisher(self, name: str, kind: Any) -> Any:
        """Publisher of a topic of the corridor, or of another one."""
        topic = kind_of(name)
        if topic is not None:
            return self.observer.publisher(topic, **topic.parts(name))
        return self.observer.publisher(Topic(name, kind, ESTIMATE, None, "", "", ""))

    def call(self, function: Callable[[], None]) -> None:
        """Call a function that sends something, and let that be handed over."""
        self.observer.guarded(function)()

    def node(self, name: str) -> Any:
        """A node that is alive; InputError if there is none of that name."""
        if name not in self.nodes:
            self.spec(name)
            raise InputError("is not running here", field="node", value=name)
        return self.nodes[name]

    def spec(self, name: str) -> NodeSpec:
        """What the plan has of a node; InputError if it has none of that name."""
        return self.plan.node(name)

    # Ticks -------------------------------------------------------------------------------

    @property
    def ticks(self) -> int:
        """Ticks that have run."""
        return int(self.world.ticks)

    @property
    def time_s(self) -> float:
        """Simulated time of the last tick [s]; 0 before the first."""
        return round(max(self.ticks - 1, 0) * self.plan.tick_s, 9)

    @property
    def finished(self) -> bool:
        """Whether the run has come to its end."""
        return bool(self.world.finished)

    def step(self, ticks: int = 1) -> int:
        """Run ticks; how many did run until the end of the run.

        Raises
        ------
        StalledError
            If they have not ended long after whoever is silent should have been given up.
        """
        self.start()
        before = self.ticks
        self._run_until(before + ticks, 2.0 * self.timeout_s + 10.0)
        return self.ticks - before

    def _run_until(self, ticks: int, patience_s: float) -> None:
        """Let the world run to a number of ticks, and all that comes of them be handed over."""
        if self.finished:
            return
        if self._stepping:
            raise RuntimeError("a tick is under way: it cannot be stepped from within")
        over, delivery = Future(), self.delivery

        def settle() -> None:
            delivery.when_idle(lambda: over.set_result(None))

        def go_on() -> None:
            self.world.steps.run_until(ticks, settle)

        self._stepping, delivery.until_s = True, time.monotonic() + patience_s
        try:
            self._step_over(go_on, over, patience_s)
        finally:
            self._stepping, delivery.until_s = False, math.inf

    def _step_over(self, go_on: Callable[[], None], over: Any, patience_s: float) -> None:
        self.call(go_on)
        for name, within_s in sorted(self.patience.items(), key=lambda item: item[1]):
            if self.spin_until(over, within_s):
                break
            self.call(partial(self.observer.announce_failure, name, f"late by {within_s:g} s"))
        if not self.spin_until(over, patience_s) or not self._settled(patience_s):
            lacking = self.delivery.going_round() or self._lacking()
            raise StalledError(f"tick {self.ticks}: not over within {patience_s:g} s{lacking}")

    def _settled(self, within_s: float) -> bool:
        """Let what other processes have said of a tick arrive; whether it has."""
        if self.sites is None or not self.ticks:
            return True
        recording, ticks = self.observer.recording, self.ticks
        if self.observer.failures:
            within_s = min(within_s, _SETTLE_S)  # some of it may never come
        come = self.spin(lambda: bool(recording.complete(ticks)), within_s)
        return come or bool(self.observer.failures)

    def spin_until(self, until: Any, within_s: float) -> bool:
        """Let the executor work until a future is done; whether it is."""
        if not until.done():
            self.executor.spin_until_future_complete(until, timeout_sec=within_s)
        return bool(until.done())

    def spin(self, condition: Callable[[], bool], within_s: float) -> bool:
        """Let the executor work until something outside has come; whether it has."""
        deadline_s = time.monotonic() + within_s
        while not condition():
            if time.monotonic() > deadline_s:
                return False
            self.executor.spin_once(timeout_sec=_LOOK_S)
        return True

    def _lacking(self) -> str:
        """What is missing, in words."""
        missing = sorted(self.world.missing)
        return f": no answer from {', '.join(missing)}" if missing else ""

    # What has happened -------------------------------------------------------------------

    @property
    def truth(self) -> Mapping[str, Truth]:
        """Where the trains are and how they move: for judging alone."""
        return truth_of(self.world.traffic, tuple(self.plan.world.tracks))

    def report(self) -> dict[str, Any]:
        """Report of the run so far, as ``rail run --report`` writes it."""
        self.observer.recording.end_at(self.ticks)
        return make_report(
            self.scenario,
            self.plan,
            self.observer.intake,
            nodes=len(self.plan.nodes) - len(self._external),
            processes=self._processes,
            interrupted=not self.finished,
        )

    # The end -----------------------------------------------------------------------------

    def close(self) -> None:
        """Take everything down; harmless when called again."""
        if self._closed:
            return
        self._closed = True
        if self.sites is not None:
            self.sites.close()
        gc.unfreeze()
        self.executor.shutdown()
        destroy_nodes([self.observer, *self.nodes.values(), *self.dead], within_s=60.0)
        rclpy.try_shutdown(context=self.context)
        self.delivery.close()
        self._remove_directory()

    def _remove_directory(self) -> None:
        with contextlib.suppress(OSError):
            shutil.rmtree(self._directory)
