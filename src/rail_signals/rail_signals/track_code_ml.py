"""Maximum-likelihood estimate of a track code's tones from the complex baseband.

A discriminator takes the phase of single samples, noise and all, and so has a threshold.
Here the whole slot is fitted by one wave of constant amplitude whose phase is the model of
`track_code_bound`: carrier phase, carrier offset and every tone. The residual of each
sample is divided by the carrier before it is used, never turned into an angle, so nothing
non-linear happens to the noise until all samples are summed.

1. A start. For small indices: products ``z[k+1] conj(z[k])``, of which the angle of the sum
   is the offset, and what is left, as a sine, is the tones plus noise; a sine has no clicks.
   For large ones, where the nominal deviations must be given: recursive least squares that
   begin in the middle of the slot, or elsewhere, and go outwards (`_Outward`). Every sample
   is taken in when the phase there is predicted by those before, as in a phase-locked loop
   that knows the tones; several beginnings stand in for a search of all phases.
2. Gauss-Newton on the baseband, with the pseudo-inverse of the model's derivatives, which
   depend on the slot only. The covariance of the result is that of
   :func:`rail_signals.track_code_bound.tone_covariance_bound`.
3. Of several results the likeliest, given that each tone is there with its nominal
   deviation or not at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.ranging_signal import ComplexArray, FloatArray
from rail_signals.track_code_bound import phase_basis, tone_sigma_bound

_LEAST_COHERENCE = 0.3
# Rounds of starts: the density [dB Hz] their gains are made for, where in the slot they begin,
# and whether they know nothing or the best so far.
_ROUNDS = (
    (24.0, np.linspace(0.1, 0.9, 9), True),
    (27.0, np.linspace(0.15, 0.85, 8), False),
    (30.0, np.linspace(0.03, 0.97, 13), True),
    (24.0, np.linspace(0.05, 0.95, 11), False),
    (27.0, np.linspace(0.08, 0.92, 15), True),
    (22.0, np.linspace(0.12, 0.88, 9), False),
)
# Misses of the nominal deviations that 27 true tones have, 20 on average, with a margin.
_PLAUSIBLE_COST_PER_TONE = 1.7
_PHASE_PRIOR = 3.0
_OFFSET_HZ = 5.0
_FIRST = 6


@dataclass(frozen=True)
class ToneFit:
    """What was fitted to each slot. Leading axes are those of the slots.

    Attributes
    ----------
    amplitudes_hz : complex [..., tones]
        ``x - j y`` of each tone [Hz of deviation], at the middle of the slot.
    offset_hz : float [...]
        Offset of the carrier [Hz].
    carrier : float [...]
        Amplitude of the carrier, in the unit of the samples.
    coherence : float [...]
        Carrier over root mean square of the samples, 0 to 1: ``sqrt(gamma / (1 + gamma))``
        where the fit is good, near 0 where it has found no carrier.
    """

    amplitudes_hz: ComplexArray
    offset_hz: FloatArray
    carrier: FloatArray
    coherence: FloatArray


class MaximumLikelihoodTones:
    """Efficient estimator of a track code's tones in one slot.

    Parameters
    ----------
    tones_hz : float [tones]
        Frequencies of the tones [Hz], increasing.
    samples
        Complex samples of a slot.
    sample_rate_hz
        Their rate [Hz]: more than the band of the wave, since what is outside is lost.
    deviations_hz : float [tones], optional
        Nominal deviations [Hz] of the tones: searches from several starts. Unless given,
        there is one start, which is enough where the index of the strongest tone is below 1.
    steps
        Gauss-Newton steps.

    Examples
    --------
    >>> fit = MaximumLikelihoodTones([3.0, 10.0], 500, 250.0)
    >>> t = (np.arange(500) - 249.5) / 250.0
    >>> phase = 1.0 + 2 * np.pi * 4.0 * t + 2.0 / 10.0 * np.sin(2 * np.pi * 10.0 * t)
    >>> found = fit.estimate(0.5 * np.exp(1j * phase))
    >>> abs(found.amplitudes_hz).round(6).tolist(), round(float(found.offset_hz), 6)
    ([0.0, 2.0], 4.0)
    """

    def __init__(
        self,
        tones_hz: ArrayLike,
        samples: int,
        sample_rate_hz: float,
        *,
        deviations_hz: ArrayLike | None = None,
        steps: int = 5,
    ) -> None:
        if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 0):
            raise ValueError(f"sample_rate_hz must be positive, got {sample_rate_hz!r}")
        if steps < 1:
            raise ValueError(f"steps must be at least 1, got {steps!r}")
        basis = phase_basis(tones_hz, samples, sample_rate_hz)
        self.tones_hz: FloatArray = np.asarray(tones_hz, dtype=np.float64)
        self.samples = samples
        self.sample_rate_hz = sample_rate_hz
        self._steps = steps
        self.basis: FloatArray = np.ascontiguousarray(basis.T)
        self._inverse = np.ascontiguousarray(np.linalg.pinv(basis).T)
        # The start sees differences of the phase and so knows nothing of theta.
        self._start = np.ascontiguousarray(np.linalg.pinv(np.diff(basis[:, 1:], axis=0)).T)
        self._search: tuple[list[_Outward], ...] = ()
        if deviations_hz is not None:
            self._deviations_hz = np.broadcast_to(
                np.asarray(deviations_hz, dtype=np.float64), self.tones_hz.shape
            )
            prior = np.concatenate(
                [[_PHASE_PRIOR], [(2 * math.pi * _OFFSET_HZ) ** 2], self._prior(), self._prior()]
            )
            self._search = tuple(
                [
                    _Outward(basis, prior, c * (samples - 1), 10 ** (db / 10) / sample_rate_hz)
                    for c in beginnings
                ]
                for db, beginnings, _ in _ROUNDS
            )
            self._variance = tone_sigma_bound(self.tones_hz, 1.0, samples, sample_rate_hz) ** 2

    def estimate(self, baseband: ArrayLike) -> ToneFit:
        """Fit slots of complex baseband.

        Parameters
        ----------
        baseband : complex [..., samples]
            Slots of the carrier, mixed down to within a tenth of the rate of zero.
        """
        return self._result(baseband, None)

    def refine(self, baseband: ArrayLike, start: ArrayLike) -> ToneFit:
        """Fit slots from a start of one's own, as the slot before gives one.

        Parameters
        ----------
        baseband : complex [..., samples]
            As of `estimate`.
        start : float [..., 2 + 2 tones]
            Carrier phase [rad] and offset [rad/s], then the x and the y of the tones [Hz]:
            the coefficients of `basis`.
        """
        return self._result(baseband, np.asarray(start, dtype=np.float64))

    def _result(self, baseband: ArrayLike, start: FloatArray | None) -> ToneFit:
        """Fit from a given start, or from the receiver's own."""
        z = np.asarray(baseband, dtype=np.complex128)
        if z.ndim == 0 or z.shape[-1] != self.samples:
            raise ValueError(f"baseband must have {self.samples} samples, got shape {z.shape}")
        lead = z.shape[:-1]
        z = z.reshape(-1, self.samples)
        size = np.sqrt(np.mean(z.real**2 + z.imag**2, axis=-1))
        z = z / np.where(size > 0, size, 1.0)[:, None]
        if start is not None:
            parameters, carrier = self._fitted(z, start.reshape(len(z), -1))
        elif self._search:
            parameters, carrier = self._searched(z)
        else:
            parameters, carrier = self._fitted(z, self._first(z))
        tones = len(self.tones_hz)
        amplitudes = parameters[:, 2 : 2 + tones] - 1j * parameters[:, 2 + tones :]
        return ToneFit(
            amplitudes.reshape(*lead, tones),
            (parameters[:, 1] / (2 * math.pi)).reshape(lead),
            (carrier * size).reshape(lead),
            carrier.reshape(lead),
        )

    def _prior(self) -> FloatArray:
        """Variance of x_i and of y_i [Hz^2]: half of the tones are there."""
        return self._deviations_hz**2 / 4

    def _fitted(self, z: ComplexArray, start: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gauss-Newton from a start: parameters [slots, 2 + 2 tones], carrier [slots]."""
        parameters = start.copy()
        carrier = np.zeros(len(z))
        for _ in range(self._steps):
            straight = z * _turn(-(parameters @ self.basis))
            carrier = straight.real.mean(axis=-1)
            # A poor start has little in common with the wave: bound the step.
            scale = np.maximum(carrier, _LEAST_COHERENCE)
            parameters += (straight.imag / scale[:, None]) @ self._inverse
        return parameters, carrier

    def _searched(self, z: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """The likeliest of the fits from all starts.

        A slot takes part in a round while its best fit misses the nominal deviations by more
        than noise explains.
        """
        best = np.zeros((len(z), self.basis.shape[0]))
        carrier = np.zeros(len(z))
        score, cost = np.full(len(z), -np.inf), np.full(len(z), np.inf)
        unit = z / self._rough_carrier(z)[:, None]
        for starts, (_, _, fresh) in zip(self._search, _ROUNDS, strict=True):
            open_ = np.flatnonzero(cost > _PLAUSIBLE_COST_PER_TONE * len(self.tones_hz))
            if not open_.size:
                break
            known = np.zeros_like(best[open_]) if fresh else best[open_]
            for outward in starts:
                found, strength = self._fitted(z[open_], outward.run(unit[open_], known))
                likelihood, miss = self._likelihood(found, strength)
                better = likelihood > score[open_]
                slot = open_[better]
                best[slot], carrier[slot] = found[better], strength[better]
                score[slot], cost[slot] = likelihood[better], miss[better]
        return best, carrier

    def _rough_carrier(self, z: ComplexArray) -> FloatArray:
        """Carrier of slots of unit power, by their second and fourth moments.

        A constant envelope in complex noise has ``a^4 = 2 E[|z|^2]^2 - E[|z|^4]``; a scatter
        that makes it less than the search is designed for is cut off.
        """
        fourth = np.mean((z.real**2 + z.imag**2) ** 2, axis=-1)
        snr = 10 ** (_ROUNDS[0][0] / 10) / self.sample_rate_hz
        least = (snr / (1 + snr)) ** 2
        return np.asarray(np.clip(2 - fourth, least, 1.0) ** 0.25)

    def _likelihood(
        self, parameters: FloatArray, carrier: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Logarithm of the likelihood of fits, noise power and carrier being unknown.

        Laplace's approximation, with each tone either absent or of its nominal deviation;
        what that takes away is the second value.
        """
        share = np.clip(carrier, 1e-3, 1 - 1e-9) ** 2
        snr = share / (1 - share)
        tones = len(self.tones_hz)
        level = np.hypot(parameters[:, 2 : 2 + tones], parameters[:, 2 + tones :])
        miss = np.minimum(level, np.abs(level - self._deviations_hz))
        cost = np.sum(miss**2 / self._variance, axis=-1) * snr / 2
        return np.asarray(self.samples * np.log1p(snr) - cost), np.asarray(cost)

    def _first(self, z: ComplexArray) -> NDArray[np.float64]:
        """First parameters [slots, 2 + 2 tones] of slots [slots, samples]."""
        step = z[:, 1:] * z[:, :-1].conj()
        mean = step.sum(axis=-1)
        centre = np.angle(mean)
        step *= _turn(-centre)[:, None]
        slope = step.imag / np.maximum(step.real.mean(axis=-1), 0.1)[:, None]
        first = np.empty((len(z), self.basis.shape[0]))
        first[:, 1:] = slope @ self._start
        first[:, 1] += centre * self.sample_rate_hz
        first[:, 0] = 0.0
        first[:, 0] = np.angle((z * _turn(-(first @ self.basis))).mean(axis=-1))
        return first


class _Outward:
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
        first = _turn(-(self._basis[:_FIRST] @ parameters.T))
        parameters[:, 0] = np.angle(np.sum(samples[:_FIRST] * first, axis=0))
        for sample, row, gain in zip(samples, self._basis, self._gain, strict=True):
            phase = parameters @ row
            ahead = sample.imag * np.cos(phase) - sample.real * np.sin(phase)
            parameters += ahead[:, None] * gain
        return np.asarray(parameters)


def _turn(phase_rad: FloatArray) -> ComplexArray:
    """``exp(j phase)``, formed from its parts."""
    turned = np.empty(phase_rad.shape, dtype=np.complex128)
    turned.real = np.cos(phase_rad)
    turned.imag = np.sin(phase_rad)
    return turned
