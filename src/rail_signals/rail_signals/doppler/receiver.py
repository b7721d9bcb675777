"""Receiver of reference tones: from one block to the shift of every station in reach."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled
from rail_signals.ranging.bounds import complex_tone_frequency_variance_bound

from .tone_fit import ToneFit, ToneFitter
from .tone_kernel import PHASE_TERMS, PIECES
from .tone_plan import TonePlan
from .tone_search import ToneSearch

MAX_SNR = 1e5
"""Ceiling of the signal-to-noise ratio that variances are told from (50 dB): there the model of
a tone that passes at 20 m and 500 km/h ends."""

RELIABLE_ENERGY = 40.0
"""Energy of a tone over noise, N gamma, from which it is reported (16 dB). Below, an estimate is
now and then off by many standard deviations: one in 4000 at 14 dB."""

#: Fraction of the samples at both ends of the range that tells an overloaded receiver.
_CLIPPED_FRACTION = 0.005
#: Probability that noise alone makes the residual of a good tone exceed the limit of chi-square.
_CHI_SQUARE_FALSE_ALARM = 1e-7
#: Largest last step of a fit that has settled [rad].
_SETTLED_RAD = 0.1
#: What the model of a tone leaves at most of the strongest tone, in power, and how far below
#: the strongest a tone may therefore be.
_MODEL_ERROR, _DYNAMIC_RANGE = 4e-6, 1e-6


@dataclass(frozen=True)
class ToneShifts:
    """Tones found in one block, in the order of their slots; arrays [n].

    Attributes
    ----------
    slots : int [n]
        Slots in which a tone was found; the others are silent, too weak, or not to be trusted.
    shift_hz : float [n]
        Shift of each tone from the middle of its slot, that of the whole block
        (`rail_signals.doppler.tone_plan`).
    variance_hz2 : float [n]
        Its variance: the bound at the estimated `snr`.
    snr : float [n]
        Signal-to-noise ratio per sample (linear).
    chirp_hz_per_s : float [n]
        Rate of the shift.
    reduced_chi_square : float [n]
        Power that the fit leaves near the tone, over that of the noise; about 1.
    """

    slots: NDArray[np.intp]
    shift_hz: FloatArray
    variance_hz2: FloatArray
    snr: FloatArray
    chirp_hz_per_s: FloatArray
    reduced_chi_square: FloatArray

    def __len__(self) -> int:
        return len(self.slots)


class ToneReceiver:
    """Finds the reference tones of a block and estimates their shifts at the bound.

    Parameters
    ----------
    plan
        The plan of the tones.
    least_energy
        Energy over noise from which a tone counts as found; that noise alone does has the
        probability `false_alarm_probability`, 8e-14 a slot at the default.

    Examples
    --------
    >>> from rail_signals.doppler.signal import block_times_s, received_tones
    >>> plan = TonePlan()
    >>> x_m = block_times_s(plan) * 300.0 / 3.6
    >>> rng = np.random.default_rng(1)
    >>> block = rng.normal(scale=0.1, size=(plan.samples, 2)).view(np.complex128)[:, 0]
    >>> block += received_tones(plan, [3, 4], [1000.0 + x_m, 500.0 - x_m])
    >>> found = ToneReceiver(plan).estimate(block)
    >>> found.slots.tolist(), found.shift_hz.round(1).tolist()
    ([3, 4], [-722.8, 722.7])
    """

    def __init__(self, plan: TonePlan, *, least_energy: float = RELIABLE_ENERGY) -> None:
        self.plan = plan
        self._search = ToneSearch(plan)
        self._fitter = ToneFitter(plan)
        self._middle_hz = [plan.slot_offset_hz(slot) for slot in range(plan.slots)]
        self._most_shift_hz = plan.max_shift_hz + plan.bin_hz
        self.least_snr = least_energy / plan.samples
        """Signal-to-noise ratio per sample from which a tone is reported."""
        freedom = 2 * (PIECES - PHASE_TERMS)
        self._most_chi_square = float(chdtri(freedom, _CHI_SQUARE_FALSE_ALARM)) / freedom
        rate_hz = plan.sample_rate_hz
        self._unit_variance = float(
            complex_tone_frequency_variance_bound(1.0, plan.samples, rate_hz)
        )

    def estimate(self, block: ArrayLike) -> ToneShifts:
        """Shifts of the tones in a block.

        Parameters
        ----------
        block : complex [samples]
            Received complex envelope. From one that is zero, clipped or not finite nothing is
            reported.

        Returns
        -------
        ToneShifts

        Raises
        ------
        ValueError
            If the block has another length.
        """
        x = np.ascontiguousarray(block, dtype=np.complex128)
        if x.shape != (self.plan.samples,):
            raise ValueError(f"block must have {self.plan.samples} samples, got shape {x.shape}")
        if not _usable(x):
            return _NOTHING
        spectrum = self._search.spectrum(x)
        floor = self._search.guard_noise(spectrum)
        tones = self._search.find(spectrum, floor)
        if not len(tones.slots):
            return _NOTHING
        fit = self._fitter.fit(x, tones, floor)
        noise = self._search.noise(spectrum, fit.frequency_hz)
        return self._report(tones.slots.tolist(), fit, noise)

    def _report(self, slots: list[int], fit: ToneFit, noise: float) -> ToneShifts:
        """What can be trusted of a fit."""
        columns = zip(slots, *(column.tolist() for column in fit), strict=True)
        strongest = max((p for p in fit.power.tolist() if p == p), default=0.0) / noise
        least = max(self.least_snr, _DYNAMIC_RANGE * strongest)
        most_chi_square = self._most_chi_square + _MODEL_ERROR * strongest
        tones = []
        for slot, frequency_hz, chirp, power, residual, last_step_rad in columns:
            snr, reduced_chi_square = power / noise, residual / noise
            shift_hz = frequency_hz - self._middle_hz[slot]
            good = (  # false also for what is not a number
                snr > least
                and reduced_chi_square < most_chi_square
                and last_step_rad < _SETTLED_RAD
                and abs(shift_hz) <= self._most_shift_hz
            )
            if good:
                variance = self._unit_variance / min(snr, MAX_SNR)
                tones.append((slot, shift_hz, variance, snr, chirp, reduced_chi_square))
        if not tones:
            return _NOTHING
        numbers, *values = zip(*tones, strict=True)
        return ToneShifts(np.array(numbers, dtype=np.intp), *map(np.array, values))


def false_alarm_probability(plan: TonePlan, energy: float) -> float:
    """Bound on the probability that noise alone counts as a tone in a slot.

    The energy u of one template is exponential under noise. Over frequencies and chirps the
    largest exceeds u with a probability of at most
    ``exp(-u) (1 + (W + C) sqrt(u / pi) + W C u / pi)`` (Rice's formula and its like in two
    dimensions; Adler and Taylor, Random Fields and Geometry, 2007). W and C are the widths
    searched times ``sqrt(lambda)``, lambda = (2 pi T)^2 / 12 for frequency and pi^2 T^4 / 180 for
    chirp. The noise is measured as well: with n independent bins exp(-u) becomes
    ``(1 + u / n)^-n``.

    Examples
    --------
    >>> f"{false_alarm_probability(TonePlan(), 40.0):.0e}"
    '8e-14'
    """
    wide = 2 * plan.max_shift_hz * 2 * math.pi * plan.duration_s / math.sqrt(12.0)
    steep = plan.max_chirp_hz_per_s * math.pi * plan.duration_s**2 / math.sqrt(180.0)
    # The window makes neighbours of the bins alike: about half of them are independent.
    bins = 0.5 * plan.samples
    root = math.sqrt(energy / math.pi)
    counts = 1 + (wide + steep) * root + wide * steep * root**2
    return min(1.0, counts * math.exp(-bins * math.log1p(energy / bins)))


def _usable(x: ComplexArray) -> bool:
    """Whether a block is finite, not silent, and not clipped."""
    parts = x.view(np.float64)
    energy = float(np.vdot(parts, parts))
    if not math.isfinite(energy) or energy == 0.0:
        return False
    # A clipped wave sits at both ends of the range again and again.
    return min(_at_the_ends(parts)) < _CLIPPED_FRACTION * parts.size


@compiled
def _at_the_ends(values: FloatArray) -> tuple[int, int]:
    """How many values are the largest, and how many the smallest."""
    high, low = values[0], values[0]
    for value in values:
        high, low = max(high, value), min(low, value)
    highest, lowest = 0, 0
    for value in values:
        highest += value == high
        lowest += value == low
    return highest, lowest


_EMPTY: FloatArray = np.zeros(0)
_NOTHING = ToneShifts(np.zeros(0, dtype=np.intp), _EMPTY, _EMPTY, _EMPTY, _EMPTY, _EMPTY)
