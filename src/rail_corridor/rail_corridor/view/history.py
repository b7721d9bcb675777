"""What the time-distance chart is drawn from: rows of a run, thinned so that they stay few."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from .located import off_the_truth

if TYPE_CHECKING:
    from .live_state import Picture

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


def history_row(picture: Picture, train: str) -> list[Any] | None:
    """Where a train is: track, position by phase ranging and its sigma, truth.

    Behind that what a localizer says, less the truth of its own tick: position, low and high end.
    None if the train is not on the line.
    """
    said = picture.positions.get(train)
    true = picture.true_place(train, said[0]) if said is not None else None
    if true is None:
        said, true = None, picture.true_place(train, picture.now_ns)
    if true is None:
        return None
    known = said is not None and math.isfinite(said[2][1])
    if not known or said is None:
        row: list[Any] = [true[0], None, None, round(true[1], 2)]
    else:
        chainage_m, variance_m2 = said[2][:2]
        row = [
            said[1],
            round(chainage_m, 2),
            round(math.sqrt(variance_m2), 3),
            round(true[1], 2) if true[0] in ("", said[1]) else None,
        ]
    off = off_the_truth(picture, train)
    return row if off is None else [*row, *(round(value, 2) for value in off)]
