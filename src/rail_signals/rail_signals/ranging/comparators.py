"""Phase comparators: the source's AND gate, and the quadrature comparator.

The AND comparator limits both tones to 0/1 and measures how long both are 1: a lag and
the lead of the same size give the same pulse, hence its ambiguity (Jeong et al., eq. 13
and Figs 4-6). The figures print 1.04 us for 45 and 315 degrees at 375 kHz; the pulse is
``T/2 - T/8 = 1.000 us`` for both. 1.04 us fits a 40 ns sampling grid, 26 samples.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray

from .signal import wrap_to_turn


def and_pulse_width_s(
    reference: ArrayLike, received: ArrayLike, sample_rate_hz: float
) -> FloatArray:
    """Mean width [s] of the AND pulse per period of the reference.

    The waveforms are limited between samples: each crossing of zero is placed by linear
    interpolation, so the width is not tied to the sampling grid.

    Parameters
    ----------
    reference, received : float [..., samples]
        Tones over whole periods (the record is taken as circular).
    sample_rate_hz
        Sample rate [Hz].

    Returns
    -------
    float64 [...]
        Time per reference period [s] in which both are positive; NaN where the reference
        never rises through zero.

    Examples
    --------
    >>> t = np.arange(200) / 25e6
    >>> lagging = np.sin(2 * np.pi * 375e3 * t - np.pi / 4)
    >>> round(float(and_pulse_width_s(np.sin(2 * np.pi * 375e3 * t), lagging, 25e6)) * 1e6, 3)
    1.0
    """
    ref, rec = _pair(reference, received)
    if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 0):
        raise ValueError(f"sample_rate_hz must be finite and above zero, got {sample_rate_hz!r}")
    ref_from, ref_to = _positive_part(ref)
    rec_from, rec_to = _positive_part(rec)
    both = np.minimum(ref_to, rec_to) - np.maximum(ref_from, rec_from)
    periods = ((ref <= 0) & (np.roll(ref, -1, axis=-1) > 0)).sum(axis=-1)
    total_s = np.maximum(both, 0.0).sum(axis=-1) / sample_rate_hz
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(periods > 0, total_s / periods, np.nan), dtype=np.float64)


def and_comparator(
    reference: ArrayLike, received: ArrayLike, sample_rate_hz: float, tone_hz: float
) -> FloatArray:
    """Phase [rad] in [0, pi] by the AND comparator: ``pi - 2 pi f w`` of pulse width w.

    Lags above pi fold back: 315 degrees reads as 45 (Jeong et al., Figs 5 and 6).
    """
    width_s = and_pulse_width_s(reference, received, sample_rate_hz)
    return np.asarray(np.clip(math.pi - 2 * math.pi * tone_hz * width_s, 0.0, math.pi))


def quadrature_comparator(
    reference: ArrayLike, received: ArrayLike, sample_rate_hz: float, tone_hz: float
) -> FloatArray:
    """Lag [rad] in [0, 2 pi) of a tone behind its reference, by I/Q correlation.

    Parameters
    ----------
    reference, received : float [..., samples]
        Tones over whole periods.
    sample_rate_hz, tone_hz
        Sample rate and tone frequency [Hz].

    Examples
    --------
    >>> turn = 2 * np.pi * np.arange(32) * 3 / 32
    >>> lag = quadrature_comparator(np.sin(turn), np.sin(turn - 5.5), 4e6, 375e3)
    >>> round(float(lag), 9)
    5.5
    """
    ref, rec = _pair(reference, received)
    carrier = np.exp(-2j * math.pi * tone_hz / sample_rate_hz * np.arange(ref.shape[-1]))
    return wrap_to_turn(np.angle((ref @ carrier) * np.conj(rec @ carrier)))


def _positive_part(wave: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Start and end of the positive part of each sample interval, as shares of it."""
    now = wave
    after = np.roll(wave, -1, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = now / (now - after)
    start = np.where(now > 0, 0.0, np.where(after > 0, crossing, 1.0))
    end = np.where(after > 0, 1.0, np.where(now > 0, crossing, 0.0))
    return start, end


def _pair(reference: ArrayLike, received: ArrayLike) -> tuple[FloatArray, FloatArray]:
    ref = np.asarray(reference, dtype=np.float64)
    rec = np.asarray(received, dtype=np.float64)
    if ref.ndim == 0 or rec.ndim == 0 or ref.shape[-1] != rec.shape[-1]:
        raise ValueError(
            f"reference and received must have equal samples, got shapes {ref.shape}, {rec.shape}"
        )
    return ref, rec
