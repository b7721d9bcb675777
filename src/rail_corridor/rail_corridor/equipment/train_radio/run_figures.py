"""The train radio in the figures of a run."""

from __future__ import annotations

from rail_corridor.equipment.run_figures import FigureData, RunFigures
from rail_msgs_py.topics.train_radio import ATP_STATE
from rail_signals.arrays import FloatArray


class TrainRadioFigures(RunFigures):
    """What the train radio adds."""

    def path_limits(self, run: FigureData) -> tuple[str, FloatArray] | None:
        """Ends of the authorities on board."""
        if ATP_STATE not in run.data:
            return None
        ends_m = run.data[ATP_STATE].upto(run.data.ticks)[
            ..., ATP_STATE.index["end_of_authority_m"]
        ]
        return "end of authority\non board", ends_m
