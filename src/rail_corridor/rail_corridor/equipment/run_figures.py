"""What equipment adds to the figures of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FigureData:
    """A run that figures are drawn of."""

    scenario: Scenario
    data: RunData

    @property
    def times_s(self) -> FloatArray:
        """Time of each tick."""
        ticks = np.arange(1, self.data.ticks + 1)
        return np.asarray(ticks * self.scenario.tick_s, dtype=np.float64)

    def states(self, train: int) -> FloatArray:
        """State of a train [tick, column of `STATE`], NaN while it is not on the line."""
        state: FloatArray = self.data[STATE].upto(self.data.ticks)[:, train].copy()
        state[~(state[:, STATE.index["on_line"]] > 0.0)] = np.nan
        return state

    def state(self, train: int, column: str) -> FloatArray:
        """One column of it, by tick."""
        return self.states(train)[:, STATE.index[column]]

    @property
    def furthest(self) -> int:
        """Index of the train that travelled furthest: the one shown where only one is."""
        paths_m = [self.state(train, "path_m") for train in range(len(self.data.trains))]
        return int(np.argmax([float(np.nansum(np.abs(np.diff(path_m)))) for path_m in paths_m]))


@dataclass(frozen=True)
class RunFigure:
    """What draws a figure of a run, what to see, and whether there is anything to draw."""

    draw: Callable[[Figure, FigureData], None]
    caption: str
    applies: Callable[[FigureData], bool]


@dataclass(frozen=True)
class ErrorPanel:
    """Errors of positions along the path of a train, and what they are held against.

    Parameters
    ----------
    label : str
        What the positions are.
    path_m, error_m : float64 [position]
        NaN where there is none.
    bound_label : str
    bound_m : float64 [position]
    claimed : bool
        Whether the equipment claims the bound itself, and theory does not.
    """

    label: str
    path_m: FloatArray
    error_m: FloatArray
    bound_label: str
    bound_m: FloatArray
    claimed: bool = False


class RunFigures:
    """What one kind of equipment adds to the figures of a run; a class derives from this."""

    #: Figures of its own, by their names.
    figures: ClassVar[Mapping[str, RunFigure]] = {}

    def error_panel(self, run: FigureData, train: int) -> ErrorPanel | None:
        """Its positions in the figure of errors; None where the run has none."""
        return None

    def path_limits(self, run: FigureData) -> tuple[str, FloatArray] | None:
        """Label, and places on their paths that trains must not pass [tick, train]; or None."""
        return None
