"""Cramer-Rao bounds of phase, frequency and range estimates.

The signal-to-noise ratios are linear and per sample. Every function takes scalars or
arrays, which broadcast.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S


def tone_phase_variance_bound(snr: ArrayLike, samples: ArrayLike, index: ArrayLike) -> FloatArray:
    """Bound on the phase of a tone carried by FM: ``1 / (gamma N beta^2)`` [rad^2].

    Parameters
    ----------
    snr
        Carrier-to-noise ratio gamma per complex sample (linear).
    samples
        Number of complex samples N.
    index
        FM index beta [rad].

    Examples
    --------
    >>> float(tone_phase_variance_bound(10.0, 1000, 1.0))
    0.0001
    """
    product = _array(snr) * _array(samples) * _array(index) ** 2
    return np.asarray(1.0 / product, dtype=np.float64)


def two_way_range_variance_bound(
    snr_down: ArrayLike,
    snr_up: ArrayLike,
    samples: ArrayLike,
    index: ArrayLike,
    tone_hz: float,
) -> FloatArray:
    """Bound on the range measured over a regenerative transponder [m^2].

    The phase errors of the two links add, and a two-way path of phase ``theta`` is a
    range of ``c theta / (4 pi f)`` (Jeong et al., eq. 12: theta = 2 * 2 pi f t_1).

    Examples
    --------
    >>> round(float(two_way_range_variance_bound(10, 10, 1000, 1.0, 375e3)) ** 0.5, 3)
    0.9
    """
    phase = tone_phase_variance_bound(snr_down, samples, index) + tone_phase_variance_bound(
        snr_up, samples, index
    )
    return np.asarray(phase * (SPEED_OF_LIGHT_M_PER_S / (4 * math.pi * tone_hz)) ** 2)


def complex_tone_frequency_variance_bound(
    snr: ArrayLike, samples: ArrayLike, sample_rate_hz: float
) -> FloatArray:
    """Bound on the frequency of a complex tone of unknown phase [Hz^2].

    ``6 fs^2 / ((2 pi)^2 gamma N (N^2 - 1))``. It also holds for the carrier of an FM
    wave, since its components share one offset and their powers add.
    """
    n = _array(samples)
    denominator = (2 * math.pi) ** 2 * _array(snr) * n * (n**2 - 1)
    return np.asarray(6 * sample_rate_hz**2 / denominator, dtype=np.float64)


def real_tone_phase_variance_bound(snr: ArrayLike, samples: ArrayLike) -> FloatArray:
    """Bound on the phase of a real tone of known frequency: ``1 / (N snr)`` [rad^2].

    `snr` is ``A^2 / (2 sigma^2)`` for amplitude A and noise variance sigma^2.
    """
    return np.asarray(1.0 / (_array(samples) * _array(snr)), dtype=np.float64)


def _array(value: ArrayLike) -> FloatArray:
    return np.asarray(value, dtype=np.float64)
