"""The vehicle's transponder and its calibration.

The vehicle station demodulates the tones and modulates them anew on its own channel
(Jeong et al., section 2.1). Its delay adds to the measured phase, which the paper leaves
out; calibration at a known distance removes it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray

from .phase_range import range_per_radian_m
from .receiver import ToneEstimate
from .signal import RangingSignal, modulate


def transpond(estimate: ToneEstimate, signal: RangingSignal, delay_s: ArrayLike) -> ComplexArray:
    """Re-modulate the received tones, a processing delay later.

    Parameters
    ----------
    estimate
        What the vehicle's receiver found, phases [..., tones].
    signal
        Tones and sampling of the reply.
    delay_s : [...]
        Processing delay [s]; broadcasts against the leading axes.

    Returns
    -------
    complex128 [..., samples]
        Reply of unit amplitude; silence (zeros) where nothing was detected.
    """
    lag = reply_lag_rad(estimate.phase_lag_rad, signal, delay_s)
    detected = np.asarray(estimate.detected, dtype=np.bool_)
    reply = modulate(signal, np.where(detected[..., None], lag, 0.0))
    if not detected.all():
        reply[~np.broadcast_to(detected, reply.shape[:-1])] = 0.0
    return reply


def reply_lag_rad(
    phase_lag_rad: ArrayLike, signal: RangingSignal, delay_s: ArrayLike
) -> FloatArray:
    """Tone lags [..., tones] of the reply: those received, and the delay's share of them.

    Parameters
    ----------
    phase_lag_rad : [..., tones]
        Lags of the tones received [rad].
    signal
        Tones of the reply.
    delay_s : [...]
        Processing delay [s]; broadcasts against the leading axes.
    """
    delay = np.asarray(delay_s, dtype=np.float64)[..., None]
    lag = np.asarray(phase_lag_rad, dtype=np.float64)
    return np.asarray(lag + 2 * math.pi * delay * np.asarray(signal.tones_hz))


def calibrate_delay(
    phase_lag_rad: ArrayLike,
    variance_rad2: ArrayLike,
    range_m: float,
    tones_hz: Sequence[float],
    *,
    nominal_delay_s: float = 0.0,
) -> tuple[float, float]:
    """Delay of transponder and equipment, from bursts at a known distance.

    Parameters
    ----------
    phase_lag_rad : [bursts, tones] or [tones]
        Two-way lags measured on the calibration rig [rad].
    variance_rad2 : the same shape
        Their variances [rad^2], the weights of the mean.
    range_m
        The known distance [m].
    tones_hz
        Tones [Hz], highest first; one or two.
    nominal_delay_s
        Delay [s] expected from the design. The result lies within half a period of the
        lowest tone of it.

    Returns
    -------
    delay_s : float
        Delay to hand to `phase_to_range_m` or `two_tone_range_m` [s].
    variance_s2 : float
        Its variance [s^2]; times ``(c / 2)^2`` it is the residual of the range [m^2].

    Raises
    ------
    ValueError
        If a phase or variance is not finite, or the shapes do not match.
    """
    frequency = np.asarray(tones_hz, dtype=np.float64)
    lag = np.asarray(phase_lag_rad, dtype=np.float64)
    variance = np.asarray(variance_rad2, dtype=np.float64)
    if lag.ndim not in (1, 2) or lag.shape != variance.shape or lag.shape[-1] != frequency.size:
        raise ValueError(
            f"phase_lag_rad and variance_rad2 must be [bursts, {frequency.size}],"
            f" got shapes {lag.shape} and {variance.shape}"
        )
    lag, variance = np.atleast_2d(lag), np.atleast_2d(variance)
    if not (lag.size and np.isfinite(lag).all() and np.isfinite(variance).all()):
        raise ValueError("phase_lag_rad and variance_rad2 must be finite and not empty")
    if not (variance > 0).all():
        raise ValueError("variance_rad2 must be above zero")
    expected = np.array([range_m / range_per_radian_m(f) for f in tones_hz])
    expected += 2 * math.pi * frequency * nominal_delay_s
    # A circular mean: lags on both sides of a turn belong together.
    phasor = np.exp(1j * (lag - expected)) / variance
    residual_s = np.angle(phasor.sum(axis=0)) / (2 * math.pi * frequency)
    variance_s2 = 1 / (1 / variance).sum(axis=0) / (2 * math.pi * frequency) ** 2
    period_s = 1 / frequency[0]
    correction_s = residual_s[0] + period_s * round((residual_s[-1] - residual_s[0]) / period_s)
    return float(nominal_delay_s + correction_s), float(variance_s2[0])
