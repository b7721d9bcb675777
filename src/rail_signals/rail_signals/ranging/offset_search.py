"""Carrier offset of an FM ranging signal, and its removal.

The components of the wave share one offset and, over whole periods, keep their phases. So the
offset is where the components of the periods, summed coherently over the burst and in power
over the components, peak.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import DTypeLike, NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.phasors import cis

from .fm_spectrum import FmSpectrum
from .signal import RangingSignal

RealArray: TypeAlias = NDArray[np.float32] | NDArray[np.float64]

TAPER_LOSS = 1e-9
"""Largest fraction of the power of an offset carrier that tapers may leave out."""

MAX_TAPERS = 12
"""Largest number of tapers; with more the sums take longer than they save."""

_TAPERS_FROM = 64
_SEGMENT_CYCLES = 0.25


class OffsetSearch:
    """Search for the offset on a grid of half a cycle per burst, and its removal.

    Both work on rows of one period each: those of the burst, or weighted sums of them if
    fewer than `MAX_TAPERS` do. The weights, `tapers`, are Slepian sequences (Slepian, Bell
    System Technical Journal 57(5), 1978): the first of them hold every offset in the
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
        self._period, self._periods = period, signal.samples // period
        step_hz = 0.5 / signal.duration_s
        half = math.ceil(max_offset_hz / step_hz) + 1
        grid_hz = step_hz * np.arange(-half, half + 1, dtype=np.float64)
        self.width_hz = 2 * half * step_hz
        """Width of the interval searched [Hz]."""
        cycles_per_sample = grid_hz[-2] / rate_hz
        self.tapers = _tapers(self._periods, cycles_per_sample * period)
        """Weights [tapers, periods] of the sums to make; None if the burst is better."""
        # Without sums, segments are several periods: the basis repeats with the period.
        repeats = 1
        if self.tapers is None:
            repeats = _segment_periods(self._periods, max_offset_hz * period / rate_hz)
        segments = self._periods // repeats
        self._row = 2 * period * repeats
        # Arrays, not numbers: these a ufunc takes without conversion.
        self._arc = np.array(math.tan(math.pi / (2 * segments)))
        self._arc_hz = np.array(segments / math.pi / signal.duration_s)
        self._grid_hz = grid_hz[1:-1]
        tables = _Tables.of(signal, components, grid_hz, repeats, self.tapers)
        self._tables: dict[Any, _Tables] = {
            np.dtype(kind): tables.astype(kind) for kind in (np.float32, np.float64)
        }
        self._component_count, self._grid_count = len(components.bins), len(grid_hz)
        i, j = _factors(self._periods)
        self._split = (i, i + j, i + j + _factors(period)[0])

    def offset_hz(self, rows: RealArray) -> FloatArray:
        """Carrier offset [Hz] of each of `rows` [batch, rows, 2 period] (see `fold`)."""
        # Matrix products are stacked, one of fixed shape for each burst, so that their
        # rounding does not depend on the batch.
        _, basis, grid, _ = self._tables[rows.dtype]
        batch, _, width = rows.shape
        if width != self._row:
            rows = rows.reshape(batch, -1 if batch else 1, self._row)
        components = (rows @ basis).reshape(batch, grid.shape[1], self._component_count)
        response = (grid @ components).reshape(batch, self._grid_count, 2 * self._component_count)
        power = np.vecdot(response, response)
        below, above = response[:, :-2], response[:, 2:]
        total = above + below
        quotient = (power[:, 2:] - power[:, :-2]) / np.vecdot(total, total)
        offset_hz = np.arctan(quotient * self._arc) * self._arc_hz + self._grid_hz
        peak = power[:, 1:-1].argmax(axis=1)
        return np.asarray(offset_hz[np.arange(batch), peak], dtype=np.float64)

    def fold(self, rows: RealArray, offset_hz: FloatArray) -> ComplexArray:
        """Sum of the periods [batch, 1, period] after turning back by `offset_hz` [batch].

        The phase is turned about the middle of the burst.

        Parameters
        ----------
        rows : float [batch, rows, 2 period]
            The periods of each burst, or their sums weighted by `tapers`, as real and
            imaginary parts.
        offset_hz : float [batch]
            Offset to remove [Hz].
        """
        tapers, _, _, ramp = self._tables[rows.dtype]
        batch = len(rows)
        turn = cis(offset_hz.astype(ramp.dtype)[:, None] * ramp)
        i, j, k = self._split
        over: Any = turn[:, :i, None] * turn[:, None, i:j]
        over = over.reshape(batch, 1, self._periods)
        if tapers is not None:
            over = over @ tapers
        within = turn[:, j:k, None] * turn[:, None, k:]
        folded = over @ rows.view(turn.dtype)
        folded *= within.reshape(batch, 1, self._period)
        return np.asarray(folded, dtype=np.complex128)


class _Tables(NamedTuple):
    """Matrices in the precision of the bursts."""

    tapers: NDArray[Any] | None
    basis: NDArray[Any]
    grid: NDArray[Any]
    ramp: NDArray[Any]

    @classmethod
    def of(
        cls,
        signal: RangingSignal,
        components: FmSpectrum,
        grid_hz: FloatArray,
        repeats: int,
        tapers: FloatArray | None,
    ) -> _Tables:
        period = signal.period_samples
        periods = signal.samples // period
        # The time of a sample about the middle is a sum of four terms, so its phasor is
        # a product of entries of four short tables.
        i, j = _factors(periods)
        k, m = _factors(period)
        steps = ((i, j * period), (j, period), (k, m), (m, 1))
        times = [(np.arange(count) - (count - 1) / 2) * step for count, step in steps]
        per_hz = -2 * math.pi / signal.sample_rate_hz
        segments = periods // repeats
        centres = (np.arange(segments) - (segments - 1) / 2) * (repeats * period)
        turn = cis(per_hz * np.outer(grid_hz, centres))
        if tapers is not None:
            turn = turn @ tapers.T
        # Real before imaginary parts, so that products with the grid stay real.
        basis = components.real_basis(period).reshape(2 * period, -1, 2).swapaxes(1, 2)
        re, im = turn.real, turn.imag
        grid = np.stack([np.stack([re, -im], axis=-1), np.stack([im, re], axis=-1)], axis=1)
        return cls(
            None if tapers is None else tapers.T.astype(np.complex128),
            np.tile(basis.reshape(2 * period, -1), (repeats, 1)),
            grid.reshape(2 * len(grid_hz), -1),
            per_hz * np.concatenate(times),
        )

    def astype(self, kind: DTypeLike) -> _Tables:
        tapers, *rest = self
        paired = None if tapers is None else tapers.astype(np.result_type(kind, np.complex64))
        return _Tables(paired, *(np.ascontiguousarray(table, dtype=kind) for table in rest))


def _factors(count: int) -> tuple[int, int]:
    """Two factors of `count`, as close to each other as they come."""
    low = max(d for d in range(1, math.isqrt(count) + 1) if count % d == 0)
    return count // low, low


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
    _, vectors = np.linalg.eigh(np.sinc(2 * cycles * (index[:, None] - index)))
    sequences = vectors.T[::-1]
    tones = cis(2 * math.pi * np.outer(np.linspace(0, cycles, 2 * count), index))
    held = np.cumsum(np.abs(tones @ sequences.T) ** 2, axis=1).min(axis=0) / count
    return np.ascontiguousarray(sequences[: int(np.argmax(held > 1 - loss)) + 1])
