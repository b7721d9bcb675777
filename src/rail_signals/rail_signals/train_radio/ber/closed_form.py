r"""Closed-form bit error rates of a radio link with up to two antennas at either end.

Schemes of An, Kim and Jeong: maximum-ratio combining (MRC) of two receivers, the space-time
code of Alamouti (their eqs 1-9), and one antenna at either end for comparison. All combiners
give each bit the sum of the branches' energies (the orthogonality of eq 2), so that only the
number L of branches and the power of each matter.

============ =========================================================================
N_t, N_r     transmitters, receivers; ``L = N_t N_r`` branches
``eb_n0``    energy per bit over noise density at *each* receiver, linear. The total
             transmitted power is fixed: each transmitter sends ``1 / N_t`` of it
gamma        mean signal-to-noise ratio per bit and branch, ``eb_n0 / N_t``
g            sum of the branches' power gains; Gamma(L) distributed in Rayleigh fading
c            in ``Q(sqrt(2 c gamma g))``: 1 for BPSK and QPSK; 2/5, 18/5, 10 for 16-QAM
============ =========================================================================

QPSK and 16-QAM are Gray coded; the error rate is the mean over the bits of a symbol.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import gammaln, ndtr

from rail_signals.arrays import FloatArray
from rail_signals.train_radio.space_time_block import Scheme
from rail_signals.train_radio.space_time_block import scheme as by_name

SISO: Final = by_name("siso")
MRC_1X2: Final = by_name("mrc")
ALAMOUTI_2X1: Final = by_name("alamouti_2x1")
ALAMOUTI_2X2: Final = by_name("alamouti_2x2")
SCHEMES: Final = {s.name: s for s in (SISO, MRC_1X2, ALAMOUTI_2X1, ALAMOUTI_2X2)}

_ONE: Final = ((1.0, 1.0),)
#: Bits per symbol -> (weight, c) of the terms of the error rate. 16-QAM: nearest, farther and
#: farthest decision thresholds of the two bits of one dimension.
_TERMS: Final = {1: _ONE, 2: _ONE, 4: ((0.75, 0.4), (0.5, 3.6), (-0.25, 10.0))}


def error_rate(scheme: Scheme, eb_n0: ArrayLike, bits_per_symbol: int = 2) -> FloatArray:
    """Bit error rate in independent Rayleigh fading, known to the receiver.

    With ``mu = sqrt(c gamma / (1 + c gamma))`` and ``q = (1 - mu) / 2`` each term is
    ``q^L sum over k < L of C(L - 1 + k, k) (1 - q)^k``.

    Parameters
    ----------
    eb_n0 : float [...]
        Energy per bit over noise density at each receiver (linear).
    bits_per_symbol
        1 (BPSK), 2 (QPSK) or 4 (16-QAM).

    Examples
    --------
    >>> [f"{error_rate(s, 10.0):.2e}" for s in (MRC_1X2, ALAMOUTI_2X2)]
    ['1.60e-03', '1.13e-04']
    """
    gamma = _ratio(eb_n0) / scheme.transmit
    order = scheme.diversity
    total = np.zeros_like(gamma)
    for weight, c in _terms(bits_per_symbol):
        x = c * gamma
        # 1 - mu = (1 - mu^2) / (1 + mu), without the difference of equals.
        q = 0.5 / ((1 + x) * (1 + np.sqrt(x / (1 + x))))
        total += (
            weight
            * q**order
            * sum(math.comb(order - 1 + k, k) * (1 - q) ** k for k in range(order))
        )
    return total


def rician_error_rate(
    scheme: Scheme, eb_n0: ArrayLike, k_factor: float, bits_per_symbol: int = 2
) -> FloatArray:
    """Bit error rate in Rician fading, by Craig's form of Q.

    ``Q(sqrt(2 c x))`` is the mean of ``exp(-c x / sin^2 theta) / 2`` over all theta, so that
    the mean over the fading is that of its moment-generating function: per branch
    ``(1 + K) / (1 + K + s gamma) exp(-K s gamma / (1 + K + s gamma))``, ``s = c / sin^2``.
    The integrand has a period: 512 midpoints of a quarter are exact to rounding.

    Parameters
    ----------
    k_factor
        Power of the constant part over that of the scattered part of each branch; 0 is
        Rayleigh, infinity is no fading. Other parameters as of :func:`error_rate`.
    """
    if not k_factor >= 0:
        raise ValueError(f"k_factor must not be negative, got {k_factor!r}")
    if math.isinf(k_factor):
        return awgn_error_rate(scheme, eb_n0, bits_per_symbol)
    gamma = _ratio(eb_n0)[..., None] / scheme.transmit
    sine2 = np.sin((np.arange(512) + 0.5) * (math.pi / 1024)) ** 2
    total = np.zeros(gamma.shape[:-1])
    for weight, c in _terms(bits_per_symbol):
        x = c * gamma / sine2
        log_mgf = np.log1p(k_factor) - np.log(1 + k_factor + x) - k_factor * x / (1 + k_factor + x)
        total += weight / 2 * np.exp(scheme.diversity * log_mgf).mean(axis=-1)
    return total


def awgn_error_rate(scheme: Scheme, eb_n0: ArrayLike, bits_per_symbol: int = 2) -> FloatArray:
    """Bit error rate without fading: every branch has unit gain."""
    return conditional_error_rate(_ratio(eb_n0) * scheme.receive, bits_per_symbol)


def conditional_error_rate(snr: ArrayLike, bits_per_symbol: int = 2) -> FloatArray:
    """Bit error rate at a signal-to-noise ratio per bit behind the combiner (linear)."""
    x = np.asarray(snr, dtype=np.float64)
    return np.asarray(sum(w * ndtr(-np.sqrt(2 * c * x)) for w, c in _terms(bits_per_symbol)))


def eb_n0_of_error_rate(scheme: Scheme, rate: float, bits_per_symbol: int = 2) -> float:
    """Energy per bit over noise density (linear) at which the error rate is `rate`.

    Examples
    --------
    >>> round(10 * math.log10(eb_n0_of_error_rate(ALAMOUTI_2X2, 1e-4)), 2)
    10.16
    """
    if not 0 < rate < 0.4:
        raise ValueError(f"rate must be between 0 and 0.4, got {rate!r}")

    def excess(level_db: float) -> float:
        return math.log(float(error_rate(scheme, 10 ** (level_db / 10), bits_per_symbol)) / rate)

    return float(10 ** (brentq(excess, -40.0, 200.0, xtol=1e-9) / 10))


def gain_db(better: Scheme, worse: Scheme, rate: float, bits_per_symbol: int = 2) -> float:
    """What one scheme saves against another at an error rate [dB].

    Examples
    --------
    >>> [round(gain_db(ALAMOUTI_2X2, MRC_1X2, rate), 2) for rate in (1e-3, 1e-4, 1e-5)]
    [4.05, 6.12, 8.36]
    """
    needs = [eb_n0_of_error_rate(s, rate, bits_per_symbol) for s in (worse, better)]
    return 10 * math.log10(needs[0] / needs[1])


def frame_loss(bit_error_rate: ArrayLike, bits: int) -> FloatArray:
    """Probability that one of so many bits is wrong, errors being independent."""
    p = np.asarray(bit_error_rate, dtype=np.float64)
    return np.asarray(-np.expm1(bits * np.log1p(-p)))


def block_fading_frame_loss(
    scheme: Scheme, eb_n0: ArrayLike, bits: int, bits_per_symbol: int = 2
) -> FloatArray:
    """Probability that a frame is lost that sees one channel throughout.

    Mean of ``1 - (1 - p(gamma g))^bits`` over ``g`` of density ``g^(L-1) exp(-g) / (L-1)!``.
    For 16-QAM the bits' unequal rates are replaced by their mean.

    Examples
    --------
    One bit is the error rate itself:

    >>> f"{block_fading_frame_loss(ALAMOUTI_2X2, 10.0, 1):.4e} {error_rate(ALAMOUTI_2X2, 10.0):.4e}"
    '1.1336e-04 1.1336e-04'
    """
    if bits < 1:
        raise ValueError(f"bits must be at least 1, got {bits!r}")
    # In t = log g all is smooth and falls off at both ends: a plain sum converges fast.
    step, order = 0.01, scheme.diversity
    t = np.arange(-60.0 / order, 5.0, step)
    weight = np.exp(order * t - np.exp(t) - gammaln(order)) * step
    gamma = _ratio(eb_n0)[..., None] / scheme.transmit
    loss = frame_loss(conditional_error_rate(gamma * np.exp(t), bits_per_symbol), bits)
    return np.asarray(loss @ weight)


def mean_messages_until_losses(loss: ArrayLike, losses: int) -> FloatArray:
    """Mean number of messages until so many consecutive ones are lost.

    ``(1 - p^n) / ((1 - p) p^n)`` for independent losses of probability p.

    Examples
    --------
    Every half second, braking after 3 s of silence: hours between spurious brakings.

    >>> (mean_messages_until_losses([0.1, 0.2, 0.3], 6) * 0.5 / 3600).round(2).tolist()
    [154.32, 2.71, 0.27]
    """
    p = np.asarray(loss, dtype=np.float64)
    if losses < 1 or not ((p > 0) & (p < 1)).all():
        raise ValueError(f"needs 0 < loss < 1 and losses >= 1, got {loss!r} and {losses!r}")
    return np.asarray((1 - p**losses) / ((1 - p) * p**losses))


def _terms(bits_per_symbol: int) -> tuple[tuple[float, float], ...]:
    if bits_per_symbol not in _TERMS:
        raise ValueError(f"bits_per_symbol must be 1, 2 or 4, got {bits_per_symbol!r}")
    return _TERMS[bits_per_symbol]


def _ratio(eb_n0: ArrayLike) -> FloatArray:
    ratio = np.asarray(eb_n0, dtype=np.float64)
    if not (ratio >= 0).all():
        raise ValueError(f"eb_n0 must not be negative, got {eb_n0!r}")
    return ratio
