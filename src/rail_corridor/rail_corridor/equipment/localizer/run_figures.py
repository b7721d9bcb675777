"""The localizer in the figures of a run."""

from __future__ import annotations

import numpy as np

from rail_corridor.equipment.run_figures import ErrorPanel, FigureData, RunFigures
from rail_msgs_py.topics.localizer import LOCALIZER_STATE


class LocalizerFigures(RunFigures):
    """What the localizer adds."""

    def error_panel(self, run: FigureData, train: int) -> ErrorPanel | None:
        """Its positions against the protection level that it claims."""
        if LOCALIZER_STATE not in run.data:
            return None
        table = run.data[LOCALIZER_STATE].upto(run.data.ticks)[:, train]
        status, front_m, low_m, high_m = (
            table[:, LOCALIZER_STATE.index[column]]
            for column in ("status", "front_m", "low_m", "high_m")
        )
        error_m = front_m - run.state(train, "chainage_m")
        return ErrorPanel(
            "from all sensors,\non board",
            run.state(train, "path_m"),
            np.where(status > 0.0, error_m, np.nan),
            "protection level",
            np.where(status > 0.0, 0.5 * (high_m - low_m), np.nan),
            claimed=True,
        )
