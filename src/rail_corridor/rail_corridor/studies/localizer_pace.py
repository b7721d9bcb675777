"""Pace of trains on the localizer: two trains run to a stop, with it and without.

Nothing fails. What the localizer does not know for sure must not slow trains down, nor make the
protection brake them: the same scenario is run with it and without, and compared by the truth.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import Field

from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.run_data import RunData
from rail_corridor.study.corridor_run import run_corridor
from rail_corridor.study.strict import Strict
from rail_msgs_py.topics.world import COMMAND, STATE
from rail_onboard.track_code.supervision import STANDSTILL_MPS
from rail_signals.arrays import BoolArray, FloatArray

#: Where trains start, and up to where they are timed [m], the foremost first. It is timed up to
#: shortly before its stop, the other one, which comes up behind it, before it slows down.
PLACES_M: Final = ((850.0, 1390.0), (450.0, 1000.0))
_STOP_M, _TRACK_M = 1400.0, 1500.0
#: Time that a train is given over that of the way at the limit [s].
_SPARE_S: Final = 90.0


class PaceParameters(Strict):
    """A limit, and the tick of the simulation."""

    limit_kmh: float = Field(50.0, ge=10.0, le=160.0)
    tick_s: float = Field(0.25, ge=0.1, le=1.0)


def pace_scenario(parameters: PaceParameters, seed: int, *, localizer: bool) -> dict[str, Any]:
    """Data of the scenario of one run."""
    way_s = (_STOP_M - PLACES_M[-1][0]) / (parameters.limit_kmh / 3.6)
    return {
        "name": "localizer_pace",
        "description": "One run of the study of the localizer's pace",
        "seed": seed,
        "duration_s": float(round(way_s + _SPARE_S)),
        "tick_s": parameters.tick_s,
        "tracks": {
            "main": {
                "elements": [{"straight_m": _TRACK_M}],
                "speed_limits": [[0, parameters.limit_kmh]],
                "stops_m": [_STOP_M],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1000.0},
        "references": {"spacing_m": 500.0},
        "trains": [
            {"name": name, "route": ["main"], "start_m": start_m}
            for name, (start_m, _) in zip("ab", PLACES_M, strict=True)
        ],
    } | ({"localizer": {}} if localizer else {})


def compare_pace(parameters: PaceParameters, seed: int) -> dict[str, float | None]:
    """Times of two trains on the localizer over those without it, and braking by protection.

    Parameters
    ----------
    parameters : PaceParameters
    seed : int
    """
    time_s, braked = _run(parameters, seed, localizer=True)
    without_s, braked_without = _run(parameters, seed, localizer=False)
    return {
        "time_s": _known(float(time_s.max())),
        "without_s": _known(float(without_s.max())),
        # One that never arrives is late by more than any bound.
        "longer_pct": 100.0 * float(np.max(np.minimum(time_s, 1e6) / without_s - 1.0)),
        "arrived": float(np.count_nonzero(np.isfinite(time_s))),
        "braked_ticks": float(np.count_nonzero(braked)),
        "braked_ticks_without": float(np.count_nonzero(braked_without)),
    }


def _known(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _run(parameters: PaceParameters, seed: int, *, localizer: bool) -> tuple[FloatArray, BoolArray]:
    data = pace_scenario(parameters, seed, localizer=localizer)
    scenario = scenario_from_data(data, directory=Path.cwd())
    run = run_corridor(scenario).data
    return arrivals_s(run, parameters.tick_s), braked_while_moving(run)


def arrivals_s(run: RunData, tick_s: float) -> FloatArray:
    """When each train has come to where it is timed [s], infinite if it has not."""
    front_m = run[STATE].upto(run.ticks)[:, :, STATE.index["chainage_m"]]
    found = []
    for index, (_, to_m) in enumerate(PLACES_M):
        there = np.flatnonzero(front_m[:, index] >= to_m)
        if not there.size:
            found.append(np.inf)
            continue
        last = int(there[0])
        pair = front_m[last - 1 : last + 1, index]
        found.append(float(np.interp(to_m, pair, tick_s * np.arange(last, last + 2))))
    return np.array(found)


def braked_while_moving(run: RunData) -> BoolArray:
    """Whether protection brakes a train that runs [tick, train]."""
    command = run[COMMAND].upto(run.ticks)
    braked = (command[:, :, COMMAND.index["service_brake"]] > 0.0) | (
        command[:, :, COMMAND.index["emergency_brake"]] > 0.0
    )
    speed_mps = np.abs(run[STATE].upto(run.ticks)[:, :, STATE.index["speed_mps"]])
    return np.asarray(braked & (speed_mps > STANDSTILL_MPS))
