"""Doppler positioning in the figures of a run."""

from __future__ import annotations

import numpy as np

from rail_corridor.equipment.run_figures import ErrorPanel, FigureData, RunFigures
from rail_msgs_py.topics.doppler import DOPPLER_FIX

from .report import doppler_bound_m

#: A bound that is smaller is not drawn so.
_LEAST_M = 1e-3


class DopplerFigures(RunFigures):
    """What Doppler positioning adds."""

    def error_panel(self, run: FigureData, train: int) -> ErrorPanel | None:
        """Positions by Doppler shifts against the bound of geometry."""
        if DOPPLER_FIX not in run.data:
            return None
        bound_m = doppler_bound_m(run.scenario, run.data, train)
        fixes = run.data[DOPPLER_FIX].upto(run.data.ticks)[:, train]
        error_m = fixes[:, DOPPLER_FIX.index["chainage_m"]] - run.state(train, "chainage_m")
        return ErrorPanel(
            "by Doppler shifts,\non board",
            run.state(train, "path_m"),
            np.where(np.isnan(bound_m), np.nan, error_m),
            "Cramér-Rao bound",
            np.maximum(bound_m, _LEAST_M),
        )
