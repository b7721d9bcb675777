"""Fit of tone phases, amplitude and noise to the lines of a folded period."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.phasors import cis

from .fm_spectrum import LineSpectrum
from .signal import RangingSignal

_DIRECT_PERIOD = 64
_FEW = 4
_TURN = 2 * math.pi


class LineFit:
    """One Gauss-Newton step on complex amplitude and tone phases.

    It starts from the products of neighbouring lines. The symmetry of the lines makes the
    normal matrix diagonal.

    Parameters
    ----------
    signal
        The signal.
    lines, strong
        Lines to fit, and those of them whose energy tells a signal.
    threshold
        Share of the energy above which the strong lines count as detected.
    """

    def __init__(
        self, signal: RangingSignal, lines: LineSpectrum, strong: LineSpectrum, threshold: float
    ) -> None:
        samples, period = signal.samples, signal.period_samples
        periods = samples // period
        tones = lines.orders.shape[1]
        self._period = period
        self._bins = lines.bins
        self._basis = lines.real_basis(period) / periods
        self._scale = 1 / samples
        self._init_forms(lines, strong)
        self._orders = lines.orders.T.astype(np.float64)
        information = lines.information
        self._variance = (0.5 / (samples * information)).tolist()
        self._curvature = (information / lines.power).tolist()
        rows = [lines.amplitudes / lines.power]
        rows += [lines.orders[:, t] * lines.amplitudes / information[t] for t in range(tones)]
        self._fit = np.stack(rows, axis=-1).astype(np.complex128)
        self._power = lines.power
        self._misfit_scale = samples / (len(lines.bins) - 1 - tones / 2)
        self._threshold = threshold / samples
        self._noise_scale = 1 / (samples - period)
        self._fold_scale = self._noise_scale / periods
        self._missed = [math.nan] * tones + [math.inf] * tones + [0.0, 0.0, math.nan, math.nan]

    def _init_forms(self, lines: LineSpectrum, strong: LineSpectrum) -> None:
        """Tables of the quadratic forms of the lines, as pairs of lines and weights.

        Of neighbours in a tone, the conjugate of the upper line times the lower one has the
        lag of the tone: one form for each. Two more are the energy of all lines and that of
        the strong ones.
        """
        orders = lines.orders.tolist()
        where = {tuple(order): i for i, order in enumerate(orders)}
        tones = len(orders[0])
        self._partner = np.tile(np.arange(len(orders)), (tones + 2, 1))
        self._weight = np.zeros(self._partner.shape)
        for upper, order in enumerate(orders):
            for tone in range(tones):
                lower = where.get((*order[:tone], order[tone] - 1, *order[tone + 1 :]))
                if lower is not None:
                    self._partner[tone, upper] = lower
                    self._weight[tone, upper] = lines.amplitudes[upper] * lines.amplitudes[lower]
        self._weight[-2] = 1.0
        self._weight[-1] = np.isin(lines.bins, strong.bins)

    def evaluate(
        self, energy: NDArray[Any], offset_hz: FloatArray, folded: ComplexArray, max_snr: float
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Fields of `ToneEstimate` of each burst.

        Parameters
        ----------
        energy, offset_hz : float [batch]
            Energy of the burst and its offset [Hz].
        folded : complex [batch, 1, period]
            Sum of its periods without the offset.
        max_snr
            Ceiling of the carrier-to-noise ratio.

        Returns
        -------
        table : float [batch, columns]
            All fields but the last side by side.
        detected : bool [batch]
            The last.
        """
        lines = self._lines(folded)
        products = lines[:, 0].take(self._partner, axis=1)
        products *= self._weight
        forms = np.vecdot(lines, products)
        phase = np.arctan2(forms.imag, forms.real)[:, :-2]
        fit = (lines * cis(phase[:, None] @ self._orders)) @ self._fit
        parts = folded.view(np.float64)
        columns = (
            energy.astype(np.float64, copy=False),
            offset_hz,
            np.vecdot(parts, parts)[:, 0],
            forms.real,
            phase,
            fit.view(np.float64)[:, 0],
        )
        if len(lines) > _FEW:
            *fields, detected = self._figures(
                max_snr, np.maximum, np.sqrt, *(column.T for column in columns)
            )
            table = np.stack(fields, axis=-1)
            table[~detected] = self._missed
            return table, detected
        # Arithmetic with Python's numbers has the same roundings, and less overhead.
        found = []
        for row in zip(*(column.tolist() for column in columns), strict=True):
            try:
                *figures, seen = self._figures(max_snr, max, math.sqrt, *row)
            except (ZeroDivisionError, ValueError):
                seen = False
            found.append((figures if seen else self._missed, seen))
        table = np.array([figures for figures, _ in found])
        return table, np.array([seen for _, seen in found], dtype=np.bool_)

    def _figures(
        self,
        max_snr: float,
        maximum: Callable[[Any, Any], Any],
        sqrt: Callable[[Any], Any],
        energy: Any,
        offset_hz: Any,
        folded_energy: Any,
        forms: Any,
        phases: Any,
        fit: Any,
    ) -> list[Any]:
        """Fields of `ToneEstimate` in their order; of one burst or as arrays of many."""
        amplitude_re, amplitude_im = fit[:2]
        power = square = amplitude_re * amplitude_re + amplitude_im * amplitude_im
        phase_lag_rad = []
        for phase, re, im, curvature in zip(
            phases, fit[2::2], fit[3::2], self._curvature, strict=True
        ):
            slope = im * amplitude_re - re * amplitude_im
            step = slope / square
            # Twice: the remainder of a tiny negative phase rounds to a full turn.
            phase_lag_rad.append((phase - step) % _TURN % _TURN)
            # The step adds to what the fit explains, to second order.
            power = power + slope * step * curvature
        # Every line is in the folded period, so the energy outside it is noise.
        outside = energy * self._noise_scale - folded_energy * self._fold_scale
        noise = maximum(outside, power / max_snr)
        snr = power / noise
        return [
            *phase_lag_rad,
            *(variance / snr for variance in self._variance),
            sqrt(power),
            snr,
            offset_hz,
            (forms[-2] - power * self._power) * self._misfit_scale / noise,
            forms[-1] > energy * self._threshold,
        ]

    def _lines(self, folded: ComplexArray) -> ComplexArray:
        """Lines [batch, 1, lines] of the folded period [batch, 1, period]."""
        if self._period <= _DIRECT_PERIOD:
            return (folded.view(np.float64) @ self._basis).view(np.complex128)
        lines = np.fft.fft(folded).take(self._bins, axis=2)
        lines *= self._scale
        return lines
