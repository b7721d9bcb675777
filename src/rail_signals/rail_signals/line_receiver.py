"""Receiver that fits carrier and spectral lines of an FM ranging signal.

A discriminator forms the phase of each noisy sample and so has a threshold near 10 dB.
The lines of the wave (`line_spectrum`) carry the same phase information and can be
summed over the burst before anything non-linear happens: the estimate stays at the
bound ``1 / (gamma N beta^2)`` tens of decibels lower.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.line_detector import detection_share
from rail_signals.line_spectrum import LineSpectrum, line_spectrum
from rail_signals.ranging_signal import (
    ComplexArray,
    FloatArray,
    RangingSignal,
    _as_bursts,
    modulate,
    wrap_to_turn,
)

MAX_SNR = 1e9
"""Ceiling of the estimated carrier-to-noise ratio (90 dB): the lines left out of the
model are this small, so nothing better can be told."""

_STRONG_SHARE = 0.92
_SEGMENT_CYCLES = 0.1
_DIRECT_PERIOD = 64
_CHUNK_SAMPLES = 1 << 17


@dataclass(frozen=True)
class ToneEstimate:
    """What a receiver found in each burst. Leading axes are those of the bursts.

    Where nothing was detected, phases, offset and misfit are NaN, the variance is
    infinite, amplitude and snr are zero.

    Attributes
    ----------
    phase_lag_rad : float [..., tones]
        Phase lag of each tone [rad] in [0, 2 pi).
    variance_rad2 : float [..., tones]
        Its variance [rad^2]: the bound at the estimated `snr`.
    amplitude : float [...]
        Amplitude of the carrier, of a wave of constant envelope.
    snr : float [...]
        Carrier-to-noise ratio per complex sample (linear), at most `MAX_SNR`.
    frequency_offset_hz : float [...]
        Offset of the carrier [Hz].
    misfit : float [...]
        Chi-square per degree of freedom of what the fit leaves on the lines, in terms of
        the noise between them. About 1 for one FM signal in white noise; large where a
        second signal or a jammer lies on the lines.
    detected : bool [...]
        Whether the lines hold more energy than noise would put there.
    """

    phase_lag_rad: FloatArray
    variance_rad2: FloatArray
    amplitude: FloatArray
    snr: FloatArray
    frequency_offset_hz: FloatArray
    misfit: FloatArray
    detected: NDArray[np.bool_]


class LineReceiver:
    """Maximum-likelihood receiver of a `RangingSignal` in white noise.

    1. Fold: samples a period apart are added while the offset allows it.
    2. Offset: the strong lines of each fold, correlated with a grid of frequencies half
       a cycle per burst apart; the largest sum of squares is interpolated (Aboutanios
       and Mulgrew, IEEE Trans. Signal Processing 53(4), 2005, with all lines in one
       quotient).
    3. Lines: folds are turned back by the offset, about the middle of the burst, where
       the phases of carrier and tones do not depend on its error, and summed.
    4. Phases: products of neighbouring lines start two Gauss-Newton steps on complex
       amplitude and tone phases; the symmetry of the lines makes the normal matrix
       diagonal.

    Parameters
    ----------
    signal
        The signal to receive.
    max_offset_hz
        Largest carrier offset to expect [Hz]; 0 if the carrier is exact.
    false_alarm
        Probability that noise alone counts as detected, per burst.

    Examples
    --------
    >>> receiver = LineReceiver(RangingSignal())
    >>> found = receiver.estimate(modulate(RangingSignal(), [[0.5], [4.0]]))
    >>> found.phase_lag_rad.ravel().round(9).tolist(), found.detected.tolist()
    ([0.5, 4.0], [True, True])
    """

    def __init__(
        self, signal: RangingSignal, *, max_offset_hz: float = 5e3, false_alarm: float = 1e-6
    ) -> None:
        if not (math.isfinite(max_offset_hz) and max_offset_hz >= 0):
            raise ValueError(f"max_offset_hz must be finite and not negative, got {max_offset_hz!r}")
        self.signal = signal
        period, rate_hz = signal.period_samples, signal.sample_rate_hz
        periods = signal.samples // period
        self._fold = _fold_length(periods, max_offset_hz * period / rate_hz)
        self._segments = periods // self._fold
        lines = line_spectrum(signal)
        strong = lines.strongest(_STRONG_SHARE)
        self._init_lines(lines, strong)
        self._init_offsets(max_offset_hz, strong)
        grid = self._grid_hz
        self._threshold = detection_share(
            false_alarm,
            len(strong.bins),
            self._segments * period,
            float(grid[-1] - grid[0]),
            signal.duration_s,
        )

    def _init_lines(self, lines: LineSpectrum, strong: LineSpectrum) -> None:
        """Tables of the line fit: bases, products of neighbours, Gauss-Newton rows."""
        period = self.signal.period_samples
        self._bins = lines.bins
        self._basis = _real_basis(lines.bins, period)
        self._strong_basis = _real_basis(strong.bins, period)
        where = {tuple(o): i for i, o in enumerate(lines.orders.tolist())}
        self._strong = np.array([where[tuple(o)] for o in strong.orders.tolist()])
        tones = lines.orders.shape[1]
        pairs: list[tuple[int, int, int]] = []
        for tone in range(tones):
            step = tuple(int(t == tone) for t in range(tones))
            for order, upper in where.items():
                lower = where.get(tuple(o - s for o, s in zip(order, step, strict=True)))
                if lower is not None:
                    pairs.append((upper, lower, tone))
        self._upper = np.array([p[0] for p in pairs])
        self._lower = np.array([p[1] for p in pairs])
        self._pair_weights = np.zeros((len(pairs), tones), dtype=np.complex128)
        for row, (upper, lower, tone) in enumerate(pairs):
            self._pair_weights[row, tone] = lines.amplitudes[upper] * lines.amplitudes[lower]
        self._turns = 1j * lines.orders.T.astype(np.float64)
        self._power = lines.power
        self._information = lines.information
        rows = [lines.amplitudes / lines.power]
        rows += [
            lines.orders[:, t] * lines.amplitudes / self._information[t] for t in range(tones)
        ]
        self._fit = np.stack(rows, axis=-1).astype(np.complex128)
        self._free = len(lines.bins) - 1 - tones / 2

    def _init_offsets(self, max_offset_hz: float, strong: LineSpectrum) -> None:
        """Tables of the offset search: grid, its phasors, and the times of the folds."""
        period, rate_hz = self.signal.period_samples, self.signal.sample_rate_hz
        segment_s = self._fold * period / rate_hz
        if max_offset_hz > 0:
            if self._segments < 2 or max_offset_hz * segment_s > 0.45:
                raise ValueError(
                    f"max_offset_hz must stay below {0.45 * rate_hz / period:g} Hz for periods of"
                    f" {period} samples, at least two of them in samples"
                    f" ({self.signal.samples}), got {max_offset_hz:g}"
                )
            step_hz = 0.5 / self.signal.duration_s
            half = math.ceil(max_offset_hz / step_hz)
            self._grid_hz = step_hz * np.arange(-half - 1, half + 2)
        else:
            self._grid_hz = np.zeros(1)
        self._search = max_offset_hz > 0
        centre = np.arange(self._segments) - (self._segments - 1) / 2
        within = np.arange(period) - (period - 1) / 2
        turn = -2j * math.pi
        self._grid = np.exp(turn * self._grid_hz[:, None] * centre * segment_s)
        self._ramp = turn * np.concatenate([centre * segment_s, within / rate_hz])
        repeat = (np.arange(self._fold) - (self._fold - 1) / 2) * period / rate_hz
        self._repeat_turn = 2 * math.pi * repeat
        # The interpolation formula of `_offsets` for K segments.
        self._arc = math.tan(math.pi / (2 * self._segments))
        self._arc_hz = self._segments / math.pi / self.signal.duration_s

    def estimate(self, bursts: ArrayLike) -> ToneEstimate:
        """Estimate tone phases, offset, amplitude and noise of each burst.

        The result of a burst does not depend, to the last bit, on the others in the batch.

        Parameters
        ----------
        bursts : complex [..., samples]
            Received complex envelopes. Bursts that are zero or not finite count as not
            detected.

        Returns
        -------
        ToneEstimate
        """
        x = np.ascontiguousarray(_as_bursts(self.signal, bursts))
        lead = x.shape[:-1]
        x = x.reshape(-1, self.signal.samples)
        chunk = max(1, _CHUNK_SAMPLES // self.signal.samples)
        with np.errstate(all="ignore"):
            if len(x) <= chunk:
                parts = self._estimate(x)
            else:
                pieces = [self._estimate(x[i : i + chunk]) for i in range(0, len(x), chunk)]
                parts = tuple(np.concatenate(column) for column in zip(*pieces, strict=True))
        phase, variance, *rest = parts
        tones = len(self.signal.tones_hz)
        return ToneEstimate(
            phase.reshape(*lead, tones),
            variance.reshape(*lead, tones),
            *(part.reshape(lead) for part in rest),
        )

    def _estimate(self, x: ComplexArray) -> tuple[NDArray[Any], ...]:
        """Fields of `ToneEstimate` for bursts [batch, samples]."""
        period, segments, fold = self.signal.period_samples, self._segments, self._fold
        folds = self._folded(x)
        plain = folds.reshape(len(x), -1).view(np.float64)
        energy = _row_dot(plain, plain) / fold
        offset_hz = self._offsets(folds) if self._search else np.zeros(len(x))
        lines, gain = self._lines(folds, offset_hz)
        phase, amplitude = self._fit_phases(lines)

        # In units of energy per complex dimension of the folds.
        scale = gain * gain * (segments * period * fold)
        power = (amplitude * amplitude.conj()).real
        parts = lines.view(np.float64)
        on_lines = _row_dot(parts, parts)
        strong = lines.take(self._strong, axis=1).view(np.float64)
        share = _row_dot(strong, strong) * scale / energy
        outside = energy - scale * (on_lines + (1 - self._power) * power)
        noise = np.maximum(outside / (segments * period - len(self._bins)), power / MAX_SNR)
        snr = power / noise
        variance = 0.5 / ((snr * scale)[:, None] * self._information)
        misfit = (on_lines - self._power * power) * scale / (self._free * noise)
        detected = (share > self._threshold) & np.isfinite(energy)
        result = (
            wrap_to_turn(phase),
            variance,
            np.sqrt(power),
            snr,
            offset_hz,
            misfit,
            detected,
        )
        if not detected.all():
            missed = ~detected
            for field, value in zip(
                result[:-1], (np.nan, np.inf, 0.0, 0.0, np.nan, np.nan), strict=True
            ):
                field[missed] = value
        return result

    def _folded(self, x: ComplexArray) -> ComplexArray:
        """Bursts [batch, samples] as sums of whole periods [batch, segments, period]."""
        shape = (len(x), self._segments, self._fold, self.signal.period_samples)
        repeats = x.reshape(shape)
        if self._fold == 1:
            return repeats[:, :, 0]
        total = repeats[:, :, 0] + repeats[:, :, 1]
        for i in range(2, self._fold):
            total += repeats[:, :, i]
        return total

    def _offsets(self, folds: ComplexArray) -> FloatArray:
        """Carrier offset [Hz] of each burst."""
        # Matrix products are stacked, one of fixed shape for each burst, so that their
        # rounding does not depend on the batch.
        lines = (folds.view(np.float64) @ self._strong_basis).view(np.complex128)
        response = self._grid @ lines
        parts = response.view(np.float64)
        peak = _row_dot(parts, parts)[:, 1:-1].argmax(axis=-1) + 1
        row = np.arange(len(folds))
        above, below = response[row, peak + 1], response[row, peak - 1]
        plus, minus = (above + below).view(np.float64), (above - below).view(np.float64)
        quotient = _row_dot(plus, minus) / _row_dot(plus, plus)
        return np.asarray(self._grid_hz[peak] + np.arctan(quotient * self._arc) * self._arc_hz)

    def _lines(
        self, folds: ComplexArray, offset_hz: FloatArray
    ) -> tuple[ComplexArray, FloatArray]:
        """Lines [batch, lines] of a wave without offset, and the gain of the folds."""
        segments, period = self._segments, self.signal.period_samples
        turn = np.exp(offset_hz[:, None] * self._ramp)
        summed = (turn[:, None, :segments] @ folds)[:, 0]
        summed *= turn[:, segments:]
        gain = np.ones(len(folds))
        if self._fold > 1:
            gain = np.cos(offset_hz[:, None] * self._repeat_turn).sum(axis=-1) / self._fold
        if period <= _DIRECT_PERIOD:
            parts = summed.view(np.float64)[:, None] @ self._basis
            lines = parts.view(np.complex128)[:, 0]
        else:
            lines = np.fft.fft(summed).take(self._bins, axis=1) / period
        lines /= (gain * (segments * self._fold))[:, None]
        return lines, gain

    def _fit_phases(self, lines: ComplexArray) -> tuple[FloatArray, ComplexArray]:
        """Tone phases [batch, tones] and complex amplitude [batch] by Gauss-Newton."""
        products = lines.take(self._upper, axis=1) * lines.take(self._lower, axis=1).conj()
        phase = -np.angle(products[:, None] @ self._pair_weights)
        column = lines[:, None]
        for _ in range(2):
            fit = (column * np.exp(phase @ self._turns)) @ self._fit
            amplitude = fit[..., 0]
            phase -= (fit[..., 1:] / fit[..., :1]).imag
        return phase[:, 0], amplitude[:, 0]


def _fold_length(periods: int, cycles_per_period: float) -> int:
    """Periods to add up: a divisor that loses little to the offset and leaves 8 folds."""
    fits = [
        fold
        for fold in range(1, periods + 1)
        if periods % fold == 0
        and fold * cycles_per_period <= _SEGMENT_CYCLES
        and periods // fold >= min(periods, 8)
    ]
    return max(fits, default=1)


def _real_basis(bins: NDArray[np.int64], period: int) -> FloatArray:
    """Matrix from folds to lines, both as interleaved real and imaginary parts.

    Real products are faster here than complex ones, half of whose work is zero.
    """
    turn = 2 * math.pi / period * (np.outer(np.arange(period), bins) % period)
    basis = np.empty((period, 2, len(bins), 2))
    basis[:, 0, :, 0] = basis[:, 1, :, 1] = np.cos(turn) / period
    basis[:, 1, :, 0] = np.sin(turn) / period
    basis[:, 0, :, 1] = -basis[:, 1, :, 0]
    return basis.reshape(2 * period, 2 * len(bins))


def _row_dot(left: FloatArray, right: FloatArray) -> FloatArray:
    """Inner product along the last axis."""
    return np.asarray(np.vecdot(left, right))
