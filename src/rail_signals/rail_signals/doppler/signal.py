"""Reference tones as they are sent, and as an antenna that moves receives them.

A station sends ``exp(j 2 pi F t)`` at the offset F of its slot. At the distance R(t) it arrives
R/c later, so that the antenna, whose oscillator is off by delta, sees the phase

    ``2 pi (F t - f_k R(t) / c + (f_k / f) delta t)``,   f_k = f + F.

This is exact for a station that stands still: the shift is that of the path, ``-f_k R'(t) / c``,
at the moment of reception. Relativity adds v^2 / 2c^2, 0.3 mHz at 500 km/h and common to all
stations: it goes into delta.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.phasors import cis

from .tone_plan import TonePlan


def block_times_s(plan: TonePlan) -> FloatArray:
    """Times of the samples of a block [samples], counted from its middle [s]."""
    number = np.arange(plan.samples, dtype=np.float64)
    return np.asarray((number - 0.5 * (plan.samples - 1)) / plan.sample_rate_hz)


def reference_tone(plan: TonePlan, slot: int, *, start_s: float = 0.0) -> ComplexArray:
    """What the station of a slot sends in one block, complex [samples], of amplitude 1.

    Parameters
    ----------
    plan, slot
        The plan, and the slot of the station.
    start_s
        Time of the first sample [s]; tones go on from block to block.
    """
    cycles = plan.slot_offset_hz(slot) * start_s
    number = np.arange(plan.samples, dtype=np.float64)
    turns = number * (plan.slot_offset_hz(slot) / plan.sample_rate_hz) + cycles % 1.0
    return cis(2 * math.pi * turns)


def received_tones(
    plan: TonePlan,
    slots: Sequence[int],
    distance_m: ArrayLike,
    amplitude: ArrayLike = 1.0,
    *,
    offset_hz: float = 0.0,
    phase_rad: ArrayLike = 0.0,
) -> ComplexArray:
    """Sum of reference tones at an antenna, without noise.

    Parameters
    ----------
    plan
        The plan of the tones.
    slots : [stations]
        Slots of the stations in reach.
    distance_m : [stations, samples]
        Distance from each station at each sample [m].
    amplitude, phase_rad : [stations, samples], or what broadcasts to it
        Amplitude and phase [rad] of each tone at the antenna.
    offset_hz
        Offset delta of the receiver at the carrier [Hz].

    Returns
    -------
    complex [samples]

    Examples
    --------
    A station straight ahead at 300 km/h, its distance known at the ends of the block:

    >>> plan = TonePlan()
    >>> x_m = 1000.0 - 300.0 / 3.6 * block_times_s(plan)
    >>> block = received_tones(plan, [4], [x_m])
    >>> turn = np.angle(np.sum(block[1:] * block[:-1].conj())) / (2 * np.pi)
    >>> round(float(turn * plan.sample_rate_hz - plan.slot_offset_hz(4)), 1)
    722.7
    """
    distance = np.asarray(distance_m, dtype=np.float64)
    if distance.shape != (len(slots), plan.samples):
        raise ValueError(
            f"distance_m must have shape {(len(slots), plan.samples)}, got {distance.shape}"
        )
    if not np.isfinite(distance).all():
        raise ValueError("distance_m must be finite")
    time_s = block_times_s(plan)
    slot_hz = np.array([[plan.slot_offset_hz(slot)] for slot in slots])
    tone_hz = plan.carrier_hz + slot_hz
    rate_hz = slot_hz + tone_hz / plan.carrier_hz * offset_hz
    turns = rate_hz * time_s - tone_hz / SPEED_OF_LIGHT_M_PER_S * distance
    waves = np.asarray(amplitude) * cis(2 * math.pi * turns + np.asarray(phase_rad))
    return np.asarray(waves.sum(axis=0), dtype=np.complex128)
