"""From a run to values: positions by Doppler shifts, and the bound they are set against."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.equipment.position_errors import errors_of, fraction_of
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray

from .reference_coverage import ReferencedTrack


def doppler_metrics(scenario: Scenario, recording: RunData, index: int) -> dict[str, Any]:
    """Section ``doppler`` of one train.

    ``bound_m`` is the Cramér-Rao bound over the same blocks, root mean square as ``rmse_m``;
    what faults do to stations is not in it.
    """
    ticks = recording.ticks
    mine = recording[STATE].upto(ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    front_m = mine[:, STATE.index["chainage_m"]]
    fixes = recording[DOPPLER_FIX].upto(ticks)[:, index]
    bound_m = doppler_bound_m(scenario, recording, index)
    return {"doppler": _doppler(on_line, front_m, fixes, bound_m[~np.isnan(bound_m)])}


def doppler_bound_m(scenario: Scenario, recording: RunData, index: int) -> FloatArray:
    """Bound of the Doppler positions of one train [tick] [m], NaN where it has given none."""
    mine = recording[STATE].upto(recording.ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    fixes = recording[DOPPLER_FIX].upto(recording.ticks)[:, index]
    available = on_line & (fixes[:, DOPPLER_FIX.index["reason"]] == 0.0)
    bound_m = np.full(len(mine), np.nan)
    if available.any():
        here = ReferencedTrack.of(scenario, scenario.trains[index].route[0])
        front_m, speed_mps = (
            mine[on_line, STATE.index[name]] for name in ("chainage_m", "speed_mps")
        )
        positions = available[on_line]
        bounds_m = here.run_bound_m(front_m, speed_mps, positions, scenario.tick_s)
        bound_m[available] = bounds_m[positions]
    return bound_m


def _doppler(
    on_line: NDArray[np.bool_], front_m: FloatArray, fixes: FloatArray, bound_m: FloatArray
) -> dict[str, float | int | None]:
    there = on_line & (fixes[:, DOPPLER_FIX.index["reason"]] == 0.0)
    error_m = fixes[there, DOPPLER_FIX.index["chainage_m"]] - front_m[there]
    variance_m2 = fixes[there, DOPPLER_FIX.index["chainage_m2"]]
    stated_m = float(np.sqrt(np.mean(variance_m2))) if error_m.size else None
    return {
        "availability": fraction_of(there, on_line),
        **errors_of(error_m),
        "bound_m": float(np.sqrt(np.mean(bound_m**2))) if bound_m.size else None,
        "stated_m": stated_m,
        "normalised_error": float(np.mean(error_m**2 / variance_m2)) if error_m.size else None,
    }
