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
from rail_signals.offset_search import Bursts, OffsetSearch, row_dot
from rail_signals.ranging_signal import (
    ComplexArray,
    FloatArray,
    RangingSignal,
)

MAX_SNR = 1e9
"""Ceiling of the estimated carrier-to-noise ratio (90 dB), where aliased and overlapping
lines of the order of 1e-9 of the power begin to matter."""

MAX_SNR_SINGLE = 1e6
"""The same for bursts in single precision (60 dB), where rounding begins to matter."""

_STRONG_SHARE = 0.92
_DIRECT_PERIOD = 64
_CHUNK_BYTES = 3 << 19


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

    1. Offset: the strong lines of short segments, correlated with a grid of frequencies
       half a cycle per burst apart; the largest sum of squares is interpolated
       (Aboutanios and Mulgrew, IEEE Trans. Signal Processing 53(4), 2005, with all lines
       in one quotient).
    2. Fold: the burst is turned back by the offset, about its middle, where the phases of
       carrier and tones do not depend on the offset's error, and its periods are added.
       The transform of the sum holds every line; what is left of the energy is noise.
    3. Phases: products of neighbouring lines start a Gauss-Newton step on complex
       amplitude and tone phases; the symmetry of the lines makes the normal matrix
       diagonal. A second step would change the error by less than 0.1 % where a burst is
       detected with a margin of 3 dB.

    Parameters
    ----------
    signal
        The signal to receive.
    max_offset_hz
        Largest carrier offset to expect [Hz]; 0 if the carrier is exact.
    false_alarm
        Probability that noise alone counts as detected, per burst.

    Raises
    ------
    ValueError
        If a parameter is out of range for the signal; the message quotes it.

    Examples
    --------
    >>> from rail_signals.ranging_signal import modulate
    >>> receiver = LineReceiver(RangingSignal())
    >>> found = receiver.estimate(modulate(RangingSignal(), [[0.5], [4.0]]))
    >>> found.phase_lag_rad.ravel().round(9).tolist(), found.detected.tolist()
    ([0.5, 4.0], [True, True])
    """

    def __init__(
        self, signal: RangingSignal, *, max_offset_hz: float = 5e3, false_alarm: float = 1e-6
    ) -> None:
        if not (math.isfinite(max_offset_hz) and max_offset_hz >= 0):
            raise ValueError(
                f"max_offset_hz must be finite and not negative, got {max_offset_hz!r}"
            )
        self.signal = signal
        self._period = signal.period_samples
        self._periods = signal.samples // self._period
        if self._periods < 2:
            raise ValueError(
                f"samples must hold two periods of {self._period} or more, got {signal.samples}"
            )
        self._ones = np.ones((1, self._periods), dtype=np.complex128)
        lines = line_spectrum(signal)
        strong = lines.strongest(_STRONG_SHARE)
        self._init_lines(lines, strong)
        self._search = OffsetSearch(signal, strong, max_offset_hz) if max_offset_hz > 0 else None
        search_hz = self._search.width_hz if self._search else 0.0
        self._threshold = detection_share(
            false_alarm, len(strong.bins), signal.samples, search_hz, signal.duration_s
        )

    def _init_lines(self, lines: LineSpectrum, strong: LineSpectrum) -> None:
        """Tables of the line fit: basis, products of neighbours, Gauss-Newton rows."""
        self._bins = lines.bins
        self._basis = lines.real_basis(self._period)
        where = {tuple(order): i for i, order in enumerate(lines.orders.tolist())}
        tones = lines.orders.shape[1]
        pairs: list[tuple[int, int, int]] = []
        for tone in range(tones):
            for order, upper in where.items():
                lower = where.get((*order[:tone], order[tone] - 1, *order[tone + 1 :]))
                if lower is not None:
                    pairs.append((upper, lower, tone))
        self._upper = np.array([pair[0] for pair in pairs])
        self._lower = np.array([pair[1] for pair in pairs])
        self._pair_weights = np.zeros((len(pairs), tones), dtype=np.complex128)
        for row, (upper, lower, tone) in enumerate(pairs):
            self._pair_weights[row, tone] = lines.amplitudes[upper] * lines.amplitudes[lower]
        self._turns = 1j * lines.orders.T.astype(np.float64)
        self._power = lines.power
        information = lines.information
        self._variance = 0.5 / (self.signal.samples * information)
        self._curvature = information / lines.power
        rows = [lines.amplitudes / lines.power]
        rows += [lines.orders[:, t] * lines.amplitudes / information[t] for t in range(tones)]
        self._fit = np.stack(rows, axis=-1).astype(np.complex128)
        self._free = len(lines.bins) - 1 - tones / 2
        strong_orders = {tuple(order) for order in strong.orders.tolist()}
        is_strong = [float(order in strong_orders) for order in where]
        self._sums = np.repeat(np.stack([np.ones(len(where)), is_strong], axis=-1), 2, axis=0)

    def estimate(self, bursts: ArrayLike) -> ToneEstimate:
        """Estimate tone phases, offset, amplitude and noise of each burst.

        The result of a burst does not depend, to the last bit, on the others in the batch.

        Parameters
        ----------
        bursts : complex [..., samples]
            Received complex envelopes. Bursts that are zero or not finite count as not
            detected. Sums over a burst in single precision (complex64) are formed in single
            precision, twice as fast; all that follows is in double precision.

        Returns
        -------
        ToneEstimate
        """
        x = np.asarray(bursts)
        if x.dtype != np.complex64:
            x = np.asarray(x, dtype=np.complex128)
        samples = self.signal.samples
        if x.ndim == 0 or x.shape[-1] != samples:
            raise ValueError(f"bursts must have {samples} samples, got shape {x.shape}")
        lead = x.shape[:-1]
        x = np.ascontiguousarray(x).reshape(-1, samples)
        # Pieces that stay in the processor's cache.
        chunk = max(1, _CHUNK_BYTES // (samples * x.itemsize))
        with np.errstate(all="ignore"):
            if len(x) <= chunk:
                energy, offset_hz, folded = self._sum_bursts(x)
            else:
                pieces = [self._sum_bursts(x[i : i + chunk]) for i in range(0, len(x), chunk)]
                energy, offset_hz, folded = (
                    np.concatenate(column) for column in zip(*pieces, strict=True)
                )
            max_snr = MAX_SNR_SINGLE if x.dtype == np.complex64 else MAX_SNR
            phase, variance, *rest = self._evaluate(energy, offset_hz, folded, max_snr)
        tones = len(self.signal.tones_hz)
        return ToneEstimate(
            phase.reshape(*lead, tones),
            variance.reshape(*lead, tones),
            *(part.reshape(lead) for part in rest),
        )

    def _sum_bursts(self, x: Bursts) -> tuple[Any, ...]:
        """Energy, carrier offset [batch] and folded period [batch, period] of bursts."""
        parts = x.view(np.float32 if x.dtype == np.complex64 else np.float64)
        energy = row_dot(parts, parts)
        if self._search:
            offset_hz = self._search.offset_hz(x)
            return energy, offset_hz, self._search.fold(x, offset_hz)
        periods = x.reshape(len(x), self._periods, self._period)
        folded = np.matmul(self._ones.astype(x.dtype), periods)[:, 0]
        return energy, np.zeros(len(x)), folded.astype(np.complex128)

    def _evaluate(
        self, energy: FloatArray, offset_hz: FloatArray, folded: ComplexArray, max_snr: float
    ) -> tuple[NDArray[Any], ...]:
        """Fields of `ToneEstimate` from what `_sum_bursts` returns."""
        samples, period = self.signal.samples, self._period
        lines = self._lines(folded)
        phase, power = self._fit_phases(lines)

        parts = folded.view(np.float64)
        # Every line is in the folded period, so the energy outside it is noise.
        outside = energy - row_dot(parts, parts) / self._periods
        noise = np.maximum(outside / (samples - period), power / max_snr)
        snr = power / noise
        variance = self._variance / snr[:, None]
        parts = lines.view(np.float64)
        sums = ((parts * parts)[:, None] @ self._sums)[:, 0]
        misfit = (sums[:, 0] - self._power * power) * (samples / self._free) / noise
        detected = sums[:, 1] * samples > self._threshold * energy
        # Twice: the remainder of a tiny negative phase rounds to a full turn.
        phase %= 2 * math.pi
        phase %= 2 * math.pi
        result = (phase, variance, np.sqrt(power), snr, offset_hz, misfit, detected)
        if np.count_nonzero(detected) < len(detected):
            for field, value in zip(result, _MISSED, strict=False):
                field[~detected] = value
        return result

    def _lines(self, folded: ComplexArray) -> ComplexArray:
        """Lines [batch, lines] of the folded period [batch, period]."""
        if self._period <= _DIRECT_PERIOD:
            parts = folded.view(np.float64)[:, None] @ self._basis
            lines = parts.view(np.complex128)[:, 0]
        else:
            lines = np.fft.fft(folded).take(self._bins, axis=1)
            lines *= 1 / self._period
        lines *= 1 / self._periods
        return lines

    def _fit_phases(self, lines: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Tone phases [batch, tones] and carrier power [batch] by a Gauss-Newton step."""
        products = lines.conj().take(self._upper, axis=1)
        products *= lines.take(self._lower, axis=1)
        start = products[:, None] @ self._pair_weights
        phase = np.arctan2(start.imag, start.real)
        fit = (lines[:, None] * np.exp(phase @ self._turns)) @ self._fit
        step = (fit[..., 1:] / fit[..., :1]).imag
        phase -= step
        amplitude = np.abs(fit[:, 0, 0])
        # The step adds to what the fit explains, to second order.
        gain = 1 + row_dot(step * step, self._curvature)[:, 0]
        return phase[:, 0], amplitude * amplitude * gain


_MISSED = (np.nan, np.inf, 0.0, 0.0, np.nan, np.nan)
"""Fields of `ToneEstimate`, up to `misfit`, of a burst in which nothing was found."""
