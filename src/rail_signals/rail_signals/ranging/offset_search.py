"""Carrier offset of an FM ranging signal, and its removal.

The components of the wave share one offset and, over whole periods, keep their phases. So the
offset is where the components of the periods, summed coherently over the burst and in power
over the components, peak.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.phasors import cis

from .fm_spectrum import FmSpectrum
from .signal import RangingSignal

RealArray: TypeAlias = NDArray[np.float32] | NDArray[np.float64]

TAPER_LOSS = 1e-9
"""Largest fraction of the power of an offset carrier that tapers may leave out."""

MAX_TAPERS = 12
"""Largest number of tapers; with more the sums take longer than they save."""

_TAPERS_FROM = 64
_VECTORS = 32
_SEGMENT_CYCLES = 0.25


class OffsetSearch:
    """Tables of the search for the offset on a grid of half a cycle per burst, and its removal.

    Both (`burst_kernel`) work on rows of one period each: those of the burst, or weighted sums
    of them if fewer than `MAX_TAPERS` do. The weights, `tapers`, are Slepian sequences (Slepian,
    Bell System Technical Journal 57(5), 1978): the first of them hold every offset in the
    interval but for `TAPER_LOSS`, so that nothing more is needed of the burst.

    Interpolation follows Aboutanios and Mulgrew (IEEE Trans. Signal Processing 53(4),
    2005), with all components in one quotient: with ``R(+)``, ``R(-)`` the responses half a
    cycle per burst above and below and K segments, the remaining offset is
    ``d = K / (pi T) atan(q tan(pi / 2K))``, ``q = sum (|R(+)|^2 - |R(-)|^2) /
    sum |R(+) + R(-)|^2``, times being counted from the middle of the burst.

    Parameters
    ----------
    signal
        The signal; at least two periods long.
    components
        Components to use.
    max_offset_hz
        Largest offset [Hz], above zero.

    Raises
    ------
    ValueError
        If `max_offset_hz` turns the carrier by nearly half a cycle in a period.
    """

    def __init__(self, signal: RangingSignal, components: FmSpectrum, max_offset_hz: float) -> None:
        period, rate_hz = signal.period_samples, signal.sample_rate_hz
        limit_hz = 0.45 * rate_hz / period
        if max_offset_hz > limit_hz:
            raise ValueError(
                f"max_offset_hz must stay below {limit_hz:g} Hz for periods of"
                f" {period} samples, got {max_offset_hz:g}"
            )
        periods = signal.samples // period
        step_hz = 0.5 / signal.duration_s
        half = math.ceil(max_offset_hz / step_hz) + 1
        grid_hz = step_hz * np.arange(half + 1, dtype=np.float64)
        self.width_hz = 2 * half * step_hz
        """Width of the interval searched [Hz]."""
        cycles_per_sample = grid_hz[-2] / rate_hz
        self.tapers = _tapers(periods, cycles_per_sample * period)
        """Weights [tapers, periods] of the sums to make; None if the burst is better."""
        # Without sums, segments are several periods: the basis repeats with the period.
        repeats = 1
        if self.tapers is None:
            repeats = _segment_periods(periods, max_offset_hz * period / rate_hz)
        segments = periods // repeats
        centres = (np.arange(segments) - (segments - 1) / 2) * (repeats * period)
        turn = cis(-2 * math.pi / rate_hz * np.outer(grid_hz, centres))
        if self.tapers is not None:
            turn = turn @ self.tapers.T
        self.grid = np.stack([turn.real, turn.imag])
        """Turns of segments, or of weighted sums, at the offsets from zero up: [2, grid, rows]."""
        self.halves = _halves(self.tapers, periods)
        """Twice the weights from the middle of the burst up, then zeros; [0, 0] if none."""
        self.numbers = np.array(
            [
                step_hz,
                math.tan(math.pi / (2 * segments)),
                segments / math.pi / signal.duration_s,
                math.pi / rate_hz,
                math.pi / rate_hz * period,
                periods,
            ]
        )
        """Step of the grid [Hz], K-fold tangent and hertz of the interpolation, turns of half a
        sample and of half a period [rad/Hz], periods."""
        # Real before imaginary parts, so that products with the grid stay real.
        basis = components.real_basis(period).reshape(2 * period, -1, 2).swapaxes(1, 2)
        one = basis.reshape(2 * period, -1)
        self.strong = np.ascontiguousarray(one.T)
        """From a period to the components, real and then imaginary parts: [2 L, 2 period]."""


def _halves(tapers: FloatArray | None, periods: int) -> FloatArray:
    """Weights from the middle up, twice, but for that of a period in it, then zeros."""
    if tapers is None:
        return np.zeros((0, 0))
    halves = 2.0 * tapers[:, periods // 2 :]
    if periods % 2:
        halves[:, 0] /= 2
    # Sums of whole vectors are faster.
    return np.pad(halves, ((0, 0), (0, -halves.shape[1] % _VECTORS)))


def _segment_periods(periods: int, cycles_per_period: float) -> int:
    """Periods in a segment: a divisor that the offset turns little, two segments or more."""
    fits = [
        count
        for count in range(1, periods // 2 + 1)
        if periods % count == 0 and count * cycles_per_period <= _SEGMENT_CYCLES
    ]
    return max(fits, default=1)


def _tapers(periods: int, cycles_per_period: float) -> FloatArray | None:
    """Slepian sequences [sequences, periods], or None where they do not pay."""
    if periods < _TAPERS_FROM:
        return None
    tapers = slepian_sequences(periods, cycles_per_period, TAPER_LOSS)
    return tapers if len(tapers) <= MAX_TAPERS else None


def slepian_sequences(count: int, cycles: float, loss: float) -> FloatArray:
    """Orthonormal sequences [sequences, count] that hold all low-frequency sinusoids.

    As few as leave out less than `loss` of the power of any sinusoid of up to `cycles`
    cycles per element.

    Examples
    --------
    >>> slepian_sequences(124, 1 / 124, 1e-9).shape
    (8, 124)
    """
    index = np.arange(count)
    # Of a matrix with their eigenvectors whose eigenvalues lie apart (Slepian, equation 14), so
    # that sequences are even or odd to the last digits.
    matrix = np.diag((index - (count - 1) / 2) ** 2 * math.cos(2 * math.pi * cycles))
    beside = index[1:] * (count - index[1:]) / 2
    matrix += np.diag(beside, 1) + np.diag(beside, -1)
    _, vectors = np.linalg.eigh(matrix)
    sequences = vectors.T[::-1]
    tones = cis(2 * math.pi * np.outer(np.linspace(0, cycles, 2 * count), index))
    held = np.cumsum(np.abs(tones @ sequences.T) ** 2, axis=1).min(axis=0) / count
    return np.ascontiguousarray(sequences[: int(np.argmax(held > 1 - loss)) + 1])
