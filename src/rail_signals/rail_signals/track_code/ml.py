"""Maximum-likelihood estimate of a track code's tones from the complex baseband.

A discriminator takes the phase of single samples, noise and all, and so has a threshold.
Here the whole slot is fitted by one wave of constant amplitude whose phase is the model of
`rail_signals.track_code.bound`: carrier phase, carrier offset and every tone. The residual of each
sample is divided by the carrier before it is used, never turned into an angle, so nothing
non-linear happens to the noise until all samples are summed.

1. A start. For small indices: products ``z[k+1] conj(z[k])``, of which the angle of the sum
   is the offset, and what is left, as a sine, is the tones plus noise; a sine has no clicks.
   For large ones, where the nominal deviations must be given: recursive least squares that
   begin in the middle of the slot, or elsewhere, and go outwards
   (`rail_signals.track_code.ml_start`). Every sample is taken in when the phase there is predicted
   by those before, as in a phase-locked loop that knows the tones; several beginnings stand in for
   a search of all phases.
2. Gauss-Newton on the baseband, with the pseudo-inverse of the model's derivatives, which
   depend on the slot only. The covariance of the result is that of
   :func:`rail_signals.track_code.bound.tone_covariance_bound`.
3. Of several results the likeliest, given that each tone is there with its nominal
   deviation or not at all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray

from .bound import phase_basis, tone_sigma_bound
from .ml_start import ROUNDS, Outward, turned

_LEAST_COHERENCE = 0.3
# Misses of the nominal deviations that 27 true tones have, 20 on average, with a margin.
_PLAUSIBLE_COST_PER_TONE = 1.7
_PHASE_PRIOR = 3.0
_OFFSET_HZ = 5.0


@dataclass(frozen=True)
class SlotToneFit:
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
    plausible : bool [...]
        Whether the tones miss the nominal deviations, or 0, by no more than noise explains;
        True where there are no nominal ones.
    """

    amplitudes_hz: ComplexArray
    offset_hz: FloatArray
    carrier: FloatArray
    coherence: FloatArray
    plausible: BoolArray


