"""What many runs say of a figure, with its 95 % interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import beta, binom, chi2, t

from rail_signals.arrays import FloatArray

from .figures import OverRuns

_LOW, _HIGH = 0.025, 0.975
_QUANTILES: Final = {"median": 0.5, "p90": 0.9, "p95": 0.95}


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


def known_or_nan(value: float | None) -> float:
    """A value, NaN where it is not known."""
    return math.nan if value is None else value


def estimate(
    values: Sequence[float], how: OverRuns, per: Sequence[float] | None = None
) -> Estimate:
    """Estimate from the runs in which a figure is known.

    Parameters
    ----------
    values : sequence of float
        Of each run; NaN where it is not known.
    how : str
        What is made of them.
    per : sequence of float, optional
        What the sum is divided by, of each run: trials of a proportion, exposure of a rate.

    Notes
    -----
    The interval of a mean is Student's, that of a proportion Clopper and Pearson's (1934), that of
    a rate Garwood's (1936), that of a quantile made of order statistics; a sum, a least and a
    greatest value have none. Where counts differ from run to run by more than Poisson's law lets
    them, the interval of a rate is that of so many fewer (quasi-Poisson: McCullagh and Nelder,
    Generalized Linear Models, 1989, section 6.2).

    >>> estimate([1.0, 0.0, 0.0, 0.0], "proportion").value
    0.25
    >>> estimate([3.0, 1.0], "rate", per=[10.0, 30.0]).value
    0.1
    """
    known = np.asarray(values, dtype=np.float64)
    over = np.ones_like(known) if per is None else np.asarray(per, dtype=np.float64)
    both = ~(np.isnan(known) | np.isnan(over))
    known, over = known[both], over[both]
    n, nan = int(known.size), math.nan
    if n == 0:
        return Estimate(nan, nan, nan, 0)
    match how:
        case "proportion":
            hits = float(np.count_nonzero(known)) if per is None else math.fsum(known)
            return Estimate(*_proportion(hits, math.fsum(over)), n)
        case "rate":
            return Estimate(*_rate(known, over), n)
        case "mean":
            return Estimate(*_mean(known), n)
        case "median" | "p90" | "p95":
            return Estimate(*_quantile(np.sort(known), _QUANTILES[how]), n)
        case "sum":
            return Estimate(math.fsum(known), nan, nan, n)
        case "min":
            return Estimate(float(known.min()), nan, nan, n)
        case "max":
            return Estimate(float(known.max()), nan, nan, n)


def _proportion(hits: float, n: float) -> tuple[float, float, float]:
    if not 0.0 <= hits <= n or n == 0.0:
        return math.nan, math.nan, math.nan
    low = float(beta.ppf(_LOW, hits, n - hits + 1)) if hits else 0.0
    high = float(beta.ppf(_HIGH, hits + 1, n - hits)) if hits < n else 1.0
    return hits / n, low, high


def _rate(counts: FloatArray, exposures: FloatArray) -> tuple[float, float, float]:
    count, exposure = math.fsum(counts), math.fsum(exposures)
    if not exposure > 0.0:
        return math.nan, math.nan, math.nan
    spread = _dispersion(counts, exposures, count / exposure)
    count, exposure = count / spread, exposure / spread
    low = float(chi2.ppf(_LOW, 2 * count)) / 2.0 if count else 0.0
    high = float(chi2.ppf(_HIGH, 2 * count + 2)) / 2.0
    return count / exposure, low / exposure, high / exposure


def _dispersion(counts: FloatArray, exposures: FloatArray, rate: float) -> float:
    """Pearson's variance of counts over Poisson's, at least 1: what comes in clusters."""
    there = exposures > 0.0
    expected = rate * exposures[there]
    if expected.size < 2 or not rate > 0.0:
        return 1.0
    pearson = float(np.sum((counts[there] - expected) ** 2 / expected))
    return max(1.0, pearson / (expected.size - 1))


def _mean(known: FloatArray) -> tuple[float, float, float]:
    mean, n = float(known.mean()), known.size
    if n == 1:
        return mean, math.nan, math.nan
    reach = float(t.ppf(_HIGH, n - 1)) * float(known.std(ddof=1)) / math.sqrt(n)
    return mean, mean - reach, mean + reach


def _quantile(ordered: FloatArray, share: float) -> tuple[float, float, float]:
    """Of n values those between which a quantile lies in 95 %, as far as n allows that."""
    n = ordered.size
    value = float(np.quantile(ordered, share))
    low, high = int(binom.ppf(_LOW, n, share)) - 1, int(binom.ppf(_HIGH, n, share))
    # Beyond the outermost values nothing is known: then there is no interval.
    if low < 0 or high >= n:
        return value, math.nan, math.nan
    return value, float(ordered[low]), float(ordered[high])
