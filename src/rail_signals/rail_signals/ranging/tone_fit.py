"""Tables of the fit of tone phases, amplitude and noise to the components of a folded period."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray

from .fm_spectrum import FmSpectrum
from .signal import RangingSignal


class TonePhaseFit:
    """Tables of one Gauss-Newton step on complex amplitude and tone phases (`burst_kernel`).

    It starts from the products of neighbouring components: of neighbours in a tone, the conjugate
    of the upper component times the lower one has the lag of the tone. The symmetry of the
    components makes the normal matrix diagonal.

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
        self.basis: FloatArray = components.real_basis(period).T / periods
        """From a folded period to its components: [2 components, 2 period]."""
        self.orders: NDArray[np.int64] = components.orders.astype(np.int64)
        """Orders [components, tones]."""
        information, amplitudes = components.information, components.amplitudes
        self.weights = np.column_stack(
            [
                amplitudes / components.power,
                components.orders * amplitudes[:, None] / information,
                np.isin(components.bins, strong.bins),
            ]
        )
        """Weights of amplitude and steps, and which are strong: [components, tones + 2]."""
        self.pairs, self.pair_weights = _neighbours(components)
        """Tone, upper and lower component [pairs, 3], and the weights of their products."""
        noise_scale = 1 / (samples - period)
        self._scales = [
            noise_scale,
            noise_scale / periods,
            components.power,
            samples / (len(components.bins) - 1 - tones / 2),
            threshold / samples,
            float(np.abs(self.orders).max()),
            *(0.5 / (samples * information)),
            *(information / components.power),
        ]

    def numbers(self, max_snr: float) -> FloatArray:
        """Scales of the estimates under a ceiling of the carrier-to-noise ratio."""
        return np.array([max_snr, *self._scales])


def _neighbours(components: FmSpectrum) -> tuple[NDArray[np.int64], FloatArray]:
    """Pairs of components that differ by one order of one tone, and products of amplitudes."""
    orders = components.orders.tolist()
    where = {tuple(order): i for i, order in enumerate(orders)}
    pairs = []
    for upper, order in enumerate(orders):
        for tone in range(len(order)):
            lower = where.get((*order[:tone], order[tone] - 1, *order[tone + 1 :]))
            if lower is not None:
                pairs.append((tone, upper, lower))
    table = np.array(pairs, dtype=np.int64)
    return table, components.amplitudes[table[:, 1]] * components.amplitudes[table[:, 2]]
