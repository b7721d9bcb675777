"""Fit of tone phases, amplitude and noise to the components of a folded period."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.phasors import cis

from .fm_spectrum import FmSpectrum
from .signal import RangingSignal

_DIRECT_PERIOD = 64
_FEW = 4
_TURN = 2 * math.pi


class TonePhaseFit:
    """One Gauss-Newton step on complex amplitude and tone phases.

    It starts from the products of neighbouring components. The symmetry of the components makes the
    normal matrix diagonal.

    Parameters
    ----------
    signal
        The signal.
    components, strong
        Components to fit, and those of them whose energy tells a signal.
    threshold
        Fraction of the energy above which the strong components count as detected.
    """

    def __init__(
        self, signal: RangingSignal, components: FmSpectrum, strong: FmSpectrum, threshold: float
    ) -> None:
        samples, period = signal.samples, signal.period_samples
        periods = samples // period
        tones = components.orders.shape[1]
        self._period = period
        self._bins = components.bins
        self._basis = components.real_basis(period) / periods
        self._scale = 1 / samples
        self._init_forms(components, strong)
        self._orders = components.orders.T.astype(np.float64)
        information = components.information
        self._variance = (0.5 / (samples * information)).tolist()
        self._curvature = (information / components.power).tolist()
        rows = [components.amplitudes / components.power]
        rows += [
            components.orders[:, t] * components.amplitudes / information[t] for t in range(tones)
        ]
        self._fit = np.stack(rows, axis=-1).astype(np.complex128)
        self._power = components.power
        self._chi_square_scale = samples / (len(components.bins) - 1 - tones / 2)
        self._threshold = threshold / samples
        self._noise_scale = 1 / (samples - period)
        self._fold_scale = self._noise_scale / periods
        self._missed = [math.nan] * tones + [math.inf] * tones + [0.0, 0.0, math.nan, math.nan]

    def _init_forms(self, components: FmSpectrum, strong: FmSpectrum) -> None:
        """Tables of the quadratic forms of the components, as pairs of components and weights.

        Of neighbours in a tone, the conjugate of the upper component times the lower one has the
        lag of the tone: one form for each. Two more are the energy of all components and that of
        the strong ones.
        """
        orders = components.orders.tolist()
        where = {tuple(order): i for i, order in enumerate(orders)}
        tones = len(orders[0])
        self._partner = np.tile(np.arange(len(orders)), (tones + 2, 1))
        self._weight = np.zeros(self._partner.shape)
        for upper, order in enumerate(orders):
            for tone in range(tones):
                lower = where.get((*order[:tone], order[tone] - 1, *order[tone + 1 :]))
                if lower is not None:
                    self._partner[tone, upper] = lower
                    self._weight[tone, upper] = (
                        components.amplitudes[upper] * components.amplitudes[lower]
                    )
        self._weight[-2] = 1.0
        self._weight[-1] = np.isin(components.bins, strong.bins)

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
        components = self._components(folded)
        products = components[:, 0].take(self._partner, axis=1)
        products *= self._weight
        forms = np.vecdot(components, products)
        phase = np.arctan2(forms.imag, forms.real)[:, :-2]
        fit = (components * cis(phase[:, None] @ self._orders)) @ self._fit
        parts = folded.view(np.float64)
        columns = (
            energy.astype(np.float64, copy=False),
            offset_hz,
            np.vecdot(parts, parts)[:, 0],
            forms.real,
            phase,
            fit.view(np.float64)[:, 0],
        )
        if len(components) > _FEW:
            *fields, detected = self._estimates(
                max_snr, np.maximum, np.sqrt, *(column.T for column in columns)
            )
            table = np.stack(fields, axis=-1)
            table[~detected] = self._missed
            return table, detected
        # Arithmetic with Python's numbers has the same roundings, and less overhead.
        estimates = []
        for row in zip(*(column.tolist() for column in columns), strict=True):
            try:
                *values, seen = self._estimates(max_snr, max, math.sqrt, *row)
            except (ZeroDivisionError, ValueError):
                seen = False
            estimates.append((values if seen else self._missed, seen))
        table = np.array([values for values, _ in estimates])
        return table, np.array([seen for _, seen in estimates], dtype=np.bool_)

    def _estimates(
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
        # Every component is in the folded period, so the energy outside it is noise.
        outside = energy * self._noise_scale - folded_energy * self._fold_scale
        noise = maximum(outside, power / max_snr)
        snr = power / noise
        return [
            *phase_lag_rad,
            *(variance / snr for variance in self._variance),
            sqrt(power),
            snr,
            offset_hz,
            (forms[-2] - power * self._power) * self._chi_square_scale / noise,
            forms[-1] > energy * self._threshold,
        ]

    def _components(self, folded: ComplexArray) -> ComplexArray:
        """Components [batch, 1, components] of the folded period [batch, 1, period]."""
        if self._period <= _DIRECT_PERIOD:
            return (folded.view(np.float64) @ self._basis).view(np.complex128)
        components = np.fft.fft(folded).take(self._bins, axis=2)
        components *= self._scale
        return components
