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
from rail_signals.compiled import compiled
from rail_signals.phasors import cis

from .signal import block_times_s
from .tone_plan import TonePlan

_TERMS = (0.35875, 0.48829, 0.14128, 0.01168)
#: Energy of a peak over that of noise below which a slot counts as empty at once.
_FLOOR = 8.0
#: Bins to either side of a peak that are looked at.
_AROUND = 12
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
        self.plan = plan
        time_s = block_times_s(plan)
        self._window = _window(time_s / plan.duration_s)
        self._energy = float(self._window @ self._window)
        half = math.ceil(plan.max_shift_hz / plan.bin_hz) + 1
        middle = [plan.slot_offset_hz(slot) / plan.bin_hz for slot in range(plan.slots)]
        self._first = np.array([round(m) - half for m in middle])
        self._width = 2 * half + 1
        self._guard = _guard_bins(plan, middle)
        self._near = 2 * math.ceil(plan.lobe_hz / plan.bin_hz)
        self._templates = _templates(plan, self._window)

    def spectrum(self, block: ComplexArray) -> ComplexArray:
        """Transform of the windowed block, complex [samples]."""
        lines: ComplexArray = np.fft.fft(block * self._window)
        return lines

    def guard_noise(self, spectrum: ComplexArray) -> float:
        """Noise power per sample, from the bins between the slots."""
        return _mean_energy(spectrum, self._guard) / self._energy

    def noise(self, spectrum: ComplexArray, frequency_hz: FloatArray) -> float:
        """Noise power per sample, from all bins but those near tones at the frequencies [n]."""
        return _energy_beside(spectrum, frequency_hz, self.plan.bin_hz, self._near) / self._energy

    def find(self, spectrum: ComplexArray, noise: float) -> DetectedTones:
        """Slots with a peak above the noise, and what the templates say of it."""
        slots = np.empty(len(self._first), dtype=np.intp)
        found, level = np.empty((2, len(slots))), np.empty(len(slots), dtype=np.complex128)
        least = _FLOOR * self._energy * noise
        size = _find(
            spectrum, least, self._first, self._width, *self._templates, slots, found, level
        )
        return DetectedTones(slots[:size], found[0, :size], found[1, :size], level[:size])


class _Templates(NamedTuple):
    """Windowed tones on a grid of offsets from a bin and of chirps.

    Attributes
    ----------
    lines : float64 [part, bin, template]
        Conjugate lines about the bin, of unit energy; chirp after chirp of one offset.
    values : float64 [3, template]
        Offset [Hz], chirp [Hz/s], and response to a tone of unit level.
    row : int
        Chirps of one offset.
    offset_step_hz, chirp_step, phase_per_chirp : float
        Steps of the grid, and what a chirp adds to the phase at mid-block.
    bin_hz, middle_rad : float
        Distance of the bins, and what a bin adds to the phase at mid-block.
    """

    lines: FloatArray
    values: FloatArray
    row: int
    offset_step_hz: float
    chirp_step: float
    phase_per_chirp: float
    bin_hz: float
    middle_rad: float


def _templates(plan: TonePlan, window: FloatArray) -> _Templates:
    """Templates of a plan."""
    time_s = block_times_s(plan)
    chirp_step = 4 * _CHIRP_PHASE_RAD / (math.pi * plan.duration_s**2)
    steepest = math.ceil(plan.max_chirp_hz_per_s / chirp_step)
    chirps = chirp_step * np.arange(-steepest - 1, 2)
    # The line of a sweeping tone is flat: its peak may be off its middle.
    sweep = 0.2 * plan.max_chirp_hz_per_s * plan.duration_s / plan.bin_hz
    half = _OFFSETS_PER_BIN * (math.ceil(sweep) + 1)
    offset_step = plan.bin_hz / _OFFSETS_PER_BIN
    offsets_hz = offset_step * np.arange(-half, half + 1)
    offset_hz = np.repeat(offsets_hz, len(chirps))
    chirp = np.tile(chirps, len(offsets_hz))
    # The transform counts time from the first sample; tones are referred to the middle.
    middle_rad = math.pi * (plan.samples - 1) / plan.samples
    turn = cis(middle_rad * np.arange(-_AROUND, _AROUND + 1))
    phase = math.pi * (2 * offset_hz[:, None] * time_s + chirp[:, None] * time_s**2)
    bins = np.arange(-_AROUND, _AROUND + 1)
    lines = np.fft.fft(window * cis(phase), axis=1)[:, bins] * turn
    norm = np.sqrt(np.square(np.abs(lines)).sum(axis=1))
    matrix = (lines.conj() * turn / norm[:, None]).T
    spread = np.square(window) @ time_s**2 / np.square(window).sum()
    return _Templates(
        np.stack([matrix.real, matrix.imag]),
        np.stack([offset_hz, chirp, norm]),
        len(chirps),
        offset_step,
        chirp_step,
        math.pi * float(spread),
        plan.bin_hz,
        middle_rad,
    )


