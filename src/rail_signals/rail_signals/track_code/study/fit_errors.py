"""Errors of fits of the whole slot: started at the truth, from the slots before, and from scratch.

A message is wrong if a level is on the wrong side of the threshold that theory says is best.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Final

import numpy as np

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.track_code.ml import MaximumLikelihoodTones
from rail_signals.track_code.ml_tracker import TrackedTones
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile

from .baseband import (
    RATE_HZ,
    SAMPLES_PER_SLOT_SAMPLE,
    Baseband,
    draw_noise,
    draw_waves,
    slot_samples,
    snr_of,
)
from .closed_forms import thresholds_hz
from .error_count import ErrorCount, batches
from .words import CheckedWords

HOP_SAMPLES: Final = 8
"""Samples at 64 Hz from one slot of a word that is tracked to the next: eight slots a second."""

SETTLED_S: Final = 8.0
"""Time after which the slots of a word that is tracked count [s]."""

SLOTS_PER_WORD: Final = 5
"""Slots of a word that is tracked that count; they do not overlap."""

_MESSAGES: Final = 500
_WORDS: Final = 100


def count_near(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> ErrorCount:
    """Messages in one slot that the fit from the truth gets wrong: a search that never fails."""
    fit, words = _fit(profile), CheckedWords(profile)
    errors = 0
    for count in batches(messages, _MESSAGES):
        sent = words.draw(rng, count)
        clean, phases_rad = draw_waves(profile, sent, fit.samples, rng)
        noisy = clean + draw_noise((count, fit.samples), snr_of(density_db_hz), rng)
        start = true_parameters(profile, sent, clean, phases_rad)
        levels_hz = np.abs(fit.refine(noisy, start).amplitudes_hz)
        errors += _wrong(profile, density_db_hz, levels_hz, sent)
    return ErrorCount(messages, errors)


def count_ml(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> ErrorCount:
    """Messages in one slot that the fit gets wrong if it searches from scratch."""
    fit, words = _searching_fit(profile), CheckedWords(profile)
    errors = 0
    for count in batches(messages, _MESSAGES):
        sent = words.draw(rng, count)
        wave, _ = draw_waves(profile, sent, fit.samples, rng)
        wave += draw_noise((count, fit.samples), snr_of(density_db_hz), rng)
        errors += _wrong(profile, density_db_hz, np.abs(fit.estimate(wave).amplitudes_hz), sent)
    return ErrorCount(messages, errors)


def count_tracked(
    profile: TrackCodeProfile, density_db_hz: float, messages: int, rng: np.random.Generator
) -> ErrorCount:
    """Slots that are wrong of words that are tracked, once they had time to be found.

    Below 22 dB Hz words are seldom found at all, and the search for them takes hours.
    """
    fit, words = _searching_fit(profile), CheckedWords(profile)
    hop = HOP_SAMPLES * SAMPLES_PER_SLOT_SAMPLE
    apart = math.ceil(fit.samples / hop)
    first = math.ceil(SETTLED_S * SLOT_RATE_HZ / HOP_SAMPLES)
    hops = first + (SLOTS_PER_WORD - 1) * apart + 1
    counted = errors = 0
    for count in batches(-(-messages // SLOTS_PER_WORD), _WORDS):
        sent = words.draw(rng, count)
        wave, _ = draw_waves(profile, sent, fit.samples + (hops - 1) * hop, rng)
        wave += draw_noise((count, wave.shape[1]), snr_of(density_db_hz), rng)
        tracker = TrackedTones(fit, hop)
        for k in range(hops):
            levels_hz = np.abs(tracker.next(wave[:, k * hop :][:, : fit.samples]).amplitudes_hz)
            if k >= first and (k - first) % apart == 0:
                counted += count
                errors += _wrong(profile, density_db_hz, levels_hz, sent)
    return ErrorCount(counted, errors)


def true_parameters(
    profile: TrackCodeProfile, sent: BoolArray, clean: Baseband, phases_rad: FloatArray
) -> FloatArray:
    """What a fit without any noise would find.

    Parameters
    ----------
    profile
        Tones and deviations.
    sent : bool [messages, tones]
    clean : complex64 [messages, samples]
    phases_rad : float64 [messages, tones]
        Both of `draw_waves`.

    Returns
    -------
    float64 [messages, 2 + 2 tones]
        As `MaximumLikelihoodTones.refine` takes them.
    """
    fit = _fit(profile)
    middle_s = (fit.samples - 1) / 2 / RATE_HZ
    turn = phases_rad + 2 * math.pi * fit.tones_hz * middle_s
    # The deviation is A sin(turn + 2 pi F t) about the middle: x = A sin(turn), y = A cos(turn).
    deviations_hz = sent * np.array(profile.deviations_hz)
    carrier = np.zeros((len(sent), 2))
    parameters = np.concatenate(
        [carrier, deviations_hz * np.sin(turn), deviations_hz * np.cos(turn)], axis=1
    )
    model = np.exp(1j * (parameters @ fit.basis))
    parameters[:, 0] = np.angle((clean * model.conj()).mean(axis=1))
    return parameters


def _wrong(
    profile: TrackCodeProfile, density_db_hz: float, levels_hz: FloatArray, sent: BoolArray
) -> int:
    """Messages [messages, tones] of which a bit is wrong."""
    found = levels_hz > thresholds_hz(profile, density_db_hz)
    return int(np.count_nonzero((found != sent).any(axis=1)))


@lru_cache(maxsize=8)
def _fit(profile: TrackCodeProfile) -> MaximumLikelihoodTones:
    return MaximumLikelihoodTones(profile.tones_hz, slot_samples(profile), RATE_HZ)


@lru_cache(maxsize=2)
def _searching_fit(profile: TrackCodeProfile) -> MaximumLikelihoodTones:
    """The gains of all starts take a second to compute."""
    return MaximumLikelihoodTones(
        profile.tones_hz, slot_samples(profile), RATE_HZ, deviations_hz=profile.deviations_hz
    )
