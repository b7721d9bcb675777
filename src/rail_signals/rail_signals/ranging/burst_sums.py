"""Compiled sums over the samples of a burst, for `burst_kernel`.

Rows are picked by numbers and not as views: counting the references of a view takes longer than a
sum over a period. Without a sign a number does not count from the end, and a loop becomes vectors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.compiled import compiled, compiled_sums


@compiled_sums
def energy_of(bursts: NDArray[np.floating], burst: int) -> float:
    """Sum of squares of a row of [batch, n], in its own precision."""
    total = bursts.dtype.type(0.0)
    for j in range(bursts.shape[1]):
        total += bursts[burst, j] * bursts[burst, j]
    return float(total)


@compiled
def burst_energies(bursts: NDArray[np.floating], energy: FloatArray) -> None:
    """Energy [batch] of bursts [batch, n]; afterwards they are near the processor."""
    for burst in range(len(energy)):
        energy[burst] = energy_of(bursts, burst)


@compiled_sums
def sum_of_squares(values: FloatArray) -> float:
    """Of all values."""
    total = 0.0
    for j in range(len(values)):
        total += values[j] * values[j]
    return total


@compiled_sums
def project(vector: FloatArray, bases: FloatArray, first: int, out: FloatArray, row: int) -> None:
    """Products of a vector with rows of `bases` from `first` on, an even number of them.

    Two at once: a value that is loaded serves both.
    """
    for c in range(0, out.shape[1] - 1, 2):
        a, b = 0.0, 0.0
        for j in range(len(vector)):
            a += vector[j] * bases[first + c, j]
            b += vector[j] * bases[first + c + 1, j]
        out[row, c], out[row, c + 1] = a, b


@compiled_sums
def project_rows(
    rows: NDArray[np.floating], burst: int, one: int, other: int, bases: FloatArray, out: FloatArray
) -> None:
    """Products of two periods of a burst, or twice of one, with the first rows of `bases`."""
    first, second = np.uint64(one * bases.shape[1]), np.uint64(other * bases.shape[1])
    for k in range(0, out.shape[1] - 1, 2):
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for j in range(bases.shape[1]):
            x, y = rows[burst, first + np.uint64(j)], rows[burst, second + np.uint64(j)]
            a += x * bases[k, j]
            b += x * bases[k + 1, j]
            c += y * bases[k, j]
            d += y * bases[k + 1, j]
        out[one, k], out[one, k + 1] = a, b
        out[other, k], out[other, k + 1] = c, d


@compiled_sums
def weight_of(turn: FloatArray, part: int, tapers: FloatArray, row: int) -> float:
    """Product of a row of turns with a row of tapers."""
    total = 0.0
    for n in range(tapers.shape[1]):
        total += turn[part, n] * tapers[row, n]
    return total


@compiled
def add_row(
    total: FloatArray, factor: float, rows: NDArray[np.floating], burst: int, row: int
) -> None:
    """Add a period of a burst, times a factor."""
    start = np.uint64(row * len(total))
    for j in range(len(total)):
        total[j] += factor * rows[burst, start + np.uint64(j)]


@compiled
def sum_rows(
    total: FloatArray, rows: NDArray[np.floating], burst: int, first: int, stop: int
) -> None:
    """Sum of the periods from `first` to `stop`."""
    for j in range(len(total)):
        total[j] = 0.0
    whole = stop - (stop - first) % 2
    for row in range(first, whole, 2):
        one, other = np.uint64(row * len(total)), np.uint64((row + 1) * len(total))
        for j in range(len(total)):
            total[j] += rows[burst, one + np.uint64(j)] + rows[burst, other + np.uint64(j)]
    if whole < stop:
        add_row(total, 1.0, rows, burst, whole)


@compiled
def add_pair(
    in_phase: FloatArray,
    quadrature: FloatArray,
    cosine: float,
    sine: float,
    rows: NDArray[np.floating],
    burst: int,
    late: int,
    early: int,
) -> None:
    """Add two periods that lie as far behind and before the middle."""
    one, other = np.uint64(late * len(in_phase)), np.uint64(early * len(in_phase))
    for j in range(len(in_phase)):
        after, before = rows[burst, one + np.uint64(j)], rows[burst, other + np.uint64(j)]
        in_phase[j] += cosine * (after + before)
        quadrature[j] += sine * (after - before)
