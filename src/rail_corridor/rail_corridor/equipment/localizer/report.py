"""From a run to values: the position from all sensors, and its protection level."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_corridor.equipment.position_errors import errors_of, fraction_of
from rail_corridor.run_data import RunData
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray


def localizer_metrics(recording: RunData, index: int) -> dict[str, Any]:
    """Section ``localizer`` of one train; ``exceeded`` counts ticks of misleading information."""
    mine = recording[STATE].upto(recording.ticks)[:, index]
    on_line = mine[:, STATE.index["on_line"]] > 0.0
    located = recording[LOCALIZER_STATE].upto(recording.ticks)[:, index]
    return {"localizer": _localizer(on_line, mine[:, STATE.index["chainage_m"]], located)}


def _localizer(
    on_line: NDArray[np.bool_], front_m: FloatArray, located: FloatArray
) -> dict[str, float | int | None]:
    status = located[:, LOCALIZER_STATE.index["status"]]
    there = on_line & (status > 0.0)
    low_m, high_m = (
        located[there, LOCALIZER_STATE.index["low_m"]],
        located[there, LOCALIZER_STATE.index["high_m"]],
    )
    truth_m = front_m[there]
    # An interval that is not a number holds nothing.
    holds = (low_m <= truth_m) & (truth_m <= high_m)
    level_m = 0.5 * (high_m - low_m)
    level_m = level_m[np.isfinite(level_m)]
    return {
        "availability": fraction_of(there, on_line),
        "protected": fraction_of(
            there & (located[:, LOCALIZER_STATE.index["status"]] > 1.0), on_line
        ),
        **errors_of(located[there, LOCALIZER_STATE.index["front_m"]] - truth_m),
        "protection_level_m": float(np.median(level_m)) if level_m.size else None,
        "protection_level_p95_m": float(np.quantile(level_m, 0.95)) if level_m.size else None,
        "exceeded": int(np.count_nonzero(~holds)),
        "excluded_ticks": int(
            np.count_nonzero(located[there, LOCALIZER_STATE.index["excluded"]] > 0.0)
        ),
    }
