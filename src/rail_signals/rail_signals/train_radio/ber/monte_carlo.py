"""Bit error rates by counting, until the count is good enough.

The interval is that of Clopper and Pearson. It holds for independent bits, but bits of a code
block share a channel and fail together: the count then varies as one of ``bits / clumping``
independent bits, with the clumping (design effect) measured from the numbers of errors per
code block, and the interval is formed for that many.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from numpy.random import BitGenerator
from scipy.stats import beta


class Link(Protocol):
    """A `DiversityLink`, or a `PlainLink` for 16-QAM."""

    bits_per_symbol: int
    bits_per_step: int

    def step(self, generator: BitGenerator, /) -> tuple[int, int]:
        """Wrong bits, and the sum over code blocks of the square of their number."""


@dataclass(frozen=True)
class Result:
    """Errors counted.

    Attributes
    ----------
    errors, bits
        Wrong bits and all bits.
    interval : tuple of float
        Bounds of the error rate at the confidence asked for.
    clumping
        Variance of the count over that of independent bits; 1 if these are independent.
    """

    errors: int
    bits: int
    interval: tuple[float, float]
    clumping: float

    @property
    def rate(self) -> float:
        """Fraction of wrong bits."""
        return self.errors / self.bits

    def holds(self, rate: float) -> bool:
        """Whether a rate lies inside the interval."""
        return self.interval[0] <= rate <= self.interval[1]


def clopper_pearson(errors: float, bits: float, confidence: float) -> tuple[float, float]:
    """Exact interval of the rate of independent errors; counts may be fractions.

    Examples
    --------
    >>> [round(x, 4) for x in clopper_pearson(10, 1000, 0.95)]
    [0.0048, 0.0183]
    """
    if not 0 < confidence < 1:
        raise ValueError(f"confidence must be between 0 and 1, got {confidence!r}")
    if not 0 <= errors <= bits or bits <= 0:
        raise ValueError(f"errors must be in [0, bits], got {errors!r} of {bits!r}")
    tail = (1 - confidence) / 2
    low = float(beta.ppf(tail, errors, bits - errors + 1)) if errors > 0 else 0.0
    high = float(beta.isf(tail, errors + 1, bits - errors)) if errors < bits else 1.0
    return low, high


def until(
    link: Link,
    generator: BitGenerator,
    *,
    half_width: float = 0.1,
    confidence: float = 0.95,
    min_errors: int = 100,
    max_bits: float = 1e9,
) -> Result:
    """Simulate until the interval is narrow and the errors are enough.

    Parameters
    ----------
    link
        What to simulate.
    generator
        Source of all draws: the same seed gives the same result.
    half_width
        Largest half width of the interval, as a fraction of the rate.
    confidence
        Of the interval, as 0.95 or 0.999.
    min_errors
        Errors to count at least.
    max_bits
        End of patience. The interval of what was counted is returned all the same.

    Raises
    ------
    ValueError
        If a limit is not positive; the message quotes it.

    Examples
    --------
    >>> import numpy as np
    >>> from rail_signals.train_radio.ber.closed_form import MRC_1X2, error_rate
    >>> from rail_signals.train_radio.ber.link import DiversityLink
    >>> found = until(DiversityLink(MRC_1X2, 10.0), np.random.SFC64(5))
    >>> found.errors >= 100, found.holds(float(error_rate(MRC_1X2, 10.0)))
    (True, True)
    """
    for name, value in (
        ("half_width", half_width),
        ("min_errors", min_errors),
        ("max_bits", max_bits),
    ):
        if not value > 0:
            raise ValueError(f"{name} must be positive, got {value!r}")
    errors = squares = bits = 0
    check = min_errors
    per_block = 2 * link.bits_per_symbol
    while True:
        more, more_squares = link.step(generator)
        errors += more
        squares += more_squares
        bits += link.bits_per_step
        if errors < check and bits < max_bits:
            continue
        result = _result(errors, squares, bits, per_block, confidence)
        low, high = result.interval
        if bits >= max_bits or (errors and high - low <= 2 * half_width * result.rate):
            return result
        # An interval costs as much as a step: look again after 2 % more.
        check = max(errors + 1, math.ceil(1.02 * errors))


def _result(errors: int, squares: int, bits: int, per_block: int, confidence: float) -> Result:
    clumping = 1.0
    if 0 < errors < bits:
        rate = errors / bits
        blocks = bits / per_block
        variance = squares / blocks - (per_block * rate) ** 2
        clumping = max(1.0, variance / (per_block * rate * (1 - rate)))
    interval = clopper_pearson(errors / clumping, bits / clumping, confidence)
    return Result(errors, bits, interval, clumping)
