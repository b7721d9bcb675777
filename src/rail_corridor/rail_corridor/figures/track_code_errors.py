"""Words of a track code lost over the carrier-to-noise density, against the bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.random import Generator

from rail_corridor.plotting import COLOURS
from rail_signals.arrays import FloatArray
from rail_signals.track_code.bound import best_threshold, on_off_error_probability, tone_sigma_bound
from rail_signals.track_code.ml import MaximumLikelihoodTones
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile, load_profile
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode

CARRIER_HZ: Final = 1700.0
RATE_HZ: Final = 16_000.0
#: Baseband in which the fit works.
BASEBAND_HZ: Final = 640.0
_WORDS: Final = 250
_SECONDS: Final = 170.0
_SETTLED_S: Final = 10.0
_SEED: Final = 47


def bound(profile: TrackCodeProfile, densities_db_hz: Sequence[float]) -> FloatArray:
    """Least rates of wrong words for one slot and tones decided one by one.

    As `rail_signals.track_code.bound.message_error_bound`, but the covariance, which takes time
    and only scales with the noise, is computed once.
    """
    sigma = tone_sigma_bound(profile.tones_hz, 1.0, _slot_samples(profile), BASEBAND_HZ)
    ratio = np.array(profile.deviations_hz) / sigma
    snr = 10 ** (np.asarray(densities_db_hz) / 10) / BASEBAND_HZ
    wrong = on_off_error_probability(np.sqrt(snr)[:, None] * ratio)
    return np.asarray(-np.expm1(np.log1p(-wrong).sum(axis=1)))


def fit_errors(
    profile: TrackCodeProfile, densities_db_hz: Sequence[float], words: int, rng: Generator
) -> list[float]:
    """Shares of slots that the fit, started at the truth, reads wrong."""
    fit = MaximumLikelihoodTones(
        profile.tones_hz,
        _slot_samples(profile),
        BASEBAND_HZ,
        deviations_hz=profile.deviations_hz,
    )
    return [_fit_errors(fit, profile, level, words, rng) for level in densities_db_hz]


def _fit_errors(
    fit: MaximumLikelihoodTones,
    profile: TrackCodeProfile,
    density_db_hz: float,
    words: int,
    rng: Generator,
) -> float:
    tones, deviations = np.array(profile.tones_hz), np.array(profile.deviations_hz)
    samples = _slot_samples(profile)
    snr = 10 ** (density_db_hz / 10) / BASEBAND_HZ
    sent = rng.integers(0, 2, (words, tones.size)).astype(bool)
    turn = rng.uniform(0, 2 * math.pi, sent.shape)
    waves = (sent * deviations * np.sin(turn), sent * deviations * np.cos(turn))
    start = np.concatenate((np.zeros((words, 2)), *waves), axis=1)
    start[:, 0] = rng.uniform(0, 2 * math.pi, words)
    noise = rng.standard_normal((words, samples, 2)).view(np.complex128)[..., 0]
    slots = np.exp(1j * start @ fit.basis) + noise * math.sqrt(0.5 / snr)
    sigma = tone_sigma_bound(tones, snr, samples, BASEBAND_HZ)
    threshold = sigma * [best_threshold(ratio) for ratio in (deviations / sigma).tolist()]
    decided = np.abs(fit.refine(slots, start).amplitudes_hz) > threshold
    return float(np.mean((decided != sent).any(axis=1)))


def chain_losses(
    profile: TrackCodeProfile, density_db_hz: float, seconds: float, rng: Generator
) -> tuple[int, int]:
    """Words that the document's chain does not receive as sent, and slots that do not overlap."""
    fields = {name: int(rng.integers(0, 2**bits)) for name, bits in profile.fields if name != "crc"}
    word = encode(profile, fields)
    wave = FmTransmitter(profile, CARRIER_HZ, RATE_HZ).block(word, round(seconds * RATE_HZ))
    wave += rng.normal(scale=math.sqrt(RATE_HZ / (4 * 10 ** (density_db_hz / 10))), size=wave.size)
    decisions = TrackCodeReceiver(profile, CARRIER_HZ, RATE_HZ).feed(wave)
    per_s = len(decisions) / seconds
    step = math.ceil(profile.slot_samples / SLOT_RATE_HZ * per_s)
    counted = decisions[round(_SETTLED_S * per_s) :: step]
    lost = sum(not (each.valid and np.array_equal(each.bits, word)) for each in counted)
    return lost, len(counted)


def draw(figure: Figure) -> None:
    """Draw the bound, the fit, and the document's chain."""
    profile, rng = load_profile("tones27"), np.random.default_rng(_SEED)
    axes = figure.subplots()
    fine_db = np.arange(19.0, 26.6, 0.5)
    axes.plot(fine_db, bound(profile, fine_db.tolist()), color="black", label="bound")
    levels_db = (19.5, 20.5, 21.5)
    errors = fit_errors(profile, levels_db, _WORDS, rng)
    seen = np.where(np.array(errors) > 0.0, errors, np.nan)
    axes.plot(levels_db, seen, "o", color=COLOURS[0], label="fit of the slot, started near")
    chain_db = (29.0, 30.5, 32.0)
    losses = [chain_losses(profile, level, _SECONDS, rng) for level in chain_db]
    axes.plot(
        chain_db,
        [lost / slots if lost else np.nan for lost, slots in losses],
        "^-",
        color=COLOURS[1],
        label="the document's chain, all its rules",
    )
    axes.set(
        title="Words of 27 tones that are lost, one slot of 1.6 s",
        xlabel="carrier-to-noise density [dB Hz]",
        ylabel="fraction of the words",
        yscale="log",
        ylim=(1e-4, 1.5),
    )
    axes.legend(loc="lower right")


def _slot_samples(profile: TrackCodeProfile) -> int:
    return profile.slot_samples * round(BASEBAND_HZ / SLOT_RATE_HZ)
