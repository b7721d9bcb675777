"""A corridor for a test: it stands between calls, and what is asked and told is in simulated time.

    c = Corridor("located_block", seed=3)
    c.add(MyLocalizer, replaces="/second/localizer")
    c.run_for(30)
    assert c.truth("second").front_m < c.topic("/second/atp/state").latest.end_of_authority_m
    c.close()

Units are seconds and metres. Times are simulated ones, unless they are called wall time.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rail_corridor.errors import InputError
from rail_corridor.loading.overrides import Overrides
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import free_domain
from rail_corridor.plan.plan import Placement, Plan
from rail_corridor.report.verdict import Verdict, verdict_of
from rail_corridor.scenario.model import Scenario
from rail_corridor.stepped.corridor import SteppedCorridor
from rail_corridor.stepped.histories import Histories
from rail_corridor.stepped.interference import Interference
from rail_corridor.stepped.topics import NotKnownError, TopicHistory
from rail_corridor.stepped.truth import Truth

from .adding import AddingMixin
from .checked import checked_condition, checked_placement, checked_ticks, ticks_in
from .conditions import Always, Watched, said_of
from .evidence import Evidence, RunNotes, said_of_health
from .interfering import InterferingMixin
from .outcome import Outcome
from .scenario_source import scenario_of
from .under_test import NodesUnderTest

#: Wall time without an answer after which a node counts as failed, as with ``rail run``: a machine
#: that is busy with other tests must not make one fail.
TIMEOUT_S = 30.0


class Corridor(AddingMixin, InterferingMixin):
    """A scenario that runs when it is told to.

    Nothing has been started until a call needs it, so that nodes and faults can be added first.

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        A built-in one, a YAML file, the data of such a file, or one made in Python.
    seed : int, optional
        Takes the place of the scenario's own.
    duration_s : float, optional
        Likewise.
    placement : 'one', 'site' or 'node'
        Where its nodes are: with ``one`` all are in this process, and a run is exactly
        repeatable; otherwise world, report and nodes under test are, and the rest in processes of
        their own, as with ``rail run``.
    timeout_s : float
        Wall time without an answer after which a node counts as failed.
    domain : int, optional
        ROS domain; a free one if not given.
    recording : Path, optional
        MCAP file for everything but waveforms, written when the test fails, or `keep_recording`
        says so.
    switches : bool
        Whether equipment of this process offers the services of its life cycle, for nodes under
        test that switch it; `switch_off` does without.

    Raises
    ------
    InputError
        If the scenario is wrong: one line with file, field and value.
    """

    def __init__(
        self,
        scenario: str | Path | Mapping[str, Any] | Scenario,
        *,
        seed: int | None = None,
        duration_s: float | None = None,
        placement: Placement = "one",
        timeout_s: float = TIMEOUT_S,
        domain: int | None = None,
        recording: Path | None = None,
        switches: bool = False,
    ) -> None:
        super().__init__()
        self._switches = switches
        self._scenario = scenario_of(scenario, Overrides(seed=seed, duration_s=duration_s))
        self.placement = checked_placement(placement)
        self._timeout_s, self._domain = timeout_s, domain
        self._held = ExitStack()
        self._plan: Plan | None = None
        self._session: SteppedCorridor | None = None
        self._histories: Histories | None = None
        self._under_test = NodesUnderTest()
        self._always: list[Always] = []
        self._interference: Interference | None = None
        self._evidence = Evidence(recording)
        self._closed = False

    def __enter__(self) -> Corridor:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.close()
        if kind is None:
            self.conclude()

    # Before the first tick ---------------------------------------------------------------

    @property
    def seed(self) -> int:
        """Seed of every draw."""
        return self._scenario.seed

    @property
    def scenario(self) -> Scenario:
        """The scenario, with the faults that were injected."""
        return self._scenario

    # Time --------------------------------------------------------------------------------

    @property
    def ticks(self) -> int:
        """Ticks that have run."""
        return 0 if self._session is None else self._session.ticks

    @property
    def time_s(self) -> float:
        """Simulated time of the last tick [s]."""
        return 0.0 if self._session is None else self._session.time_s

    @property
    def tick_s(self) -> float:
        """Length of a tick [s]."""
        return self._scenario.tick_s

    @property
    def finished(self) -> bool:
        """Whether the run has come to its end."""
        return self._session is not None and self._session.finished

    def start(self) -> None:
        """Start everything, and stand before the first tick; later calls do it otherwise."""
        self._running()

    def step(self, ticks: int = 1) -> int:
        """Run ticks; how many did run before the end of the run.

        Raises
        ------
        AssertionError
            If a condition of `always` does not hold any longer.
        NodeError
            If a callback of a node under test has raised, or one gives no answer any longer.
        StalledError
            If a tick does not end.
        """
        __tracebackhide__ = True
        session = self._running()
        for number in range(checked_ticks(ticks)):
            if not session.step():
                return number
            self._under_test.after_tick(session, self._killed, self._malformed)
            if self._histories is not None:
                self._histories.after_tick(session.gone)
            self._interceptors_after_tick()
            for condition in self._always:
                condition.check(self._watch, self._where())
        return ticks

    def run_for(self, seconds: float) -> None:
        """Run for a time, or to the end of the run if that comes first."""
        __tracebackhide__ = True
        self.step(ticks_in(seconds, self.tick_s, "seconds"))

    def run_until(self, condition: Callable[[], Any], *, within_s: float) -> float:
        """Run until something is the case.

        Returns
        -------
        float
            Simulated time that has passed [s].

        Raises
        ------
        AssertionError
            If it is not within ``within_s``, or the run has ended; says what was last seen.
        """
        __tracebackhide__ = True
        checked_condition(condition)
        begun_s = self.time_s if self.ticks else -self.tick_s
        for _ in range(ticks_in(within_s, self.tick_s, "within_s")):
            if not self.step():
                break
            if self._watch(condition)[0]:
                return self.time_s - begun_s
        _, seen = self._watch(condition)
        ended = "until the end of the run" if self.finished else f"within {within_s:g} s"
        raise AssertionError(f"{self._where()}: not {ended}: {said_of(condition)}{seen}")

    def always(self, condition: Callable[[], Any]) -> None:
        """Check a condition after every tick from now on; a failure names the tick.

        It is not decided in a tick in which it compares a value that is not known; at the end of
        the run it must have been decided at least once.
        """
        if self._session is not None:
            self._unfinished("always")
        self._always.append(Always(checked_condition(condition)))

    def run_to_end(self) -> Outcome:
        """Run to the end of the scenario."""
        __tracebackhide__ = True
        while self.step():
            pass
        self.conclude()
        return self.outcome()

    def conclude(self) -> None:
        """Raise AssertionError if a condition of `always` was never decided."""
        __tracebackhide__ = True
        for condition in self._always:
            condition.conclude()

    # What is said and true ---------------------------------------------------------------

    def topic(self, name: str) -> TopicHistory:
        """Messages of a topic so far: ``latest``, ``all`` and ``count``, as typed views.

        From the beginning on, but for waveforms: those from the first time they are asked for.
        """
        self._running()
        assert self._histories is not None
        return self._histories[name]

    @property
    def histories(self) -> dict[str, TopicHistory]:
        """Everything that has been kept of the run, by topic; also when it is closed."""
        return {} if self._histories is None else self._histories.kept

    @property
    def topics(self) -> list[str]:
        """Names of all topics that nodes of this process send on."""
        self._running()
        assert self._histories is not None
        return self._histories.names

    def publishers_of(self, name: str) -> list[Any]:
        """What the graph of ROS says of the publishers of a topic: nodes, types, QoS."""
        return list(self._running().observer.get_publishers_info_by_topic(name))

    def health_events(self) -> list[dict[str, Any]]:
        """What nodes have said of their health, in the order of time."""
        return list(self._running().observer.intake.events)

    def truth(self, train: str) -> Truth:
        """Where a train is and how it moves: for judging, not for equipment."""
        trains = self._running().truth
        if train not in trains:
            raise InputError(f"there are {', '.join(trains)}", field="train", value=train)
        return trains[train]

    def report(self) -> dict[str, Any]:
        """Report of the run so far."""
        return self._running().report()

    def verdict(self) -> Verdict:
        """Every figure of the report that must be zero in a safe run."""
        return verdict_of(self.report())

    def outcome(self) -> Outcome:
        """Report and verdict of the run so far."""
        report = self.report()
        return Outcome(report, verdict_of(report))

    # The end -----------------------------------------------------------------------------

    def keep_recording(self, path: Path | None = None) -> Path | None:
        """Write what has been recorded so far; its path, None if nothing has been.

        ``rail report`` and ``rail replay`` read it.
        """
        if self._session is None:
            return None
        return self._evidence.write(path, RunNotes.of(self._session))

    def last_seen(self) -> str:
        """Where the run stands, and what nodes last said of their health: for a failed test."""
        what = f"{self._scenario.name}, seed {self.seed}"
        if self._session is None:
            return f"{what}: not started"
        return f"{what}, {self._where()}{said_of_health(self._session.observer.intake.events)}"

    def close(self) -> None:
        """End everything; harmless when called again."""
        if self._closed:
            return
        self._closed = True
        try:
            self._under_test.close()
            if self._session is not None:
                self._session.close()
        finally:
            self._evidence.close()
            self._held.close()

    def _running(self) -> SteppedCorridor:
        if self._closed:
            raise RuntimeError("the corridor is closed")
        if self._session is None:
            self._begin()
        assert self._session is not None
        return self._session

    def _begin(self) -> None:
        discover_on("this")
        domain = self._held.enter_context(free_domain(self._domain))
        self._session = SteppedCorridor(
            self._scenario,
            domain=domain,
            placement=self.placement,
            timeout_s=self._timeout_s,
            external=self._under_test.replaced,
            attached=self._under_test.awaited,
            tap=self._evidence.tap,
            switches=self._switches,
        )
        try:
            self._interference = Interference(self._session)
            self._under_test.enter(self._session, domain, self._said)
            self._histories = Histories(self._session)
            for name in self._under_test.commands:
                self._histories.expect(name)
            self._session.start()
            self._under_test.after_tick(self._session, self._killed)
        except BaseException:
            self.close()
            raise

    def _malformed(self, node: str) -> str:
        """What is wrong with what a node has sent last; empty if nothing is."""
        return "" if self._histories is None else self._histories.malformed(node)

    def _said(self, topic: str) -> Sequence[Any]:
        history = self.histories.get(topic)
        return () if history is None else history.sent

    def _expect(self, node: str) -> None:
        assert self._histories is not None
        self._histories.expect(node)

    def _kind(self, topic: str) -> Any:
        assert self._histories is not None
        return self._histories.kind(topic)

    def _watch(self, condition: Callable[[], Any]) -> tuple[bool | None, Watched]:
        """What a condition says, None if it is not decided, and what it has looked at."""
        assert self._histories is not None
        self._histories.looked_at.clear()
        try:
            value = bool(condition())
        except NotKnownError:
            value = None
        seen = list(self._histories.looked_at)
        return value, Watched({name: self._histories[name] for name in seen})

    def _where(self) -> str:
        return f"tick {self.ticks - 1} ({self.time_s:.2f} s)" if self.ticks else "before tick 0"
