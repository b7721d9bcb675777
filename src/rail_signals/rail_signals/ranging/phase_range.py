"""From the phase of a two-way tone to a range, and back.

The measured lag is ``theta = 2 pi f (2 d / c + delay)``, where the delay is that of the
transponder and of the equipment, known from calibration. Jeong et al., eq. 12, prints
``theta_d = 2 (2 pi f_1 t_1) = 2 theta_d``; it must read ``2 theta_1`` with
``theta_1 = 2 pi f_1 t_1``. The paper leaves the transponder delay out: 1 us of it is
135 degrees of a 375 kHz tone, or 150 m.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erfc

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S

from .signal import wrap_to_turn

Comparator = Literal["and", "quadrature"]

DEFAULT_MARGIN = 0.05
"""Fraction of the unambiguous range kept for ranges that noise makes negative."""


def unambiguous_range_m(tone_hz: float, comparator: Comparator = "quadrature") -> float:
    """Longest range [m] that a comparator tells apart on the two-way path.

    A quarter of the wavelength for the AND comparator (Jeong et al., eq. 13), which
    cannot tell a lag from a lead; half of it for the quadrature comparator.

    Examples
    --------
    >>> round(unambiguous_range_m(375e3, "and"), 2), round(unambiguous_range_m(375e3), 2)
    (199.86, 399.72)
    """
    _check_tone(tone_hz)
    wavelength_m = SPEED_OF_LIGHT_M_PER_S / tone_hz
    if comparator == "and":
        return wavelength_m / 4
    if comparator == "quadrature":
        return wavelength_m / 2
    raise ValueError(f"comparator must be 'and' or 'quadrature', got {comparator!r}")


def range_per_radian_m(tone_hz: float) -> float:
    """One-way range [m] for each radian of two-way tone phase: ``c / (4 pi f)``."""
    _check_tone(tone_hz)
    return SPEED_OF_LIGHT_M_PER_S / (4 * math.pi * tone_hz)


def range_to_phase_rad(range_m: ArrayLike, tone_hz: float, *, delay_s: float = 0.0) -> FloatArray:
    """Lag [rad] in [0, 2 pi) of a tone that went to `range_m` and back.

    Jeong et al., eq. 12 (with the erratum above), plus the calibrated `delay_s`.
    """
    lag = np.asarray(range_m, dtype=np.float64) / range_per_radian_m(tone_hz)
    return wrap_to_turn(lag + 2 * math.pi * tone_hz * delay_s)


def phase_to_range_m(
    phase_lag_rad: ArrayLike,
    tone_hz: float,
    *,
    delay_s: float = 0.0,
    margin_m: float | None = None,
) -> FloatArray:
    """Range [m] of a two-way lag, in ``[-margin, unambiguous - margin)``.

    Parameters
    ----------
    phase_lag_rad : [...]
        Measured lag [rad], of any turn.
    tone_hz
        Tone frequency [Hz].
    delay_s
        Calibrated transponder and equipment delay [s], removed.
    margin_m
        Room [m] below zero, so that a train beside the station is not taken for one at
        the far end; 5 % of the unambiguous range unless given.

    Examples
    --------
    >>> lag = range_to_phase_rad(123.0, 375e3, delay_s=1e-6)
    >>> round(float(phase_to_range_m(lag, 375e3, delay_s=1e-6)), 9)
    123.0
    """
    span_m = unambiguous_range_m(tone_hz)
    margin = DEFAULT_MARGIN * span_m if margin_m is None else margin_m
    per_radian_m = range_per_radian_m(tone_hz)
    lag = np.asarray(phase_lag_rad, dtype=np.float64) - 2 * math.pi * tone_hz * delay_s
    return np.asarray(wrap_to_turn(lag + margin / per_radian_m) * per_radian_m - margin)


def two_tone_range_m(
    phase_lag_rad: ArrayLike,
    variance_rad2: ArrayLike,
    tones_hz: Sequence[float],
    *,
    delay_s: float = 0.0,
    max_wrong_probability: float = 1e-6,
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Range of a two-tone measurement: the low tone picks the cycle of the high one.

    Parameters
    ----------
    phase_lag_rad : [..., 2]
        Lags [rad] of the tones in the order of `tones_hz`, highest first.
    variance_rad2 : [..., 2]
        Their variances [rad^2].
    tones_hz
        The two tones [Hz], highest first.
    delay_s
        Calibrated delay [s], the same for both tones.
    max_wrong_probability
        Above this probability of a wrong cycle the range is not `resolved`.

    Returns
    -------
    range_m : float64 [...]
        Range [m], unambiguous over the half wavelength of the low tone.
    variance_m2 : float64 [...]
        Variance [m^2] of the range, given the right cycle.
    resolved : bool [...]
        True where the probability of a wrong cycle (`wrong_cycle_probability`) is small
        enough. False where an input is not finite.

    Examples
    --------
    >>> tones = (375e3, 37.5e3)
    >>> lag = [float(range_to_phase_rad(1234.5, f)) for f in tones]
    >>> range_m, variance_m2, resolved = two_tone_range_m(lag, [1e-4, 1e-4], tones)
    >>> round(float(range_m), 6), round(float(variance_m2), 3), bool(resolved)
    (1234.5, 0.405, True)
    """
    lag, variance = _check_pair(phase_lag_rad, variance_rad2, tones_hz)
    high_hz, low_hz = tones_hz
    span_m = unambiguous_range_m(high_hz)
    coarse_m = phase_to_range_m(lag[..., 1], low_hz, delay_s=delay_s)
    fine_m = phase_to_range_m(lag[..., 0], high_hz, delay_s=delay_s, margin_m=0.0)
    range_m = fine_m + span_m * np.rint((coarse_m - fine_m) / span_m)
    variance_m2 = variance[..., 0] * range_per_radian_m(high_hz) ** 2
    wrong = wrong_cycle_probability(variance, tones_hz)
    resolved = np.isfinite(range_m) & (wrong <= max_wrong_probability)
    return np.asarray(range_m), np.asarray(variance_m2), np.asarray(resolved)


