"""When a cell has had enough runs."""

from __future__ import annotations

import math
from collections.abc import Mapping

from .figures import Figure, OverRuns
from .intervals import estimate
from .model import Stop


class Stopping:
    """Looks at the runs of one cell in the order of their numbers, however they came in.

    So a cell ends with the same run whatever the number of workers.

    Parameters
    ----------
    rule : Stop
    figures : mapping of Figure
    runs : int
        At most so many.
    """

    def __init__(self, rule: Stop, figures: Mapping[str, Figure], runs: int) -> None:
        self._rule, self._figures, self._most = rule, figures, runs
        self._waiting: dict[int, Mapping[str, float | None] | None] = {}
        self._values: list[float] = []
        self._sum = 0.0
        #: Runs that have been looked at, all from the first on.
        self.seen = 0
        #: Runs after which it was enough, None as long as more are wanted.
        self.ended: int | None = None

    def add(self, run: int, figures: Mapping[str, float | None] | None) -> None:
        """Take the figures of a run; None if it has failed."""
        if self.ended is not None:
            return
        self._waiting[run] = figures
        while self.ended is None and self.seen in self._waiting:
            self._look(self._waiting.pop(self.seen))
            self.seen += 1
            if self._is_enough() or self.seen >= self._most:
                self.ended = self.seen
                self._waiting.clear()
                self._values.clear()

    def _look(self, figures: Mapping[str, float | None] | None) -> None:
        if figures is None:
            return
        if self._rule.half_width is not None:
            value = figures.get(self._rule.half_width.figure)
            self._values.append(math.nan if value is None else value)
        if self._rule.events is not None:
            value = figures.get(self._rule.events.figure)
            self._sum += 0.0 if value is None or math.isnan(value) else value

    def _is_enough(self) -> bool:
        rule = self._rule
        if rule.events is not None and self._sum >= rule.events.count:
            return True
        if rule.half_width is None or len(self._values) < rule.half_width.least_runs:
            return False
        how = self._figures[rule.half_width.figure].over_runs
        kind: OverRuns = "proportion" if how == "proportion" else "mean"
        return estimate(self._values, kind).half_width <= rule.half_width.below
