"""Measured reflections brought to the time grid of a reflectometer.

A network analyser tells the reflection of the head over frequency. Times the spectrum of a
Gaussian edge, ``exp(-(2 pi f sigma)^2 / 2)``, and transformed, that is what an edge brings back
at each moment; its running integral is the answer to a step, as a reflectometer shows it.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.special import ndtr

from rail_signals.arrays import FloatArray

from .response import RISE_PER_SIGMA, lead_in_s

_LEFT_AT_TOP: Final = 1e-3
_UNEVEN: Final = 1e-3


def step_answer(
    frequency_hz: ArrayLike, reflection: ArrayLike, rise_time_s: float, period_s: float
) -> tuple[FloatArray, FloatArray]:
    """What a step brings back, from the reflection over frequency.

    Parameters
    ----------
    frequency_hz : float64 [frequencies]
        Evenly spaced from 0, or from one step.
    reflection : complex [frequencies]
        Reflection of the head there.
    rise_time_s
        Rise time of the step, 10 to 90 % [s].
    period_s
        Spacing of the samples wanted at most [s].

    Returns
    -------
    time_s, reflection : float64 [samples]
        From before the edge to as long as the spacing of the frequencies tells.

    Raises
    ------
    ValueError
        If the frequencies do not do.
    """
    f = np.asarray(frequency_hz, dtype=np.float64)
    rho = np.asarray(reflection, dtype=np.complex128)
    step_hz = (f[-1] - f[0]) / (len(f) - 1)
    if step_hz <= 0.0 or np.abs(np.diff(f) - step_hz).max() > _UNEVEN * step_hz:
        raise ValueError("frequency_hz must rise evenly")
    first = round(f[0] / step_hz)
    if first not in (0, 1) or abs(f[0] - first * step_hz) > 0.05 * step_hz:
        raise ValueError(f"frequency_hz must begin at 0 or at one step, got {f[0]:g}")
    if first == 1:
        # The real part is even, the imaginary part odd.
        rest = rho[0].real + (rho[0].real - rho[1].real) / 3.0
        rho = np.concatenate(([rest], rho))
    sigma_s = rise_time_s / RISE_PER_SIGMA
    top = math.sqrt(-2.0 * math.log(_LEFT_AT_TOP)) / (2.0 * math.pi * sigma_s)
    if f[-1] < top:
        raise ValueError(
            f"frequency_hz must reach {top:.3g} for a rise time of {rise_time_s:g} s, got {f[-1]:g}"
        )
    axis = step_hz * np.arange(len(rho))
    spectrum = rho * np.exp(-0.5 * np.square(2.0 * math.pi * sigma_s * axis))
    length = max(2 * (len(rho) - 1), math.ceil(1.0 / (step_hz * period_s)))
    length = int(fft.next_fast_len(length, real=True))
    period = 1.0 / (length * step_hz)
    before = math.ceil(lead_in_s(rise_time_s) / period)
    time_s = (np.arange(length) - before) * period
    # Integrated over frequency: the mean becomes a ramp, and all begins at 0 before the edge.
    swing = np.zeros(len(spectrum), dtype=np.complex128)
    swing[1:] = spectrum[1:] / (2j * math.pi * axis[1:])
    periodic = np.roll(fft.irfft(swing, length) * (length * step_hz), before)
    ramp = spectrum[0].real * step_hz * (time_s - time_s[0])
    return time_s, np.asarray(periodic - periodic[0] + ramp)


def step_edge(time_s: ArrayLike, rise_time_s: float) -> FloatArray:
    """A step from 0 to 1 with its middle at 0, as a reflectometer sends it [...].

    Parameters
    ----------
    time_s : [...]
        Moments [s].
    rise_time_s
        Rise time, 10 to 90 % [s].
    """
    return np.asarray(ndtr(np.asarray(time_s) * (RISE_PER_SIGMA / rise_time_s)))


def from_ohms(impedance_ohm: ArrayLike, reference_ohm: float) -> FloatArray:
    """Reflection of an impedance as an instrument shows it (S2, 23) [...]."""
    z = np.asarray(impedance_ohm, dtype=np.float64)
    if (z < 0.0).any():
        raise ValueError(f"impedance_ohm must be 0 or more, got {np.min(z):g}")
    return np.asarray((z - reference_ohm) / (z + reference_ohm))
