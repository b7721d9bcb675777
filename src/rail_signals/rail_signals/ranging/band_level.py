"""Level of a real signal in the band around a carrier."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

#: Band of a coded audio-frequency carrier, to either side [Hz].
HALF_BAND_HZ = 120.0


def band_levels_db(
    samples: NDArray[np.float64], carriers_hz: tuple[float, ...], sample_rate_hz: float
) -> list[float]:
    """Levels [dB] of the bands around carriers; 0 dB is a wave of amplitude 1.

    Parameters
    ----------
    samples : float [samples]
    carriers_hz : tuple of float
        Middles of the bands, each `HALF_BAND_HZ` to either side.
    sample_rate_hz : float

    Returns
    -------
    list of float
        -inf where there is no power, or where samples are not numbers.

    Examples
    --------
    >>> wave = 0.1 * np.sin(2 * np.pi * 2300.0 / 16e3 * np.arange(1600))
    >>> [round(level) for level in band_levels_db(wave + 1e-9, (1700.0, 2300.0), 16e3)][1]
    -20
    """
    count = len(samples)
    if count == 0:
        return [-math.inf] * len(carriers_hz)
    spectrum = np.fft.rfft(samples)
    step_hz = sample_rate_hz / count
    levels = []
    for carrier_hz in carriers_hz:
        low = max(0, math.ceil((carrier_hz - HALF_BAND_HZ) / step_hz))
        part = spectrum[low : math.floor((carrier_hz + HALF_BAND_HZ) / step_hz) + 1]
        # Twice the one-sided power of a wave of amplitude 1, which is 1/2.
        power = 4.0 * float(np.vdot(part, part).real) / count**2
        levels.append(10.0 * math.log10(power) if 0.0 < power < math.inf else -math.inf)
    return levels
