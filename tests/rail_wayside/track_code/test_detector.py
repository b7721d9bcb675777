"""A track circuit is clear only where its own code is recognised at its level."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode
from rail_wayside.track_code.detector import (
    OCCUPIED_BELOW_DB,
    PICK_UP_S,
    TrackDetector,
)

RATE_HZ, CARRIER_HZ, TICK_S = 16_000.0, 1700.0, 0.25
SAMPLES = round(RATE_HZ * TICK_S)
PROFILE = load_profile("tones27")


def own(ticks: int) -> Iterator[np.ndarray]:
    fields = {"speed": 0x66, "gradient": 10, "block_length": 20, "network": 5}
    transmitter = FmTransmitter(PROFILE, CARRIER_HZ, RATE_HZ)
    for _ in range(ticks):
        yield transmitter.block(encode(PROFILE, fields), SAMPLES)


def clear_ticks(gain: float, *, snr_db: float = 60.0, line_v: float = 0.0, ticks: int = 80) -> int:
    rng = np.random.default_rng(2)
    noise_v = math.sqrt(0.5 * RATE_HZ / 600.0) * 10.0 ** (-snr_db / 20.0)
    detector = TrackDetector(-3.0, CARRIER_HZ, RATE_HZ, TICK_S)
    line = line_v * np.cos(2 * np.pi * CARRIER_HZ * np.arange(SAMPLES) / RATE_HZ)
    return sum(
        not detector.update(
            sent, gain * sent + line + noise_v * rng.standard_normal(SAMPLES)
        ).occupied
        for sent in own(ticks)
    )


@pytest.mark.parametrize("snr_db", [8.0, 12.0, 30.0])
def test_a_free_circuit_is_clear_at_every_noise_of_the_scenarios(snr_db: float) -> None:
    assert clear_ticks(0.7, snr_db=snr_db) == 80 - round(PICK_UP_S / TICK_S) + 1


@pytest.mark.parametrize("snr_db", [-20.0, 0.0, 8.0, 12.0, 60.0])
@pytest.mark.parametrize("line_v", [0.0, 0.4, 40.0])
def test_over_a_train_it_is_never_clear(snr_db: float, line_v: float) -> None:
    assert clear_ticks(0.7 * 10.0 ** (-50.0 / 20.0), snr_db=snr_db, line_v=line_v) == 0


def test_the_level_decides_at_the_threshold() -> None:
    at_v = 10.0 ** ((-3.0 - OCCUPIED_BELOW_DB) / 20.0)
    assert clear_ticks(1.05 * at_v) > 0
    assert clear_ticks(0.95 * at_v) == 0


def test_a_detector_with_a_broken_threshold_is_caught() -> None:
    """The planted fault: one that asks for no coherence takes a line for its code."""
    detector = TrackDetector(-3.0, CARRIER_HZ, RATE_HZ, TICK_S, least_coherence=0.0)
    line = 5.0 * np.cos(2 * np.pi * CARRIER_HZ * np.arange(SAMPLES) / RATE_HZ)
    assert any(not detector.update(sent, line).occupied for sent in own(40))


def test_nothing_sent_or_received_is_occupied() -> None:
    detector = TrackDetector(-3.0, CARRIER_HZ, RATE_HZ, TICK_S)
    for sent in own(9):
        detector.update(sent, sent)
    assert detector.update(None, np.ones(SAMPLES)).occupied
    assert detector.update(np.ones(SAMPLES), None).occupied
