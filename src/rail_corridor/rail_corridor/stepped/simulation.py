"""A scenario in one plain Python loop, for those who study what the receivers understood.

    from rail_corridor import simulate

    for tick in simulate("demo", seed=4):
        error_m = tick["/wayside/zone_controller/train_a/position"].chainage_m
        error_m -= tick.truth["train_a"].front_m

Nodes, digest and report are those of ``rail run``; there is nothing of ROS to start or to spin.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import free_domain
from rail_corridor.report.verdict import Verdict, verdict_of
from rail_corridor.scenario.model import Scenario

from .corridor import SteppedCorridor
from .histories import Histories
from .truth import Truth


class Tick:
    """One tick that has run.

    Parameters
    ----------
    number : int
    time_s : float
        Simulated time [s].
    truth : mapping of Truth
        By train.
    histories : Histories
        What has been sent.
    """

    def __init__(
        self, number: int, time_s: float, truth: Mapping[str, Truth], histories: Histories
    ) -> None:
        self.number, self.time_s, self.truth = number, time_s, truth
        self._histories = histories

    def __getitem__(self, topic: str) -> Any:
        """Typed view of the newest message of a topic.

        Raises
        ------
        InputError
            If nobody sends on it.
        LookupError
            If nothing has been sent yet.
        """
        return self._histories[topic].latest

    def __repr__(self) -> str:
        return f"<tick {self.number}, {self.time_s:.3f} s>"


class Simulation:
    """A run that advances as it is iterated over; it can be left at any time.

    Parameters
    ----------
    scenario : str, Path or Scenario
        A built-in one, a YAML file, or one made in Python.
    seed : int, optional
    duration_s : float, optional
        Both of a scenario by name.

    Raises
    ------
    InputError
        If the scenario is wrong.
    """

    def __init__(
        self,
        scenario: str | Path | Scenario,
        *,
        seed: int | None = None,
        duration_s: float | None = None,
    ) -> None:
        overrides = Overrides(seed=seed, duration_s=duration_s)
        if not isinstance(scenario, Scenario):
            scenario = load_scenario(scenario, overrides=overrides)
        self.scenario = scenario
        self._report: dict[str, Any] | None = None

    def __iter__(self) -> Iterator[Tick]:
        """Run from the beginning."""
        discover_on("this")
        with ExitStack() as held:
            domain = held.enter_context(free_domain())
            corridor = SteppedCorridor(self.scenario, domain=domain)
            held.callback(corridor.close)
            histories = Histories(corridor)
            self._report = None
            try:
                while corridor.step():
                    histories.after_tick()
                    yield Tick(corridor.ticks - 1, corridor.time_s, corridor.truth, histories)
            finally:
                self._report = corridor.report()

    def run(self) -> Simulation:
        """Run all of it, for those who want its report alone."""
        for _ in self:
            pass
        return self

    @property
    def report(self) -> dict[str, Any]:
        """Report as of ``rail run --report``, of as much as has been run."""
        if self._report is None:
            raise RuntimeError("nothing has been run to its end, or left, yet")
        return self._report

    @property
    def digest(self) -> str:
        """Of everything that equipment has estimated: that of ``rail run``."""
        return str(self.report["digest"])

    @property
    def verdict(self) -> Verdict:
        """Whether it was safe."""
        return verdict_of(self.report)