@dataclass(frozen=True)
class SlotFit:
    """Fits as the search compares them, one per slot.

    Attributes
    ----------
    parameters : float [slots, 2 + 2 tones]
        Coefficients of the basis: carrier phase [rad], offset [rad/s], x and y of the tones [Hz].
    carrier : float [slots]
        Amplitude of the carrier in samples of unit power.
    likelihood : float [slots]
        Its logarithm, but for a constant.
    plausible : bool [slots]
        Whether the tones miss nominal deviations by no more than noise explains.
    """

    parameters: FloatArray
    carrier: FloatArray
    likelihood: FloatArray
    plausible: BoolArray

    def likelier(self, other: SlotFit) -> SlotFit:
        """Of two fits of the same slots, the likelier for each."""
        return self.with_likelier(np.arange(len(self.carrier)), other)

    def with_likelier(self, slots: NDArray[np.intp], other: SlotFit) -> SlotFit:
        """Replace those of the `slots` that are likelier in `other` [len(slots)]."""
        better = other.likelihood > self.likelihood[slots]
        into = slots[better]
        merged = SlotFit(
            self.parameters.copy(),
            self.carrier.copy(),
            self.likelihood.copy(),
            self.plausible.copy(),
        )
        merged.parameters[into] = other.parameters[better]
        merged.carrier[into] = other.carrier[better]
        merged.likelihood[into] = other.likelihood[better]
        merged.plausible[into] = other.plausible[better]
        return merged


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
        self._search: tuple[list[Outward], ...] = ()
        self.deviations_hz: FloatArray | None = None
        if deviations_hz is not None:
            nominal = np.asarray(deviations_hz, dtype=np.float64)
            self.deviations_hz = np.broadcast_to(nominal, self.tones_hz.shape)
            # Variance of x_i and of y_i [Hz^2]: half of the tones are there.
            variance = self.deviations_hz**2 / 4
            offset = (2 * math.pi * _OFFSET_HZ) ** 2
            prior = np.concatenate([[_PHASE_PRIOR], [offset], variance, variance])
            self._search = tuple(
                [
                    Outward(basis, prior, c * (samples - 1), 10 ** (db / 10) / sample_rate_hz)
                    for c in beginnings
                ]
                for db, beginnings, _ in ROUNDS
            )
            self._variance = tone_sigma_bound(self.tones_hz, 1.0, samples, sample_rate_hz) ** 2

    def estimate(self, baseband: ArrayLike) -> SlotToneFit:
        """Fit slots of complex baseband.

        Parameters
        ----------
        baseband : complex [..., samples]
            Slots of the carrier, mixed down to within a tenth of the rate of zero.
        """
        return self._result(baseband, None)

    def refine(self, baseband: ArrayLike, start: ArrayLike) -> SlotToneFit:
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

    def _result(self, baseband: ArrayLike, start: FloatArray | None) -> SlotToneFit:
        """Fit from a given start, or from the receiver's own."""
        z, size = self.scaled(baseband)
        lead = z.shape[:-1]
        z = z.reshape(-1, self.samples)
        if start is not None:
            fitted = self.fitted(z, start.reshape(len(z), -1))
        elif self._search:
            fitted = self.search(z)
        else:
            fitted = self.fitted(z, self._first(z))
        return self.result(fitted, size.reshape(lead))

    def scaled(self, baseband: ArrayLike) -> tuple[ComplexArray, FloatArray]:
        """Slots [..., samples] brought to unit power, and what they had [...], as root.

        Raises
        ------
        ValueError
            If there is another number of samples.
        """
        z = np.asarray(baseband, dtype=np.complex128)
        if z.ndim == 0 or z.shape[-1] != self.samples:
            raise ValueError(f"baseband must have {self.samples} samples, got shape {z.shape}")
        size = np.sqrt(np.mean(z.real**2 + z.imag**2, axis=-1))
        return z / np.where(size > 0, size, 1.0)[..., None], size

    def result(self, fitted: SlotFit, size: FloatArray) -> SlotToneFit:
        """Fits as tones, for slots [...] of root-mean-square `size`."""
        lead, tones = size.shape, len(self.tones_hz)
        parameters, carrier = fitted.parameters, fitted.carrier.reshape(lead)
        amplitudes = parameters[:, 2 : 2 + tones] - 1j * parameters[:, 2 + tones :]
        return SlotToneFit(
            amplitudes.reshape(*lead, tones),
            (parameters[:, 1] / (2 * math.pi)).reshape(lead),
            carrier * size,
            carrier,
            fitted.plausible.reshape(lead),
        )

    def fitted(self, z: ComplexArray, start: FloatArray) -> SlotFit:
        """Gauss-Newton on slots [slots, samples] of unit power from starts [slots, 2 + 2 tones]."""
        parameters = start.copy()
        carrier = np.zeros(len(z))
        for _ in range(self._steps):
            straight = z * turned(-(parameters @ self.basis))
            carrier = straight.real.mean(axis=-1)
            # A poor start has little in common with the wave: bound the step.
            scale = np.maximum(carrier, _LEAST_COHERENCE)
            parameters += (straight.imag / scale[:, None]) @ self._inverse
        return SlotFit(parameters, carrier, *self._likelihood(parameters, carrier))

    def search(self, z: ComplexArray) -> SlotFit:
        """The likeliest of the fits of slots [slots, samples] of unit power from all starts.

        A slot takes part in a round while its best fit is not plausible.
        """
        best: SlotFit | None = None
        unit = z / self._rough_carrier(z)[:, None]
        for starts, (_, _, fresh) in zip(self._search, ROUNDS, strict=True):
            open_ = np.arange(len(z)) if best is None else np.flatnonzero(~best.plausible)
            if not open_.size:
                break
            known = np.zeros((open_.size, self.basis.shape[0]))
            if best is not None and not fresh:
                known = best.parameters[open_]
            for outward in starts:
                fitted = self.fitted(z[open_], outward.run(unit[open_], known))
                best = fitted if best is None else best.with_likelier(open_, fitted)
        assert best is not None
        return best

    def _rough_carrier(self, z: ComplexArray) -> FloatArray:
        """Carrier of slots of unit power, by their second and fourth moments.

        A constant envelope in complex noise has ``a^4 = 2 E[|z|^2]^2 - E[|z|^4]``; a scatter
        that makes it less than the search is designed for is cut off.
        """
        fourth = np.mean((z.real**2 + z.imag**2) ** 2, axis=-1)
        snr = 10 ** (ROUNDS[0][0] / 10) / self.sample_rate_hz
        least = (snr / (1 + snr)) ** 2
        return np.asarray(np.clip(2 - fourth, least, 1.0) ** 0.25)

    def _likelihood(
        self, parameters: FloatArray, carrier: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Logarithm of the likelihood of fits, noise power and carrier being unknown.

        Laplace's approximation, with each tone either absent or of its nominal deviation, if
        that is known; whether what this takes away is plausible is the second value.
        """
        fraction = np.clip(carrier, 1e-3, 1 - 1e-9) ** 2
        snr = fraction / (1 - fraction)
        likelihood = self.samples * np.log1p(snr)
        if self.deviations_hz is None:
            return np.asarray(likelihood), np.ones(carrier.shape, dtype=np.bool_)
        tones = len(self.tones_hz)
        level = np.hypot(parameters[:, 2 : 2 + tones], parameters[:, 2 + tones :])
        miss = np.minimum(level, np.abs(level - self.deviations_hz))
        cost = np.sum(miss**2 / self._variance, axis=-1) * snr / 2
        plausible = cost <= _PLAUSIBLE_COST_PER_TONE * tones
        return np.asarray(likelihood - cost), np.asarray(plausible)

    def _first(self, z: ComplexArray) -> NDArray[np.float64]:
        """First parameters [slots, 2 + 2 tones] of slots [slots, samples]."""
        step = z[:, 1:] * z[:, :-1].conj()
        mean = step.sum(axis=-1)
        centre = np.angle(mean)
        step *= turned(-centre)[:, None]
        slope = step.imag / np.maximum(step.real.mean(axis=-1), 0.1)[:, None]
        first = np.empty((len(z), self.basis.shape[0]))
        first[:, 1:] = slope @ self._start
        first[:, 1] += centre * self.sample_rate_hz
        first[:, 0] = 0.0
        first[:, 0] = np.angle((z * turned(-(first @ self.basis))).mean(axis=-1))
        return first