def wrong_cycle_probability(variance_rad2: ArrayLike, tones_hz: Sequence[float]) -> FloatArray:
    """Probability that Gaussian phase errors make the low tone pick a wrong cycle.

    The pick fails when the two tones disagree by more than half the unambiguous range of
    the high one: ``erfc(span / (2 sqrt(2 (var_low + var_high))))``, variances in m^2.
    """
    variance = np.asarray(variance_rad2, dtype=np.float64)
    high_hz, low_hz = tones_hz
    disagreement_m2 = (
        variance[..., 0] * range_per_radian_m(high_hz) ** 2
        + variance[..., 1] * range_per_radian_m(low_hz) ** 2
    )
    with np.errstate(divide="ignore"):
        limit = unambiguous_range_m(high_hz) / 2 / np.sqrt(2 * disagreement_m2)
    return np.asarray(erfc(limit), dtype=np.float64)


def _check_pair(
    phase_lag_rad: ArrayLike, variance_rad2: ArrayLike, tones_hz: Sequence[float]
) -> tuple[FloatArray, FloatArray]:
    """Arrays of lags and variances with two tones last."""
    if len(tones_hz) != 2 or not tones_hz[0] > tones_hz[1]:
        raise ValueError(f"tones_hz must be two tones, highest first, got {tuple(tones_hz)}")
    lag = np.asarray(phase_lag_rad, dtype=np.float64)
    variance = np.asarray(variance_rad2, dtype=np.float64)
    for name, array in (("phase_lag_rad", lag), ("variance_rad2", variance)):
        if array.ndim == 0 or array.shape[-1] != 2:
            raise ValueError(f"{name} must have two tones last, got shape {array.shape}")
    return lag, variance


def _check_tone(tone_hz: float) -> None:
    if not (math.isfinite(tone_hz) and tone_hz > 0):
        raise ValueError(f"tone_hz must be finite and above zero, got {tone_hz!r}")
