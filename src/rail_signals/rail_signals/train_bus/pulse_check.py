"""Whether a transmitter's pulse keeps to the mask of Choi, Lee and Lim (S2, Fig 5).

The figure's values are not readable in the document. Those of `PulseMask` are parameters, taken
from memory of IEC 61375, and say so in `PulseMask.unconfirmed`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray

from .transmitter import BIT_RATE_HZ, LOADS


@dataclass(frozen=True)
class PulseMask:
    """Limits of a pulse.

    Parameters
    ----------
    least_heavy_v
        Least amplitude on the resistive load [V].
    most_light_v
        Largest amplitude on the open and on the idle circuit [V].
    least_slew_v_per_ns
        Least slope where the wave crosses zero [V/ns], on the resistive load.
    bit_rate_hz, bit_rate_tolerance
        Bit rate [1/s], and what it may be off, relative.
    most_short_a
        Largest current into a short [A]; None where no limit is set.
    unconfirmed
        What is not confirmed by a source.
    """

    least_heavy_v: float = 3.0
    most_light_v: float = 7.0
    least_slew_v_per_ns: float = 0.03
    bit_rate_hz: float = BIT_RATE_HZ
    bit_rate_tolerance: float = 1e-4
    most_short_a: float | None = None
    unconfirmed: tuple[str, ...] = (
        "least_heavy_v: 3.0 V, from memory of the standard",
        "most_light_v: 7.0 V, from memory of the standard",
        "least_slew_v_per_ns: 0.03 V/ns, from memory of the standard",
        "most_short_a: no figure at hand",
    )


@dataclass(frozen=True)
class PulseCheck:
    """What was measured, and whether it passes.

    Parameters
    ----------
    test
        Which load, one of `bus_transmitter.LOADS`.
    amplitude_v
        Median of the voltage's size in the middle of the half bits [V]; of the short test the
        current [A].
    peak_v
        Largest size [V].
    slew_v_per_ns
        Least slope at a zero crossing [V/ns].
    bit_rate_hz
        Bit rate by a straight line through the crossings [1/s].
    reasons
        Why it fails; empty if it passes.
    """

    test: str
    amplitude_v: float
    peak_v: float
    slew_v_per_ns: float
    bit_rate_hz: float
    reasons: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not self.reasons


def check_pulse(
    time_s: ArrayLike, voltage_v: ArrayLike, test: str, mask: PulseMask | None = None
) -> PulseCheck:
    """Check a Manchester wave measured on one of the loads of Fig 4.

    Parameters
    ----------
    time_s, voltage_v : [samples]
        The wave, of four bits or more; for the short the current [A] of its meter.
    test
        The load it was measured on.
    mask
        The limits.

    Raises
    ------
    ValueError
        If there is no such test, or the wave does not cross zero often enough.
    """
    if test not in LOADS:
        raise ValueError(f"test must be one of {LOADS}, got {test!r}")
    limits = mask or PulseMask()
    time = np.asarray(time_s, dtype=np.float64)
    wave = np.asarray(voltage_v, dtype=np.float64)
    crossings, slopes = _crossings(time, wave)
    if len(crossings) < 4:
        raise ValueError(f"voltage_v must cross zero 4 times or more, got {len(crossings)}")
    half = 0.5 / limits.bit_rate_hz
    number = np.concatenate([[0], np.cumsum(np.round(np.diff(crossings) / half))])
    rate = 0.5 / float(np.polyfit(number, crossings, 1)[0])
    between = crossings[:-1] + np.minimum(np.diff(crossings), 2 * half) / 2
    sizes = np.abs(np.interp(between, time, wave))
    amplitude, peak = float(np.median(sizes)), float(np.abs(wave).max())
    slew = float(np.abs(slopes).min()) * 1e-9
    reasons = _reasons(test, limits, amplitude, peak, slew, rate)
    return PulseCheck(test, amplitude, peak, slew, rate, tuple(reasons))


def _reasons(
    test: str, mask: PulseMask, amplitude: float, peak: float, slew: float, rate: float
) -> list[str]:
    reasons = []
    if test == "short":
        if mask.most_short_a is not None and peak > mask.most_short_a:
            reasons.append(f"current {peak:.3g} A above {mask.most_short_a:g} A")
        return reasons
    if test == "resistive":
        if amplitude < mask.least_heavy_v:
            reasons.append(f"amplitude {amplitude:.3g} V below {mask.least_heavy_v:g} V")
        if slew < mask.least_slew_v_per_ns:
            reasons.append(f"slope {slew:.3g} V/ns below {mask.least_slew_v_per_ns:g} V/ns")
    elif peak > mask.most_light_v:
        reasons.append(f"peak {peak:.3g} V above {mask.most_light_v:g} V")
    off = rate / mask.bit_rate_hz - 1
    if not math.isfinite(off) or abs(off) > mask.bit_rate_tolerance:
        reasons.append(f"bit rate off by {off * 100:.3g} %")
    return reasons


def _crossings(time: FloatArray, wave: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times of the crossings of zero between two pulses [s], and slopes there [V/s]."""
    sign = np.sign(wave)
    before = np.flatnonzero(sign[:-1] * sign[1:] < 0)
    exact = np.flatnonzero((sign[1:-1] == 0) & (sign[:-2] * sign[2:] < 0)) + 1
    slopes = (wave[before + 1] - wave[before]) / (time[before + 1] - time[before])
    times = time[before] - wave[before] / slopes
    own = (wave[exact + 1] - wave[exact - 1]) / (time[exact + 1] - time[exact - 1])
    order = np.argsort(np.concatenate([times, time[exact]]))
    return np.concatenate([times, time[exact]])[order], np.concatenate([slopes, own])[order]
