"""What theory says of the errors that are counted, over C/N0."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.track_code.bound import (
    best_threshold,
    message_error_bound,
    snr_of_message_error,
    tone_sigma_bound,
    undetected_error_probability,
    window_probabilities,
)
from rail_signals.track_code.profile import TrackCodeProfile

from .baseband import RATE_HZ, slot_samples, snr_of
from .words import CheckedWords

# Beyond it the best threshold is half of the tone.
_LARGE_RATIO = 200.0


@lru_cache(maxsize=256)
def message_error_rate(profile: TrackCodeProfile, density_db_hz: float) -> float:
    """Bound of the message error rate of one slot; see `message_error_bound`.

    Parameters
    ----------
    profile
        Tones and deviations.
    density_db_hz
        C/N0 [dB Hz].
    """
    return message_error_bound(
        profile.tones_hz,
        profile.deviations_hz,
        snr_of(density_db_hz),
        slot_samples(profile),
        RATE_HZ,
    )


def density_of_message_error(profile: TrackCodeProfile, rate: float) -> float:
    """C/N0 [dB Hz] at which the bound of the message error rate is `rate`."""
    snr = snr_of_message_error(
        rate, profile.tones_hz, profile.deviations_hz, slot_samples(profile), RATE_HZ
    )
    return 10 * math.log10(snr * RATE_HZ)


def density_at(points: Sequence[tuple[float, float]], rate: float) -> float | None:
    """C/N0 [dB Hz] at which counted rates fall to `rate`, None where they never do.

    Parameters
    ----------
    points : sequence of (density_db_hz, rate)
        Rising in density; between two of them the logarithm of the rate is a straight line.
    rate
        Wanted rate.

    Examples
    --------
    >>> density_at([(20.0, 1.0), (22.0, 1e-1), (24.0, 1e-3)], 1e-2)
    23.0
    """
    for (density, above), (next_density, below) in itertools.pairwise(points):
        if above >= rate >= below and above > 0:
            if above == below:
                return density
            share = math.log(above / rate) / math.log(above / below) if below > 0 else 1.0
            return density + (next_density - density) * share
    return None


def loss_db(
    profile: TrackCodeProfile, points: Sequence[tuple[float, float]], rate: float = 1e-2
) -> float | None:
    """Carrier that a receiver needs above the bound for a message error rate [dB].

    Parameters
    ----------
    profile
        Tones and deviations.
    points : sequence of (density_db_hz, rate)
        Counted rates, as of `density_at`.
    rate
        Message error rate at which the two are compared.
    """
    at = density_at(points, rate)
    return None if at is None else at - density_of_message_error(profile, rate)


def undetected_rate(profile: TrackCodeProfile, density_db_hz: float) -> float:
    """Share of messages that are wrong and pass in one slot, of levels that are efficient.

    That a second slot must agree makes it less. Bits count as independent, and zeros as wrong as
    often as ones, which the threshold in the middle makes nearly true.

    Parameters
    ----------
    profile
        Tones, deviations, windows and check.
    density_db_hz
        C/N0 [dB Hz].
    """
    ratio = np.array(profile.deviations_hz) / _sigma_hz(profile, density_db_hz)
    windows = (profile.absent_max, profile.present_min, profile.present_max)
    right, wrong = window_probabilities(ratio, *(edge * ratio for edge in windows))
    return undetected_error_probability(right, wrong, CheckedWords(profile).check)


@lru_cache(maxsize=256)
def thresholds_hz(profile: TrackCodeProfile, density_db_hz: float) -> FloatArray:
    """Levels that best tell a tone from none [Hz], float64 [tones], read-only."""
    sigma_hz = _sigma_hz(profile, density_db_hz)
    ratios: list[float] = (np.array(profile.deviations_hz) / sigma_hz).tolist()
    best = [best_threshold(each) if each < _LARGE_RATIO else each / 2 for each in ratios]
    levels_hz = np.asarray(sigma_hz * best)
    levels_hz.setflags(write=False)
    return levels_hz


def _sigma_hz(profile: TrackCodeProfile, density_db_hz: float) -> FloatArray:
    """Standard deviation of efficient amplitudes [Hz], float64 [tones]."""
    return tone_sigma_bound(profile.tones_hz, snr_of(density_db_hz), slot_samples(profile), RATE_HZ)
