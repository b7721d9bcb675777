"""From a recording to figures: positions on board, by Doppler shifts and from all sensors."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.report.run_data import FloatArray, Recording
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.world import STATE

from .referenced_track import ReferencedTrack


def positioning_metrics(scenario: Scenario, recording: Recording, index: int) -> dict[str, Any]:
    """Sections ``doppler`` and ``localizer`` of one train, as far as there are any.

    ``bound_m`` is the Cramér-Rao bound over the same blocks, root mean square as ``rmse_m``;
    what faults do to stations is not in it.
    """
    ticks = recording.ticks
    mine = recording.state.upto(ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    front_m = mine[:, STATE.index["chainage_m"]]
    found: dict[str, Any] = {}
    if recording.references:
        fixes = recording.doppler.upto(ticks)[:, index]
        bound_m = doppler_bound_m(scenario, recording, index)
        found["doppler"] = _doppler(on_line, front_m, fixes, bound_m[~np.isnan(bound_m)])
    if recording.localizer:
        located = recording.located.upto(ticks)[:, index]
        found["localizer"] = _localizer(on_line, front_m, located)
    return found


def doppler_bound_m(scenario: Scenario, recording: Recording, index: int) -> FloatArray:
    """Bound of the Doppler positions of one train [tick] [m], NaN where it has given none."""
    mine = recording.state.upto(recording.ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    fixes = recording.doppler.upto(recording.ticks)[:, index]
    given = on_line & (fixes[:, DOPPLER_FIX.index["reason"]] == 0.0)
    bound_m = np.full(len(mine), np.nan)
    if given.any():
        here = ReferencedTrack.of(scenario, scenario.trains[index].route[0])
        front_m, speed_mps = (
            mine[on_line, STATE.index[name]] for name in ("chainage_m", "speed_mps")
        )
        positions = given[on_line]
        bounds_m = here.run_bound_m(front_m, speed_mps, positions, scenario.tick_s)
        bound_m[given] = bounds_m[positions]
    return bound_m


def _doppler(
    on_line: NDArray[np.bool_], front_m: FloatArray, fixes: FloatArray, bound_m: FloatArray
) -> dict[str, float | int | None]:
    there = on_line & (fixes[:, DOPPLER_FIX.index["reason"]] == 0.0)
    error_m = fixes[there, DOPPLER_FIX.index["chainage_m"]] - front_m[there]
    variance_m2 = fixes[there, DOPPLER_FIX.index["chainage_m2"]]
    stated_m = float(np.sqrt(np.mean(variance_m2))) if error_m.size else None
    return {
        "availability": _share(there, on_line),
        **_errors(error_m),
        "bound_m": float(np.sqrt(np.mean(bound_m**2))) if bound_m.size else None,
        "stated_m": stated_m,
        "normalised_error": float(np.mean(error_m**2 / variance_m2)) if error_m.size else None,
    }


def _localizer(
    on_line: NDArray[np.bool_], front_m: FloatArray, located: FloatArray
) -> dict[str, float | int | None]:
    there = on_line & (located[:, LOCALIZER_STATE.index["status"]] > 0.0)
    low_m, high_m = (
        located[there, LOCALIZER_STATE.index["low_m"]],
        located[there, LOCALIZER_STATE.index["high_m"]],
    )
    truth_m = front_m[there]
    # An interval that is no number holds nothing.
    holds = (low_m <= truth_m) & (truth_m <= high_m)
    level_m = 0.5 * (high_m - low_m)
    level_m = level_m[np.isfinite(level_m)]
    return {
        "availability": _share(there, on_line),
        "protected": _share(there & (located[:, LOCALIZER_STATE.index["status"]] > 1.0), on_line),
        **_errors(located[there, LOCALIZER_STATE.index["front_m"]] - truth_m),
        "protection_level_m": float(np.median(level_m)) if level_m.size else None,
        "protection_level_p95_m": float(np.quantile(level_m, 0.95)) if level_m.size else None,
        "exceeded": int(np.count_nonzero(~holds)),
        "excluded_ticks": int(
            np.count_nonzero(located[there, LOCALIZER_STATE.index["excluded"]] > 0.0)
        ),
    }


def _errors(error_m: FloatArray) -> dict[str, float | int | None]:
    size_m = np.abs(error_m[np.isfinite(error_m)])
    if not size_m.size:
        return {"rmse_m": None, "p95_m": None, "max_m": None}
    return {
        "rmse_m": float(np.sqrt(np.mean(size_m**2))),
        "p95_m": float(np.quantile(size_m, 0.95)),
        "max_m": float(size_m.max()),
    }


def _share(part: NDArray[np.bool_], whole: NDArray[np.bool_]) -> float | None:
    count = int(np.count_nonzero(whole))
    return float(np.count_nonzero(part)) / count if count else None
