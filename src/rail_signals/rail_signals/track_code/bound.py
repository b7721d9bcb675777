"""Closed-form limits of a track-code receiver: tone amplitudes, bits, messages.

The carrier of a track code is ``z(t) = a exp(j phi(t)) + w(t)`` with

    phi(t) = theta + 2 pi f0 t + sum_i (x_i sin(2 pi F_i t) - y_i cos(2 pi F_i t)) / F_i,

so that its frequency deviates by ``sum_i x_i cos(2 pi F_i t) + y_i sin(2 pi F_i t)``
(Kim et al., eq. 3, with the index ``A_i / F_i``; the printed 2 pi cancels). In white
noise the information about the phase is ``J = 2 gamma G^T G``, G being the derivatives of
phi; that about the amplitude a is apart from it. No approximation is in this: the tones of
a slot of 1.56 s are not orthogonal, and the carrier's own phase and offset overlap the
slowest of them.

=========== ==========================================================================
gamma       carrier-to-noise ratio per complex sample (linear), ``a^2 / E|w|^2``
F_i         frequency of tone i [Hz]
X_i         complex amplitude ``x_i - j y_i`` of tone i [Hz of deviation]
sigma_i     standard deviation of x_i and of y_i [Hz]
=========== ==========================================================================
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.special import i0e
from scipy.stats import ncx2

from rail_signals.arrays import FloatArray


def phase_basis(tones_hz: ArrayLike, samples: int, sample_rate_hz: float) -> FloatArray:
    """Derivatives of the phase by theta, 2 pi f0 and the tones' amplitudes.

    Times count from the middle of the slot, where phase and offset of the carrier are
    independent.

    Returns
    -------
    float [samples, 2 + 2 tones]
        Columns 1 [rad/rad], t [rad s/rad], then the x_i and then the y_i [rad/Hz].
    """
    tones = _tones(tones_hz)
    if samples < 2 + 2 * len(tones):
        raise ValueError(f"samples must be at least {2 + 2 * len(tones)}, got {samples!r}")
    t = (np.arange(samples) - (samples - 1) / 2) / sample_rate_hz
    turn = 2 * math.pi * np.outer(t, tones)
    return np.column_stack([np.ones(samples), t, np.sin(turn) / tones, -np.cos(turn) / tones])


def tone_covariance_bound(
    tones_hz: ArrayLike, snr: float, samples: int, sample_rate_hz: float
) -> FloatArray:
    """Cramér-Rao bound of the tones' amplitudes in one slot [Hz^2].

    Every tone's amplitude and phase, and the carrier's phase and offset, are unknown: the
    receiver does not know which tones are there. For long slots it tends to
    ``F_i^2 / (gamma samples)`` for each x_i and y_i, which is
    :func:`rail_signals.ranging.bounds.tone_phase_variance_bound` seen from the amplitude.

    Parameters
    ----------
    tones_hz : float [tones]
        Frequencies of the tones [Hz], increasing.
    snr
        Carrier-to-noise ratio gamma per complex sample (linear).
    samples
        Complex samples of the slot.
    sample_rate_hz
        Their rate [Hz].

    Returns
    -------
    float [2 tones, 2 tones]
        Covariance of (x_0 ... x_n-1, y_0 ... y_n-1).

    Examples
    --------
    >>> c = tone_covariance_bound([10.0], 5.0, 10_000, 1000.0)
    >>> [round(float(v) * 5.0 * 10_000 / 10.0**2, 3) for v in np.diag(c)]
    [1.0, 1.0]
    """
    if not snr > 0:
        raise ValueError(f"snr must be positive, got {snr!r}")
    basis = phase_basis(tones_hz, samples, sample_rate_hz)
    # By the triangle of a QR decomposition: the condition of G is not squared.
    size = np.linalg.norm(basis, axis=0)
    inverse = np.linalg.inv(np.linalg.qr(basis / size, mode="r")) / size[:, None]
    covariance = inverse @ inverse.T / (2 * snr)
    return np.asarray(covariance[2:, 2:])


def tone_sigma_bound(
    tones_hz: ArrayLike, snr: float, samples: int, sample_rate_hz: float
) -> FloatArray:
    """Root mean square of the bounds of x_i and y_i [Hz], one per tone: float [tones].

    The phase of a tone within a slot is arbitrary, so that only the mean over both counts
    for a decision on ``|X_i|``. Parameters as of :func:`tone_covariance_bound`.
    """
    diagonal = np.diag(tone_covariance_bound(tones_hz, snr, samples, sample_rate_hz))
    return np.asarray(np.sqrt(diagonal.reshape(2, -1).mean(axis=0)))


def marcum_q1(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Marcum's Q of order 1: probability that a Rice variable of offset `a` exceeds `b`."""
    a, b = _array(a), _array(b)
    return np.asarray(ncx2.sf(b**2, 2, a**2), dtype=np.float64)


