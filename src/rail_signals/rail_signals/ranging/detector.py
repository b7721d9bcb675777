"""Constant-false-alarm threshold for energy on spectral components.

Under noise alone, the fraction of the energy that falls onto L of M dimensions follows a
Beta(L, M - L) law, whatever the noise level. The receiver takes the largest fraction over
an interval of frequency offsets; Rice's formula for the rate of up-crossings of that
random process bounds the false-alarm probability of the maximum.
"""

from __future__ import annotations

import functools
import math

from scipy.special import betainc, betaln


def false_alarm_probability(
    fraction: float, components: int, dimensions: int, search_hz: float, duration_s: float
) -> float:
    """Bound on the probability that noise puts more than `fraction` onto the components.

    Parameters
    ----------
    fraction
        Threshold on the fraction of energy, in (0, 1).
    components, dimensions
        Complex dimensions L of the components and M of the block.
    search_hz
        Width of the interval of frequency offsets searched [Hz]; 0 for none.
    duration_s
        Length of the block [s].

    Notes
    -----
    ``P <= I(1 - b; M - L, L) + W sqrt(b (1 - b) lambda / (pi (M - L))) p(b)`` with
    ``lambda = (2 pi T)^2 / 12``, the second moment of time over the block, and p the
    density of Beta(L, M - L); tight where P is small.
    """
    rest = dimensions - components
    tail = float(betainc(rest, components, 1 - fraction))
    log_density = (
        (components - 1) * math.log(fraction)
        + (rest - 1) * math.log1p(-fraction)
        - betaln(components, rest)
    )
    spread = (2 * math.pi * duration_s) ** 2 / 12
    rate = math.sqrt(fraction * (1 - fraction) * spread / (math.pi * rest)) * math.exp(log_density)
    return tail + search_hz * rate


@functools.cache
def detection_threshold(
    false_alarm: float, components: int, dimensions: int, search_hz: float, duration_s: float
) -> float:
    """Fraction of the energy above which components count as detected.

    Solves `false_alarm_probability` for its first argument, once for all receivers of a kind.

    Raises
    ------
    ValueError
        If `false_alarm` is outside (0, 0.5), or the block too short to tell at all.
    """
    if not 0 < false_alarm < 0.5:
        raise ValueError(f"false_alarm must lie between 0 and 0.5, got {false_alarm!r}")
    if dimensions <= components + 1:
        raise ValueError(
            f"samples must exceed the {components} spectral components, got {dimensions}"
        )

    def excess(fraction: float) -> float:
        bound = false_alarm_probability(fraction, components, dimensions, search_hz, duration_s)
        return math.log(max(bound, 1e-300)) - math.log(false_alarm)

    # The mean fraction L / M is below any threshold for less than one half.
    from scipy.optimize import brentq  # a quarter of a second, and not for every start

    return float(brentq(excess, components / dimensions, 1 - 1e-12))
