"""One run of a corridor within this process, to its report."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import free_domain
from rail_corridor.run.kills import Kill
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_corridor.stepped.corridor import SteppedCorridor
from rail_corridor.stepped.interference import Interference

#: Variable of the environment of a worker: the folder that goes with it, however it ends.
SCRATCH: Final = "RAIL_STUDY_SCRATCH"
#: Each such piece may take twice the time-out of a node [ticks].
_PIECE: Final = 200


class CorridorRun(NamedTuple):
    """Of one run: its report, and the truth and estimates that it is made of."""

    report: dict[str, Any]
    data: RunData


def run_corridor(
    scenario: Scenario,
    *,
    kills: Iterable[Kill] = (),
    ticks: int | None = None,
    timeout_s: float = 40.0,
) -> CorridorRun:
    """Run a scenario; the report is as ``rail run`` writes it, its digest is the same.

    Parameters
    ----------
    scenario : Scenario
    kills : iterable of Kill
        Nodes that end before the first tick that is not earlier than their time.
    ticks : int, optional
        End after so many.
    timeout_s : float
        Wall time without an answer after which a node counts as failed.

    Raises
    ------
    StalledError
        If it does not go on.
    InputError
        If there is no such node, or no ROS domain is free.
    """
    discover_on("none")
    with free_domain() as domain:
        corridor = SteppedCorridor(
            scenario,
            domain=domain,
            timeout_s=timeout_s,
            intercepts=False,
            scratch=os.environ.get(SCRATCH),
        )
        try:
            interference = Interference(corridor)
            for kill in sorted(kills, key=lambda kill: kill.time_s):
                at = math.ceil(kill.time_s / scenario.tick_s - 1e-9)
                if ticks is not None and at >= ticks:
                    break
                _run_to(corridor, at)
                if not corridor.finished:
                    interference.kill(kill.node)
            _run_to(corridor, ticks)
            return CorridorRun(corridor.report(), corridor.observer.recording)
        finally:
            corridor.close()


def _run_to(corridor: SteppedCorridor, ticks: int | None) -> None:
    """Run to a number of ticks, or to the end."""
    while not corridor.finished and (ticks is None or corridor.ticks < ticks):
        wanted = _PIECE if ticks is None else min(_PIECE, ticks - corridor.ticks)
        if not corridor.step(wanted):
            return