def best_threshold(ratio: float) -> float:
    """Threshold on ``|X| / sigma`` of least error between a tone and none.

    Where the densities of Rice and Rayleigh cross, ``I0(ratio b) = exp(ratio^2 / 2)``:
    both are equally frequent.

    Parameters
    ----------
    ratio
        Amplitude of a tone that is there, over sigma.

    Examples
    --------
    >>> round(best_threshold(8.0), 3)
    4.336
    """
    if not (math.isfinite(ratio) and ratio > 0):
        raise ValueError(f"ratio must be positive, got {ratio!r}")

    def excess(b: float) -> float:
        return math.log(float(i0e(ratio * b))) + ratio * b - ratio**2 / 2

    return float(brentq(excess, 1e-9, ratio / 2 + 3 + 2 / ratio))


def on_off_error_probability(ratio: ArrayLike) -> FloatArray:
    """Least error probability of a tone's bit, of unknown phase, by ``|X|`` alone.

    ``(exp(-b^2 / 2) + 1 - Q1(ratio, b)) / 2`` at the best threshold b; zeros and ones
    equally frequent.

    Parameters
    ----------
    ratio : float [...]
        Amplitude of a tone that is there, over sigma.

    Examples
    --------
    >>> on_off_error_probability([4.0, 8.0]).round(7).tolist()
    [0.0461954, 8.59e-05]
    """
    ratios = _array(ratio)
    flat = [_error_at(r, best_threshold(r)) for r in ratios.ravel().tolist()]
    return np.asarray(flat, dtype=np.float64).reshape(ratios.shape)


def bit_error_bound(
    tones_hz: ArrayLike,
    amplitudes_hz: ArrayLike,
    snr: float,
    samples: int,
    sample_rate_hz: float,
) -> FloatArray:
    """Error probability of each bit by an efficient estimate of the amplitudes [tones].

    A limit for receivers that decide each tone by its own amplitude. One that used the
    tones' common time or the check bits could do better.

    Parameters
    ----------
    amplitudes_hz : float [tones] or float
        Deviation of a tone that is there [Hz].
    tones_hz, snr, samples, sample_rate_hz
        As of :func:`tone_covariance_bound`.
    """
    sigma = tone_sigma_bound(tones_hz, snr, samples, sample_rate_hz)
    return on_off_error_probability(_array(amplitudes_hz) / sigma)


def message_error_bound(
    tones_hz: ArrayLike,
    amplitudes_hz: ArrayLike,
    snr: float,
    samples: int,
    sample_rate_hz: float,
) -> float:
    """Probability that one slot gives a wrong bit: ``1 - prod(1 - p_i)``.

    The bits' errors count as independent; neighbouring tones are slightly correlated in a
    short slot, which moves the product by less than a hundredth of a decibel. Parameters as
    of :func:`bit_error_bound`.
    """
    p = bit_error_bound(tones_hz, amplitudes_hz, snr, samples, sample_rate_hz)
    return float(-np.expm1(np.log1p(-p).sum()))


def snr_of_message_error(
    rate: float,
    tones_hz: ArrayLike,
    amplitudes_hz: ArrayLike,
    samples: int,
    sample_rate_hz: float,
) -> float:
    """Carrier-to-noise ratio per sample at which the bound of the messages is `rate`."""
    if not 0 < rate < 0.5:
        raise ValueError(f"rate must be between 0 and 0.5, got {rate!r}")
    sigma = tone_sigma_bound(tones_hz, 1.0, samples, sample_rate_hz)
    ratio = _array(amplitudes_hz) / sigma

    def excess(level_db: float) -> float:
        p = on_off_error_probability(ratio * 10 ** (level_db / 20))
        return float(np.log1p(-p).sum() - math.log1p(-rate))

    # From ratios of 1 for the best tone to 40 for the worst.
    low, high = (
        20 * math.log10(1 / float(np.max(ratio))),
        20 * math.log10(40 / float(np.min(ratio))),
    )
    return float(10 ** (brentq(excess, low, high, xtol=1e-6) / 10))


