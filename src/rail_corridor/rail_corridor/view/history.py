"""What the time-distance chart is drawn from: rows of a run, thinned so that they stay few."""

from __future__ import annotations

import math
from typing import Any

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_state import LiveState
from rail_corridor.equipment.registry import live_views

MOST_ROWS = 1500
LEAST_STEP_S = 0.5


class History:
    """Rows by time, at least `LEAST_STEP_S` apart.

    With `MOST_ROWS` every other row is dropped and the step doubled, so a run of any length keeps
    its whole shape. ``generation`` counts how often rows were dropped or all of them forgotten: who
    has rows of another generation has to fetch them all again.
    """

    def __init__(self, most_rows: int = MOST_ROWS, step_s: float = LEAST_STEP_S) -> None:
        self._most = most_rows
        self._least_step_s = step_s
        self.generation = 0
        self.step_s = step_s
        self.rows: list[list[Any]] = []

    def put(self, time_s: float, row: list[Any]) -> bool:
        """Add a row if its time has come; returns whether it was added."""
        if self.rows and time_s < self.rows[-1][0] + self.step_s - 1e-9:
            return False
        self.rows.append([round(time_s, 3), *row])
        if len(self.rows) >= self._most:
            self.rows = self.rows[::2]
            self.step_s *= 2.0
            self.generation += 1
        return True

    def clear(self) -> None:
        """Forget everything: another run."""
        self.rows = []
        self.step_s = self._least_step_s
        self.generation += 1

    def since(self, generation: int, count: int) -> tuple[int, list[list[Any]]]:
        """Where the rows begin that a reader of ``count`` rows of a generation lacks, and they."""
        if generation != self.generation or not 0 <= count <= len(self.rows):
            count = 0
        return count, self.rows[count:]


def traced() -> tuple[LiveView, ...]:
    """Whose errors the page can draw, in the order of a row."""
    return tuple(view for view in live_views() if view.error_trace is not None)


def history_row(state: LiveState, train: str) -> list[Any] | None:
    """Where a train is: track, measured position and its sigma, truth.

    Behind that for each of `traced` its estimate, low and high end less the truth of its own tick;
    three times None where it has none, unless nothing follows. None if the train is not on the
    line.
    """
    measured = state.position(train)
    true = state.true_place(train, measured.stamp_ns) if measured is not None else None
    if true is None:
        measured, true = None, state.true_place(train, state.now_ns)
    if true is None:
        return None
    if measured is None or not measured.known:
        row: list[Any] = [true[0], None, None, round(true[1], 2)]
    else:
        row = [
            measured.track,
            round(measured.chainage_m, 2),
            round(math.sqrt(measured.variance_m2), 3),
            round(true[1], 2) if true[0] in ("", measured.track) else None,
        ]
    errors: list[Any] = []
    for view in traced():
        error = view.error(state, train)
        errors += [None] * 3 if error is None else [round(value, 2) for value in error]
    while errors and errors[-1] is None:
        errors.pop()
    return [*row, *errors]
