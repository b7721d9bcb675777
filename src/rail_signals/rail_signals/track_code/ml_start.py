"""Where a maximum-likelihood fit of a track code begins that knows nothing yet.

See `rail_signals.track_code.ml`: of many starts, the one that followed the phase of the wave wins.
"""

from __future__ import annotations

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray

# Rounds of starts: the density [dB Hz] their gains are made for, where in the slot they begin,
# and whether they know nothing or the best so far.
ROUNDS = (
    (24.0, np.linspace(0.1, 0.9, 9), True),
    (27.0, np.linspace(0.15, 0.85, 8), False),
    (30.0, np.linspace(0.03, 0.97, 13), True),
    (24.0, np.linspace(0.05, 0.95, 11), False),
    (27.0, np.linspace(0.08, 0.92, 15), True),
    (22.0, np.linspace(0.12, 0.88, 9), False),
)
_FIRST = 6


class Outward:
    """Recursive least squares of the phase from one sample of the slot outwards.

    The gains do not depend on the samples: `snr` and the prior determine them.

    Parameters
    ----------
    basis : float [samples, parameters]
        Derivatives of the phase.
    prior : float [parameters]
        Variances of the parameters before the first sample.
    centre
        Where to begin [samples].
    snr
        Carrier-to-noise ratio per sample to design for (linear).
    """

    def __init__(self, basis: FloatArray, prior: FloatArray, centre: float, snr: float) -> None:
        self._order = np.argsort(np.abs(np.arange(len(basis)) - centre), kind="stable")
        self._basis = basis[self._order]
        self._gain = np.empty_like(basis)
        covariance = np.diag(prior)
        for k, row in enumerate(self._basis):
            gain = covariance @ row
            power = float(row @ gain) + 1 / (2 * snr)
            covariance -= np.outer(gain, gain) / power
            self._gain[k] = gain / power

    def run(self, z: ComplexArray, known: FloatArray) -> FloatArray:
        """Parameters [slots, parameters] of slots [slots, samples], from a first guess."""
        parameters = known.copy()
        samples = np.ascontiguousarray(z[:, self._order].T)
        parameters[:, 0] = 0.0
        first = turned(-(self._basis[:_FIRST] @ parameters.T))
        parameters[:, 0] = np.angle(np.sum(samples[:_FIRST] * first, axis=0))
        for sample, row, gain in zip(samples, self._basis, self._gain, strict=True):
            phase = parameters @ row
            ahead = sample.imag * np.cos(phase) - sample.real * np.sin(phase)
            parameters += ahead[:, None] * gain
        return np.asarray(parameters)


def turned(phase_rad: FloatArray) -> ComplexArray:
    """``exp(j phase)``, formed from its parts."""
    turned = np.empty(phase_rad.shape, dtype=np.complex128)
    turned.real = np.cos(phase_rad)
    turned.imag = np.sin(phase_rad)
    return turned
