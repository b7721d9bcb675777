"""When a cell has had enough runs."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping
from typing import Final

from .figures import Figure
from .intervals import estimate, known_or_nan
from .model import Stop

#: An interval is looked at again after one run in so many more.
_SELDOM: Final = 50


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
        self._values, self._per = array("d"), array("d")
        self._sum = 0.0
        self._look_at = 0
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
                del self._values[:], self._per[:]

    def _look(self, figures: Mapping[str, float | None] | None) -> None:
        if figures is None:
            return
        if self._rule.half_width is not None:
            name = self._rule.half_width.figure
            self._values.append(known_or_nan(figures.get(name)))
            per = self._figures[name].per
            self._per.append(1.0 if per is None else known_or_nan(figures.get(per)))
        if self._rule.events is not None:
            value = known_or_nan(figures.get(self._rule.events.figure))
            self._sum += 0.0 if math.isnan(value) else value

    def _is_enough(self) -> bool:
        rule = self._rule
        if rule.events is not None and self._sum >= rule.events.count:
            return True
        n = len(self._values)
        if rule.half_width is None or n < max(rule.half_width.least_runs, self._look_at):
            return False
        self._look_at = n + 1 + n // _SELDOM
        figure = self._figures[rule.half_width.figure]
        # What has no interval of its own is judged by its mean.
        how = "mean" if figure.over_runs in ("sum", "min", "max") else figure.over_runs
        found = estimate(self._values, how, None if figure.per is None else self._per)
        return found.half_width <= rule.half_width.below
