"""Matched detection: closed forms against random draws, and what is not the wave sent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.track_code.matched import (
    NO_MATCH,
    Match,
    false_alarm,
    joined,
    match_block,
)
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.scales import IDENTITIES
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode

RATE_HZ, CARRIER_HZ = 16_000.0, 1700.0
PROFILE = load_profile("tones27")
#: Of the receivers of circuits.
LEAST_COHERENCE = 0.6


def wave(samples: int, **fields: int) -> np.ndarray:
    word = {"speed": 0x66, "gradient": 10, "block_length": 20, "network": 3} | fields
    return FmTransmitter(PROFILE, CARRIER_HZ, RATE_HZ).block(encode(PROFILE, word), samples)


@pytest.mark.parametrize("snr_db", [30.0, 8.0, -20.0])
def test_false_alarms_of_noise_are_as_many_as_the_closed_form_says(snr_db: float) -> None:
    # 5 bins: short enough that a false alarm happens. The level of the noise has no part in it.
    rng = np.random.default_rng(3)
    sent, runs, least = wave(320), 20_000, 0.4
    noise = rng.standard_normal((runs, 320)) * 10.0 ** (-snr_db / 20.0)
    matches = [match_block(sent, row, CARRIER_HZ, RATE_HZ) for row in noise]
    bins = matches[0].bins
    assert bins == 5
    expected = false_alarm(least, bins)
    counted = np.mean([match.coherence > least for match in matches])
    assert counted == pytest.approx(expected, abs=4.0 * math.sqrt(expected / runs))


def test_the_window_of_a_circuit_is_never_passed_by_noise() -> None:
    bins = sum(match_block(wave(4000), wave(4000), CARRIER_HZ, RATE_HZ).bins for _ in range(8))
    assert false_alarm(LEAST_COHERENCE, bins) < 1e-100


@pytest.mark.parametrize("snr_db", [30.0, 8.0])
def test_the_own_code_has_the_coherence_of_its_signal_to_noise_ratio(snr_db: float) -> None:
    rng = np.random.default_rng(4)
    sent = wave(32_000)
    # As the rails have it: a wave of amplitude 1 over the noise in 300 Hz.
    noise_v = math.sqrt(0.5 * RATE_HZ / 600.0) * 10.0 ** (-snr_db / 20.0)
    gain = 10.0 ** (-3.0 / 20.0)
    match = match_block(
        sent, gain * sent + noise_v * rng.standard_normal(sent.size), CARRIER_HZ, RATE_HZ
    )
    ratio = gain**2 * 10.0 ** (snr_db / 10.0) * 300.0 / 240.0
    assert match.coherence == pytest.approx(ratio / (1.0 + ratio), abs=0.03)
    assert match.level_db == pytest.approx(-3.0, abs=0.5)


def test_no_word_that_circuits_send_is_near_to_a_line() -> None:
    """The coherence of a line of any frequency with the wave, for the words modulated least."""
    tones = np.array(PROFILE.tones_hz)
    index = np.array(PROFILE.deviations_hz) / tones
    words = np.array(
        [
            encode(
                PROFILE,
                {"speed": speed, "gradient": g, "block_length": n, "network": identity},
            )
            for identity in IDENTITIES
            for speed in range(0, 256, 5)
            for g in range(16)
            for n in range(2, 64, 3)
        ]
    )
    least = np.argsort((words * index**2).sum(axis=1))[:60]
    rate_hz, window_s = 320.0, 2.0
    count = round(rate_hz * window_s)
    worst = 0.0
    for row in least:
        b = words[row]
        for start_s in np.arange(0.0, 12.0, 1.5):
            time_s = start_s + np.arange(count) / rate_hz
            phase = (index[b, None] * np.cos(2 * np.pi * tones[b, None] * time_s)).sum(axis=0)
            lines = np.abs(np.fft.fft(np.exp(-1j * phase), 2 * count) / count) ** 2
            worst = max(worst, float(lines.max()))
    assert 0.2 < worst < LEAST_COHERENCE - 0.1


def test_a_line_of_any_strength_is_not_the_own_code() -> None:
    time_s = np.arange(32_000) / RATE_HZ
    for volts in (0.05, 0.5, 5.0, 500.0):
        line = volts * np.cos(2.0 * np.pi * CARRIER_HZ * time_s)
        match = match_block(wave(32_000), line, CARRIER_HZ, RATE_HZ)
        assert match.coherence < LEAST_COHERENCE - 0.1


def test_the_code_of_the_circuit_after_the_next_is_not_the_own_one() -> None:
    for own, other in ((3, 6), (5, 7)):
        match = match_block(
            wave(32_000, network=own), wave(32_000, network=other), CARRIER_HZ, RATE_HZ
        )
        assert match.coherence < LEAST_COHERENCE - 0.1


def test_blocks_join_to_a_window() -> None:
    sent = wave(4000)
    one = match_block(sent, 0.5 * sent, CARRIER_HZ, RATE_HZ)
    assert joined([one, one]).level_db == pytest.approx(-6.02, abs=0.01)
    assert joined([]) == NO_MATCH
    # Twice the wave in opposite phase is nothing.
    assert joined([one, match_block(sent, -0.5 * sent, CARRIER_HZ, RATE_HZ)]).coherence < 1e-9


def test_nothing_and_not_numbers_match_nothing() -> None:
    sent = wave(400)
    for received in (np.full(400, np.nan), np.full(400, np.inf), np.zeros(0), sent[:399]):
        assert match_block(sent, received, CARRIER_HZ, RATE_HZ) == NO_MATCH
    assert match_block(np.zeros(400), sent, CARRIER_HZ, RATE_HZ) == NO_MATCH
    assert (Match(0j, 0.0, 0.0, 0).coherence, NO_MATCH.level_db) == (0.0, -math.inf)
