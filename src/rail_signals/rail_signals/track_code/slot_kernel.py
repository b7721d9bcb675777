"""Compiled part of the receiver for long inputs: what the long slots of a batch hold.

Each slot is measured by itself, in one order, so that its result does not depend on the batch.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.compiled import compiled, compiled_sums

from .hop_kernel import SingleArray

#: Samples of a slot that `measure_slots` takes at once.
SLOT_STEP = 8
_BLOCK = 16
_ZERO = np.float32(0.0)


@compiled
def measure_slots(
    stream: SingleArray,
    hop_samples: int,
    measure: SingleArray,
    wave: SingleArray,
    next_wave: SingleArray,
    deviations: FloatArray,
    limits: FloatArray,
    bits: BoolArray,
    levels: FloatArray,
    parts: SingleArray,
    residual_hz: SingleArray,
    is_clear: BoolArray,
    is_changed: BoolArray,
) -> None:
    """Levels of the tones in every slot, what they leave over, and signs of a change.

    Parameters
    ----------
    stream : float32 [slot + (hops - 1) hop_samples + SLOT_STEP]
        The demodulated wave [Hz]; a slot begins every so many samples.
    measure : float32 [rows, 2 tones + freedom]
        From a slot, and zeros to a multiple of `SLOT_STEP`, to real, then imaginary parts of
        the tones, and to independent residuals.
    wave, next_wave : float32 [2 tones, slot], [2 tones, short slot]
        From the parts to the wave of the slot, and of the newest samples of the next one.
    deviations : float64 [tones]
        Nominal amplitudes [Hz].
    limits : float64 [7]
        Between absent and present; greatest absent, least and greatest present; greatest sum of
        squares of the residuals; change over what was left over, and least change [Hz].
    bits : bool [hops, tones], levels : float64 [hops, tones], parts : float32 [hops, 2 tones]
        Result: tones present, amplitudes over nominal ones, amplitudes of those present [Hz].
    residual_hz : float32 [hops]
        Result: root mean square of what these leave over.
    is_clear : bool [hops]
        Result: whether all levels are in a window and the noise is small.
    is_changed : bool [hops]
        Result: whether the newest samples are not what the slot before goes on to be.
    """
    tones = len(deviations)
    found = np.empty((_BLOCK, measure.shape[1]), np.float32)
    left = np.empty(wave.shape[1], np.float32)
    for hop in range(len(bits)):
        if hop % _BLOCK == 0:
            _measure(stream, hop, min(_BLOCK, len(bits) - hop), hop_samples, measure, found)
        start, row = hop * hop_samples, hop % _BLOCK
        is_changed[hop] = False
        if hop > 0:
            newest = start + wave.shape[1] - next_wave.shape[1]
            change_hz = _left_over(stream, newest, parts, hop - 1, next_wave, left)
            is_changed[hop] = change_hz > max(limits[5] * residual_hz[hop - 1], limits[6])
        clear = _residual_energy(found, row, 2 * tones) <= limits[4]
        _judge(found, row, deviations, limits, levels, bits, hop)
        for i in range(tones):
            level = levels[hop, i]
            clear &= (level <= limits[1]) | ((limits[2] <= level) & (level <= limits[3]))
        is_clear[hop] = clear
        for i in range(tones):
            parts[hop, i] = found[row, i] if bits[hop, i] else _ZERO
            parts[hop, tones + i] = found[row, tones + i] if bits[hop, i] else _ZERO
        residual_hz[hop] = _left_over(stream, start, parts, hop, wave, left)


@compiled
def _measure(
    stream: SingleArray,
    first: int,
    hops: int,
    hop_samples: int,
    matrix: SingleArray,
    found: SingleArray,
) -> None:
    """``found = slot @ matrix`` for a block of hops, `SLOT_STEP` rows of the matrix at a time.

    For so many hops they are read from the innermost cache.
    """
    for hop in range(hops):
        for k in range(found.shape[1]):
            found[hop, k] = _ZERO
    for n in range(0, len(matrix), SLOT_STEP):
        for hop in range(hops):
            i = (first + hop) * hop_samples + n
            a, b, c, d = stream[i], stream[i + 1], stream[i + 2], stream[i + 3]
            e, f, g, h = stream[i + 4], stream[i + 5], stream[i + 6], stream[i + 7]
            for k in range(found.shape[1]):
                found[hop, k] += (
                    (a * matrix[n, k] + b * matrix[n + 1, k])
                    + (c * matrix[n + 2, k] + d * matrix[n + 3, k])
                ) + (
                    (e * matrix[n + 4, k] + f * matrix[n + 5, k])
                    + (g * matrix[n + 6, k] + h * matrix[n + 7, k])
                )


@compiled
def _judge(
    found: SingleArray,
    row: int,
    deviations: FloatArray,
    limits: FloatArray,
    levels: FloatArray,
    bits: BoolArray,
    hop: int,
) -> None:
    """Levels of a slot, and which tones are present."""
    tones = len(deviations)
    for i in range(tones):
        re, im = found[row, i], found[row, tones + i]
        levels[hop, i] = math.sqrt(re * re + im * im) / deviations[i]
    for i in range(tones):
        bits[hop, i] = levels[hop, i] > limits[0]


@compiled
def _left_over(
    stream: SingleArray,
    start: int,
    parts: SingleArray,
    hop: int,
    wave: SingleArray,
    left: SingleArray,
) -> Any:
    """Root mean square of samples less the wave of the tones present in a slot."""
    count = wave.shape[1]
    tones = len(wave) // 2
    for n in range(count):
        left[n] = stream[start + n]
    for i in range(tones):
        re, im = parts[hop, i], parts[hop, tones + i]
        if re != _ZERO or im != _ZERO:
            for n in range(count):
                left[n] -= re * wave[i, n] + im * wave[tones + i, n]
    return np.float32(math.sqrt(_sum_of_squares(left, count) / count))


@compiled_sums
def _residual_energy(found: SingleArray, row: int, first: int) -> Any:
    total = _ZERO
    for k in range(first, found.shape[1]):
        total += found[row, k] * found[row, k]
    return total


@compiled_sums
def _sum_of_squares(row: SingleArray, count: int) -> Any:
    total = _ZERO
    for n in range(count):
        total += row[n] * row[n]
    return total
