"""What many runs say of a figure, with its 95 % interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import beta, t

from .figures import OverRuns

_LEVEL: Final = 0.95


@dataclass(frozen=True)
class Estimate:
    """A value and the interval that holds it; without an interval low and high are NaN."""

    value: float
    low: float
    high: float
    runs: int

    @property
    def half_width(self) -> float:
        """Half of the interval; NaN without one."""
        return 0.5 * (self.high - self.low)


def estimate(values: Sequence[float], how: OverRuns) -> Estimate:
    """Estimate from the runs in which a figure is known.

    The interval of a mean is Student's, that of a proportion Clopper and Pearson's (1934); a
    sum, a least and a greatest value have none.

    >>> estimate([1.0, 0.0, 0.0, 0.0], "proportion").value
    0.25
    """
    known = np.asarray([value for value in values if not math.isnan(value)], dtype=np.float64)
    n, nan = known.size, math.nan
    if n == 0:
        return Estimate(nan, nan, nan, 0)
    if how == "proportion":
        hits = int(np.count_nonzero(known))
        low = float(beta.ppf((1 - _LEVEL) / 2, hits, n - hits + 1)) if hits else 0.0
        high = float(beta.ppf((1 + _LEVEL) / 2, hits + 1, n - hits)) if hits < n else 1.0
        return Estimate(hits / n, low, high, n)
    if how == "mean":
        mean = float(known.mean())
        if n == 1:
            return Estimate(mean, nan, nan, n)
        reach = float(t.ppf((1 + _LEVEL) / 2, n - 1)) * float(known.std(ddof=1)) / math.sqrt(n)
        return Estimate(mean, mean - reach, mean + reach, n)
    value = math.fsum(known) if how == "sum" else known.min() if how == "min" else known.max()
    return Estimate(float(value), nan, nan, n)
