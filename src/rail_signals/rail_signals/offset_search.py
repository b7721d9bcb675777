"""Carrier offset of an FM ranging signal, and its removal.

The lines of the wave share one offset and, over segments of whole periods, keep their
phases. So the offset is where the lines of the segments, summed coherently over the burst
and in power over the lines, peak.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rail_signals.line_spectrum import LineSpectrum
from rail_signals.ranging_signal import ComplexArray, FloatArray, RangingSignal

Bursts: TypeAlias = NDArray[np.complex64] | NDArray[np.complex128]

_SEGMENT_CYCLES = 0.25
_FOLD_FROM = 12


class OffsetSearch:
    """Search for the offset on a grid of half a cycle per burst, and interpolation.

    Interpolation follows Aboutanios and Mulgrew (IEEE Trans. Signal Processing 53(4),
    2005), with all lines in one quotient: with ``R(+)``, ``R(-)`` the responses half a
    cycle per burst above and below and K segments, the remaining offset is
    ``d = K / (pi T) atan(q tan(pi / 2K))``, ``q = Re sum (R(+) - R(-)) (R(+) + R(-))* /
    sum |R(+) + R(-)|^2``, times being counted from the middle of the burst.

    Parameters
    ----------
    signal
        The signal; at least two periods long.
    lines
        Lines to use.
    max_offset_hz
        Largest offset [Hz], above zero.

    Raises
    ------
    ValueError
        If `max_offset_hz` turns the carrier by nearly half a cycle in a period.
    """

    def __init__(self, signal: RangingSignal, lines: LineSpectrum, max_offset_hz: float) -> None:
        period, rate_hz = signal.period_samples, signal.sample_rate_hz
        limit_hz = 0.45 * rate_hz / period
        if max_offset_hz > limit_hz:
            raise ValueError(
                f"max_offset_hz must stay below {limit_hz:g} Hz for periods of"
                f" {period} samples, got {max_offset_hz:g}"
            )
        periods = signal.samples // period
        repeats = _segment_periods(periods, max_offset_hz * period / rate_hz)
        segments = periods // repeats
        # Long segments are folded first. Of short ones each is one row of samples, and the
        # basis repeats with the period: one product instead of many small ones.
        long = repeats >= _FOLD_FROM
        self._ones = np.ones((1, repeats)) if long else None
        self._shape = (segments, repeats, 2 * period) if long else (segments, 2 * repeats * period)
        # Real before imaginary parts, so that products with `_grid` stay real.
        basis = lines.real_basis(period).reshape(2 * period, -1, 2).swapaxes(1, 2)
        self._basis = np.tile(basis.reshape(2 * period, -1), (1 if long else repeats, 1))
        step_hz = 0.5 / signal.duration_s
        half = math.ceil(max_offset_hz / step_hz) + 1
        self._grid_hz = step_hz * np.arange(-half, half + 1)
        centre_s = (np.arange(segments) - (segments - 1) / 2) * repeats * period / rate_hz
        turn = 2 * math.pi * self._grid_hz[:, None] * centre_s
        cos, sin = np.cos(turn), np.sin(turn)
        grid = np.stack([np.stack([cos, sin], axis=-1), np.stack([-sin, cos], axis=-1)], axis=1)
        self._grid = grid.reshape(2 * len(turn), 2 * segments)
        self._single = (self._basis.astype(np.float32), self._grid.astype(np.float32))
        self._line_count = len(lines.bins)
        self._arc = math.tan(math.pi / (2 * segments))
        self._arc_hz = segments / math.pi / signal.duration_s
        # The time of a sample about the middle is a sum of four terms, so its phasor is
        # a product of entries of four short tables.
        fine = max(d for d in range(1, math.isqrt(period) + 1) if period % d == 0)
        steps = (
            (segments, repeats * period),
            (repeats, period),
            (period // fine, fine),
            (fine, 1),
        )
        times = [(np.arange(count) - (count - 1) / 2) * step / rate_hz for count, step in steps]
        self._ramp = -2 * math.pi * np.concatenate(times)
        self._split = np.cumsum([count for count, _ in steps])[:3].tolist()
        self._periods, self._period = periods, period

    @property
    def width_hz(self) -> float:
        """Width of the interval searched [Hz]."""
        return float(self._grid_hz[-1] - self._grid_hz[0])

    def offset_hz(self, bursts: Bursts) -> FloatArray:
        """Carrier offset [Hz] of each of `bursts` [batch, samples]."""
        # Matrix products are stacked, one of fixed shape for each burst, so that their
        # rounding does not depend on the batch.
        single = bursts.dtype == np.complex64
        basis, grid = self._single if single else (self._basis, self._grid)
        rows = bursts.view(basis.dtype).reshape(len(bursts), *self._shape)
        if self._ones is not None:
            rows = np.matmul(self._ones.astype(rows.dtype), rows)[:, :, 0]
        lines = rows @ basis
        count = self._line_count
        response = grid @ lines.reshape(len(rows), 2 * self._shape[0], count)
        response = response.reshape(len(rows), len(self._grid_hz), 2 * count)
        peak = row_dot(response, response)[:, 1:-1].argmax(axis=-1) + 1
        row = np.arange(len(rows))
        above, below = response[row, peak + 1], response[row, peak - 1]
        total = above + below
        quotient = row_dot(above - below, total) / row_dot(total, total)
        return np.asarray(self._grid_hz[peak] + np.arctan(quotient * self._arc) * self._arc_hz)

    def fold(self, bursts: Bursts, offset_hz: FloatArray) -> ComplexArray:
        """Sum of the periods [batch, period] after turning back by `offset_hz` [batch].

        The phase is turned about the middle of the burst.
        """
        batch = len(bursts)
        table = np.empty((batch, len(self._ramp)), dtype=bursts.dtype)
        angle = (offset_hz[:, None] * self._ramp).astype(table.real.dtype, copy=False)
        np.cos(angle, out=table.real)
        np.sin(angle, out=table.imag)
        i, j, k = self._split
        turn = (table[:, :i, None] * table[:, None, i:j]).reshape(batch, 1, self._periods)
        within = (table[:, j:k, None] * table[:, None, k:]).reshape(batch, self._period)
        within *= (turn @ bursts.reshape(batch, self._periods, self._period))[:, 0]
        return within.astype(np.complex128, copy=False)


def row_dot(left: NDArray[Any], right: NDArray[Any]) -> FloatArray:
    """Inner product along the last axis."""
    return np.asarray(np.vecdot(left, right), dtype=np.float64)


def _segment_periods(periods: int, cycles_per_period: float) -> int:
    """Periods in a segment: a divisor that the offset turns little, two segments or more."""
    fits = [
        count
        for count in range(1, periods // 2 + 1)
        if periods % count == 0 and count * cycles_per_period <= _SEGMENT_CYCLES
    ]
    return max(fits, default=1)