def window_probabilities(
    ratio: ArrayLike, most_zero: ArrayLike, least_one: ArrayLike, most_one: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Probabilities that a level is read right and that it is read wrong, per bit.

    The decision has a window for zero, ``[0, most_zero]``, and one for one,
    ``[least_one, most_one]``; between and above them a level is neither, and the message
    is refused. Means over zeros and ones, equally frequent. Levels are in units of sigma.

    Returns
    -------
    right, wrong : float [...]
        They sum to less than 1.
    """
    a, zero, least, most = map(_array, (ratio, most_zero, least_one, most_one))
    none = np.zeros_like(a)
    zero_as_zero = ncx2.cdf(zero**2, 2, none)
    zero_as_one = marcum_q1(none, least) - marcum_q1(none, most)
    one_as_one = marcum_q1(a, least) - marcum_q1(a, most)
    one_as_zero = ncx2.cdf(zero**2, 2, a**2)
    return (zero_as_zero + one_as_one) / 2, (zero_as_one + one_as_zero) / 2


def undetected_error_probability(
    right: ArrayLike, wrong: ArrayLike, check: ArrayLike, confirmations: int = 1
) -> float:
    """Probability that a wrong message is taken for a true one.

    An error pattern passes if it is a word of the check code. Over all of them

        sum over e != 0 of prod(e_i ? wrong_i : right_i)
        = 2^-m sum over u of prod(right_i + (-1)^(u H)_i wrong_i) - prod(right_i),

    by MacWilliams' identity: the 2^m combinations of the m rows of H instead of the 2^k
    messages, and it holds for bits of different quality. For many random errors it tends
    to ``2^-m`` of the messages whose levels are all within a window. The difference of the
    two is good to about 1e-15, and what is below that counts as nothing.

    Parameters
    ----------
    right, wrong : float [bits]
        Probabilities that a bit is read right or wrong. What is missing to 1 is refused.
    check : bool or int [checks, bits]
        Parity-check matrix H of the code: ``H word = constant`` modulo 2.
    confirmations
        Independent slots that must agree on the same word.

    Examples
    --------
    One parity bit lets every even number of errors through:

    >>> round(undetected_error_probability([0.9] * 3, [0.1] * 3, [[1, 1, 1]]), 12)
    0.027
    """
    good, bad = _array(right) ** confirmations, _array(wrong) ** confirmations
    signs = _dual_signs(check)
    total = np.mean(np.prod(good + signs * bad, axis=-1))
    return max(float(total - np.prod(good)), 0.0)


def accepted_probability(
    zero: ArrayLike, one: ArrayLike, check: ArrayLike, syndrome: ArrayLike
) -> float:
    """Probability that levels that carry no message pass for one.

    Parameters
    ----------
    zero, one : float [bits]
        Probabilities that the level of a bit lies in the window of zero or of one.
    check : bool or int [checks, bits]
        Parity-check matrix H.
    syndrome : bool or int [checks]
        ``H word`` of every true message, modulo 2.
    """
    signs = _dual_signs(check)
    side = _dual_signs(_array(syndrome)[:, None])[:, 0]
    return max(float(np.mean(side * np.prod(_array(zero) + signs * _array(one), axis=-1))), 0.0)


def _dual_signs(check: ArrayLike) -> FloatArray:
    """Words of the dual code as signs +1 and -1: float [2^checks, bits]."""
    rows = np.asarray(check).astype(np.int64) & 1
    count = len(rows)
    choice = np.arange(1 << count)[:, None] >> np.arange(count) & 1
    return np.asarray(1.0 - 2.0 * ((choice @ rows) & 1))


def _error_at(ratio: float, threshold: float) -> float:
    missed = float(ncx2.cdf(threshold**2, 2, ratio**2))
    return 0.5 * (math.exp(-(threshold**2) / 2) + missed)


def _tones(tones_hz: ArrayLike) -> FloatArray:
    tones = _array(tones_hz)
    if tones.ndim != 1 or not tones.size or not (np.diff(tones, prepend=0.0) > 0).all():
        raise ValueError(f"tones_hz must be positive and increasing, got {tones_hz!r}")
    return tones


def _array(value: ArrayLike) -> FloatArray:
    return np.asarray(value, dtype=np.float64)
