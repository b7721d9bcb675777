"""Receiver that fits carrier and spectral components of an FM ranging signal.

A discriminator forms the phase of each noisy sample and so has a threshold near 10 dB.
The components of the wave (`fm_spectrum`) carry the same phase information and can be
summed over the burst before anything non-linear happens: the estimate stays at the
bound ``1 / (gamma N beta^2)`` tens of decibels lower.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import FloatArray

from .burst_kernel import SEARCH_NUMBERS, estimate_bursts
from .burst_sums import burst_energies
from .detector import detection_threshold
from .fm_spectrum import fm_spectrum
from .offset_search import OffsetSearch, RealArray
from .signal import RangingSignal
from .tone_fit import TonePhaseFit

MAX_SNR = 1e9
"""Ceiling of the estimated carrier-to-noise ratio (90 dB), where aliased and overlapping
components of the order of 1e-9 of the power begin to matter."""

MAX_SNR_SINGLE = 1e6
"""The same for bursts in single precision (60 dB), where rounding begins to matter."""

_STRONG_FRACTION = 0.92
_CHUNK_BYTES = 3 << 18


class ToneEstimate(NamedTuple):
    """What a receiver found in each burst. Leading axes are those of the bursts.

    Where nothing was detected, phases, offset and reduced chi-square are NaN, the variance is
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
    reduced_chi_square : float [...]
        Chi-square per degree of freedom of what the fit leaves on the components, in terms of
        the noise between them. About 1 for one FM signal in white noise; large where a
        second signal or a jammer lies on the components.
    detected : bool [...]
        Whether the components hold more energy than noise would put there.
    """

    phase_lag_rad: FloatArray
    variance_rad2: FloatArray
    amplitude: FloatArray
    snr: FloatArray
    frequency_offset_hz: FloatArray
    reduced_chi_square: FloatArray
    detected: NDArray[np.bool_]


class FmToneReceiver:
    """Maximum-likelihood receiver of a `RangingSignal` in white noise.

    1. Offset (`OffsetSearch`): the strong components of the periods, correlated with a grid of
       frequencies half a cycle per burst apart; the largest sum of squares is interpolated.
    2. Fold: the periods are added after turning back by the offset, about the middle of the
       burst, where the phases of carrier and tones do not depend on the offset's error.
       The transform of the sum holds every component; what is left of the energy is noise.
    3. Phases (`TonePhaseFit`): products of neighbouring components start a Gauss-Newton step. A
       second step would change the error by less than 0.3 % from -10 dB upwards, and by 1.3 % at
       -13 dB with two tones (960 samples).

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
    >>> from rail_signals.ranging.signal import modulate
    >>> receiver = FmToneReceiver(RangingSignal())
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
        components = fm_spectrum(signal)
        strong = components.strongest(_STRONG_FRACTION)
        search = OffsetSearch(signal, strong, max_offset_hz) if max_offset_hz > 0 else None
        search_hz = search.width_hz if search else 0.0
        samples = signal.samples
        fraction = detection_threshold(
            false_alarm, len(strong.bins), samples, search_hz, signal.duration_s
        )
        fit = TonePhaseFit(signal, components, strong, fraction)
        self._fields = 2 * len(signal.tones_hz) + 4
        self._tables = (
            np.concatenate([search.strong, fit.basis] if search else [fit.basis]),
            search.grid if search else np.zeros((2, 1, 1)),
            search.halves if search else np.zeros((0, 0)),
            fit.orders,
            fit.weights,
            fit.pairs,
            fit.pair_weights,
        )
        # Without a search the offset is zero: the sum of the periods is all that is needed.
        weights = search.tapers if search else np.ones((1, self._periods))
        numbers = search.numbers if search else np.zeros(SEARCH_NUMBERS)
        self._plans = {
            np.dtype(kind): _Plan(
                real,
                None if weights is None else weights.astype(real),
                np.concatenate([numbers, fit.numbers(ceiling)]),
            )
            for kind, real, ceiling in _PRECISIONS
        }

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
        plan = self._plans.get(x.dtype)
        if plan is None:
            x = x.astype(np.complex128)
            plan = self._plans[x.dtype]
        samples, shape = self.signal.samples, x.shape
        if not shape or shape[-1] != samples:
            raise ValueError(f"bursts must have {samples} samples, got shape {shape}")
        lead = shape[:-1]
        parts = np.ascontiguousarray(x).view(plan.real).reshape(-1, 2 * samples)
        count, fields = len(parts), self._fields
        table, detected = np.empty((count, fields)), np.empty(count, dtype=np.bool_)
        energy, rows = _NOTHING, parts
        if plan.weights is not None:
            energy, rows = self._summed(parts, plan.weights)
        estimate_bursts(energy, rows, *self._tables, plan.numbers, table, detected)
        table = table.reshape(*lead, fields)
        tones = (fields - 4) // 2
        return ToneEstimate(
            table[..., :tones],
            table[..., tones:-4],
            table[..., -4],
            table[..., -3],
            table[..., -2],
            table[..., -1],
            detected.reshape(lead),
        )

    def _summed(self, parts: RealArray, weights: RealArray) -> tuple[FloatArray, RealArray]:
        """Energies [batch] and weighted sums of periods [batch, sums * 2 period] of bursts."""
        count = len(parts)
        periods = parts.reshape(count, self._periods, -1)
        energy = np.empty(count)
        sums = np.empty((count, len(weights), periods.shape[2]), dtype=parts.dtype)
        # In pieces that stay in the processor's cache, where the energies bring them.
        step = max(1, _CHUNK_BYTES // (parts.itemsize * parts.shape[1]))
        with np.errstate(all="ignore"):  # too large or not finite is not detected
            for i in range(0, count, step):
                burst_energies(parts[i : i + step], energy[i : i + step])
                # Stacked, one of fixed shape for each burst, so that rounding does not depend
                # on the batch.
                np.matmul(weights, periods[i : i + step], out=sums[i : i + step])
        return energy, sums.reshape(count, -1)


class _Plan(NamedTuple):
    """What is done in the precision of the bursts, and with what.

    With `weights` the periods are summed by a matrix product before the compiled part; without,
    that reads the burst itself.
    """

    real: type[np.floating]
    weights: RealArray | None
    numbers: FloatArray


_NOTHING = np.zeros(0)
_PRECISIONS = (
    (np.complex64, np.float32, MAX_SNR_SINGLE),
    (np.complex128, np.float64, MAX_SNR),
)
