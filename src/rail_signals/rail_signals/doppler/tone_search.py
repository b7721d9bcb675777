"""First look at a block of reference tones: which slots hold one, and where it lies.

The block is weighed with the four-term Blackman-Harris window (Harris, Proc. IEEE 66(1), 1978)
before it is transformed. Its side lobes are 92 dB down, so that the tone of a station 20 m away
hides none of a station at the end of the reach; it costs 3 dB, which is what a tone between
two bins loses without a window. The noise is measured between the slots.

Abeam of a station a tone sweeps over some bins. So the bins about a peak are correlated with
templates, tones on a grid of offsets and chirps, and the best is interpolated in both. At
mid-block the two do not depend on each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.phasors import cis

from .signal import block_times_s
from .tone_plan import TonePlan

_TERMS = (0.35875, 0.48829, 0.14128, 0.01168)
#: Energy of a peak over that of noise below which a slot counts as empty at once.
_FLOOR = 8.0
#: Bins about a peak that are looked at.
_AROUND = np.arange(-12, 13)
#: Steps of the templates: one bin, and this phase at the ends of the block [rad].
_OFFSETS_PER_BIN = 1
_CHIRP_PHASE_RAD = 1.6


class DetectedTones(NamedTuple):
    """Slots that may hold a tone, and a first guess of each; arrays [n].

    ``frequency_hz``, relative to the carrier, and complex ``level`` are those at mid-block.
    """

    slots: NDArray[np.intp]
    frequency_hz: FloatArray
    chirp_hz_per_s: FloatArray
    level: ComplexArray


class ToneSearch:
    """Windowed transform of a block, its noise, and the tones that stand out.

    Parameters
    ----------
    plan
        The plan of the tones.
    """

    def __init__(self, plan: TonePlan) -> None:
        samples = plan.samples
        self.plan = plan
        time_s = block_times_s(plan)
        self._window = _window(time_s / plan.duration_s)
        self._energy = float(self._window @ self._window)
        half = math.ceil(plan.max_shift_hz / plan.bin_hz) + 1
        middle = [plan.slot_offset_hz(slot) / plan.bin_hz for slot in range(plan.slots)]
        self._first = np.array([round(m) - half for m in middle])
        self._bins = (self._first[:, None] + np.arange(2 * half + 1)) % samples
        self._slot = np.arange(plan.slots)
        self._guard = _guard_bins(plan, middle)
        half_width = 2 * math.ceil(plan.lobe_hz / plan.bin_hz)
        self._near = np.arange(-half_width, half_width + 1)
        # The transform counts time from the first sample; tones are referred to the middle.
        self._middle = math.pi * (samples - 1) / samples
        self._templates = _Templates(plan, self._window, cis(self._middle * _AROUND))

    def spectrum(self, block: ComplexArray) -> ComplexArray:
        """Transform of the windowed block, complex [samples]."""
        lines: ComplexArray = np.fft.fft(block * self._window)
        return lines

    def guard_noise(self, spectrum: ComplexArray) -> float:
        """Noise power per sample, from the bins between the slots."""
        guard = spectrum.take(self._guard)
        return float(np.vdot(guard, guard).real) / (len(self._guard) * self._energy)

    def noise(self, spectrum: ComplexArray, frequency_hz: FloatArray) -> float:
        """Noise power per sample, from all bins but those near tones at the frequencies [n]."""
        samples = self.plan.samples
        bins = np.rint(frequency_hz / self.plan.bin_hz).astype(np.intp)
        # Tones lie in slots of their own, so that no bin is taken twice.
        near = spectrum.take(bins[:, None] + self._near, mode="wrap")
        energy = np.vdot(spectrum, spectrum).real - np.vdot(near, near).real
        return float(energy) / ((samples - near.size) * self._energy)

    def find(self, spectrum: ComplexArray, noise: float) -> DetectedTones:
        """Slots with a peak above the noise, and what the templates say of it."""
        height = np.abs(spectrum.take(self._bins))
        peak = height.argmax(axis=1)
        least = math.sqrt(_FLOOR * self._energy * noise)
        slots = np.flatnonzero(height[self._slot, peak] > least)
        bins = self._first[slots] + peak[slots]
        lines = spectrum.take(bins[:, None] + _AROUND, mode="wrap")
        offset_hz, chirp, level = self._templates.best(lines)
        level *= cis(self._middle * bins)
        return DetectedTones(slots, bins * self.plan.bin_hz + offset_hz, chirp, level)


class _Templates:
    """Windowed tones on a grid of offsets from a bin and of chirps."""

    def __init__(self, plan: TonePlan, window: FloatArray, turn: ComplexArray) -> None:
        time_s = block_times_s(plan)
        self._chirp_step = 4 * _CHIRP_PHASE_RAD / (math.pi * plan.duration_s**2)
        steepest = math.ceil(plan.max_chirp_hz_per_s / self._chirp_step)
        chirps = self._chirp_step * np.arange(-steepest - 1, 2)
        # The line of a sweeping tone is flat: its peak may be off its middle.
        sweep = 0.2 * plan.max_chirp_hz_per_s * plan.duration_s / plan.bin_hz
        half = _OFFSETS_PER_BIN * (math.ceil(sweep) + 1)
        self._offset_step = plan.bin_hz / _OFFSETS_PER_BIN
        offsets_hz = self._offset_step * np.arange(-half, half + 1)
        self._offset_hz = np.repeat(offsets_hz, len(chirps))
        self._chirp = np.tile(chirps, len(offsets_hz))
        self._row = len(chirps)
        phase = math.pi * (2 * self._offset_hz[:, None] * time_s + self._chirp[:, None] * time_s**2)
        lines = np.fft.fft(window * cis(phase), axis=1)[:, _AROUND] * turn
        # Referred to the middle of the block, and scaled so that a match gives the level.
        scale = np.square(np.abs(lines)).sum(axis=1, keepdims=True)
        self._norm = np.sqrt(scale[:, 0])
        self._matrix = np.ascontiguousarray((lines.conj() * turn / self._norm[:, None]).T)
        inner = np.zeros((len(offsets_hz), len(chirps)), dtype=np.bool_)
        inner[1:-1, 1:-1] = True
        self._inner = np.flatnonzero(inner.ravel())
        self._cross = np.array([0, -self._row, self._row, -1, 1])
        spread = np.square(window) @ time_s**2 / np.square(window).sum()
        self._phase_per_chirp = math.pi * float(spread)

    def best(self, lines: ComplexArray) -> tuple[FloatArray, FloatArray, ComplexArray]:
        """Offset [Hz], chirp [Hz/s] and level of each row of lines [n, bins]."""
        response = lines @ self._matrix
        power = response.real**2 + response.imag**2
        row = np.arange(len(lines))[:, None]
        pick = self._inner[power[:, self._inner].argmax(axis=1)]
        # Parabolas through the logarithms of the power, along either axis.
        cross = np.log(power[row, pick[:, None] + self._cross])
        low, high = cross[:, 1::2], cross[:, 2::2]
        peak = cross[:, :1]
        step = 0.5 * (high - low) / np.maximum(2 * peak - low - high, np.abs(high - low))
        chirp = step[:, 1] * self._chirp_step
        level = response[row[:, 0], pick] / self._norm[pick]
        level *= cis(-self._phase_per_chirp * chirp)
        offset_hz = self._offset_hz[pick] + step[:, 0] * self._offset_step
        return offset_hz, self._chirp[pick] + chirp, level


def _window(turns: FloatArray) -> FloatArray:
    """Blackman-Harris window at times from -1/2 to 1/2 of its length."""
    total = np.zeros_like(turns)
    for order, term in enumerate(_TERMS):
        total += term * np.cos(2 * math.pi * order * turns)
    return total


def _guard_bins(plan: TonePlan, middle: list[float]) -> NDArray[np.intp]:
    """Bins that no tone within the limits of the plan reaches."""
    samples = plan.samples
    half_width = (plan.max_shift_hz + plan.lobe_hz) / plan.bin_hz
    bins = np.arange(samples)
    near = np.zeros(samples, dtype=np.bool_)
    for m in middle:
        near |= np.abs((bins - m + samples / 2) % samples - samples / 2) < half_width
    return np.flatnonzero(~near)