@compiled
def _mean_energy(spectrum: ComplexArray, bins: NDArray[np.intp]) -> float:
    """Mean energy of bins."""
    total = 0.0
    for i in bins:
        total += spectrum[i].real ** 2 + spectrum[i].imag ** 2
    return total / len(bins)


@compiled
def _energy_beside(
    spectrum: ComplexArray, frequency_hz: FloatArray, bin_hz: float, half: int
) -> float:
    """Mean energy of the bins that are more than ``half`` bins away from any frequency."""
    samples = len(spectrum)
    count = samples
    # Neighbours in one sum would have to wait for each other.
    whole = np.zeros(4)
    for i in range(0, samples, 4):
        for k in range(4):
            whole[k] += spectrum[i + k].real ** 2 + spectrum[i + k].imag ** 2
    total = (whole[0] + whole[1]) + (whole[2] + whole[3])
    # Tones lie in slots of their own, so that no bin is taken twice.
    for hz in frequency_hz:
        if hz == hz:
            middle = round(hz / bin_hz)
            for i in range(middle - half, middle + half + 1):
                line = spectrum[i % samples]
                total -= line.real**2 + line.imag**2
                count -= 1
    return float(total / count)


@compiled
def _find(
    spectrum: ComplexArray,
    least: float,
    first: NDArray[np.intp],
    width: int,
    lines: FloatArray,
    values: FloatArray,
    row: int,
    offset_step_hz: float,
    chirp_step: float,
    phase_per_chirp: float,
    bin_hz: float,
    middle_rad: float,
    slots: NDArray[np.intp],
    found: FloatArray,
    level: ComplexArray,
) -> int:
    """Tones of the slots that hold one; how many there are.

    Parameters
    ----------
    spectrum : complex128 [samples]
    least : float
        Energy of a line from which a slot is looked at.
    first, width : int [slot], int
        First bin of each slot, and how many it has.
    lines, ..., middle_rad
        See `_Templates`.
    slots, found, level : int [slot], float64 [2, slot], complex128 [slot]
        Slot, frequency [Hz] and chirp [Hz/s], and level of each; result.
    """
    samples, count = len(spectrum), 0
    around, templates = lines.shape[1], lines.shape[2]
    response, power = np.empty((2, templates)), np.empty(templates)
    for slot in range(len(first)):
        peak, most = 0, -1.0
        for i in range(first[slot], first[slot] + width):
            line = spectrum[i % samples]
            energy = line.real**2 + line.imag**2
            if energy > most:
                peak, most = i, energy
        if not most > least:
            continue
        response[:] = 0.0
        for k in range(around):
            line = spectrum[(peak + k - around // 2) % samples]
            real, imag, one, other = line.real, line.imag, lines[0, k], lines[1, k]
            for i in range(templates):
                response[0, i] += real * one[i] - imag * other[i]
                response[1, i] += real * other[i] + imag * one[i]
        for i in range(templates):
            power[i] = response[0, i] ** 2 + response[1, i] ** 2
        best = row + 1
        for i in range(row, templates - row):
            # Not at an edge of the grid, so that there is a parabola.
            if 0 < i % row < row - 1 and power[i] > power[best]:
                best = i
        offset_hz = values[0, best] + offset_step_hz * _vertex(power, best, row)
        steps = _vertex(power, best, 1)
        chirp = values[1, best] + chirp_step * steps
        angle = middle_rad * peak - phase_per_chirp * chirp_step * steps
        turn = complex(math.cos(angle), math.sin(angle))
        slots[count] = slot
        found[0, count], found[1, count] = peak * bin_hz + offset_hz, chirp
        level[count] = complex(response[0, best], response[1, best]) / values[2, best] * turn
        count += 1
    return count


@compiled
def _vertex(power: FloatArray, best: int, step: int) -> float:
    """Where a parabola through the logarithms of three powers has its vertex [steps]."""
    peak = math.log(power[best])
    low, high = math.log(power[best - step]), math.log(power[best + step])
    return 0.5 * (high - low) / max(2.0 * peak - low - high, abs(high - low))


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
