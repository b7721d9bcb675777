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
from rail_signals.track_code.bound import on_off_error_probability, tone_sigma_bound
from rail_signals.track_code.profile import SLOT_RATE_HZ, TrackCodeProfile, load_profile
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.study.baseband import RATE_HZ as BASEBAND_RATE_HZ
from rail_signals.track_code.study.baseband import slot_samples, snr_of
from rail_signals.track_code.study.fit_errors import count_near
from rail_signals.track_code.word import encode

CARRIER_HZ: Final = 1700.0
RATE_HZ: Final = 16_000.0
_WORDS: Final = 250
_SECONDS: Final = 170.0
_SETTLED_S: Final = 10.0
_SEED: Final = 47


def bound(profile: TrackCodeProfile, densities_db_hz: Sequence[float]) -> FloatArray:
    """Least rates of wrong words for one slot and tones decided one by one.

    As `rail_signals.track_code.bound.message_error_bound`, but the covariance, which takes time
    and only scales with the noise, is computed once.
    """
    sigma = tone_sigma_bound(profile.tones_hz, 1.0, slot_samples(profile), BASEBAND_RATE_HZ)
    ratio = np.array(profile.deviations_hz) / sigma
    snr = np.array([snr_of(density) for density in densities_db_hz])
    wrong = on_off_error_probability(np.sqrt(snr)[:, None] * ratio)
    return np.asarray(-np.expm1(np.log1p(-wrong).sum(axis=1)))


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
    errors = [count_near(profile, level, _WORDS, rng).errors / _WORDS for level in levels_db]
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
