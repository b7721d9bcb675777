"""Whatever is fed to the track-code receiver, no wrong word ever counts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.track_code.decision import Confirmation, judge_levels
from rail_signals.track_code.demodulator import DemodulatorChain
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.reference_receiver import ReferenceTrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode

RATE_HZ = 6400.0
TONES27 = load_profile("tones27")
FIELDS = {"speed": 135, "gradient": 7, "block_length": 15, "network": 2}
SECONDS = 6
TIME_S = np.arange(SECONDS * 6400) / RATE_HZ


def receiver(carrier_hz: float = 1700.0) -> ReferenceTrackCodeReceiver:
    return ReferenceTrackCodeReceiver(TONES27, carrier_hz, RATE_HZ)


def wave(carrier_hz: float = 1700.0, fields: dict[str, int] = FIELDS) -> np.ndarray:
    transmitter = FmTransmitter(TONES27, carrier_hz, RATE_HZ)
    return transmitter.block(encode(TONES27, fields), TIME_S.size)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300, 2e6])
def test_one_broken_sample_costs_a_slot_and_no_more(value: float) -> None:
    samples = wave()
    samples[3 * 6400 + 17] = value
    decisions = receiver().feed(samples)
    broken = [d for d in decisions if "finite" in d.reason or "exceed" in d.reason]
    assert [d.time_s for d in broken] == [3.125]
    assert all(d.fields == FIELDS for d in decisions if d.valid)
    assert decisions[-1].valid and decisions[int(2.9 * 8)].valid
    refill = [d for d in decisions if 3.2 < d.time_s < 5.2]
    assert not any(d.valid for d in refill)
    assert all(d.reason for d in refill)


@pytest.mark.parametrize(
    ("samples", "reason"),
    [
        (np.zeros(TIME_S.size), "no carrier"),
        (np.full(TIME_S.size, 0.7), "samples are clipped"),
        (np.clip(1.1 * wave(), -1, 1), "samples are clipped"),
        (np.sign(wave()), "samples are clipped"),
        (np.full(TIME_S.size, np.nan), "samples are not finite"),
        (1e-5 * wave(), "no carrier"),
        (wave(2000.0), "no carrier"),
        (np.sin(2 * np.pi * 1701.3 * TIME_S), "no tone is present"),
    ],
)
def test_what_is_no_message(samples: np.ndarray, reason: str) -> None:
    decisions = receiver().feed(samples)
    assert len(decisions) == 8 * SECONDS
    assert not any(d.valid or d.fields for d in decisions)
    assert decisions[-1].reason == reason


@pytest.mark.parametrize("name", ["tones27", "tones18", "three_tones"])
def test_noise_alone_is_no_message(name: str) -> None:
    rng = np.random.default_rng(6)
    listener = ReferenceTrackCodeReceiver(load_profile(name), 2300.0, RATE_HZ)
    for _ in range(12):
        decisions = listener.feed(rng.normal(size=10 * 6400))
        assert not any(d.valid for d in decisions)


@pytest.mark.parametrize(
    "disturbed",
    [
        wave() + 10 * wave(2000.0, FIELDS | {"speed": 7}),  # neighbouring carrier, 20 dB above
        wave() + 0.3 * np.sin(2 * np.pi * 1550 * TIME_S),  # 31st harmonic of 50 Hz
        wave() * (1 + 0.5 * np.sin(2 * np.pi * 5 * TIME_S)),
        wave() * 10 ** (-2 * TIME_S / SECONDS),
        -wave(),
        np.round(2048 * wave()) / 2048,
        wave().astype(np.float32),
    ],
)
def test_what_does_not_hide_a_message(disturbed: np.ndarray) -> None:
    decisions = receiver().feed(disturbed)
    assert sum(d.valid for d in decisions) > 8 * (SECONDS - 2.3)
    assert all(d.fields == FIELDS for d in decisions if d.valid)


@pytest.mark.parametrize("snr_db", [-10.0, 0.0, 5.0])
def test_below_the_threshold_words_are_lost_and_never_wrong(snr_db: float) -> None:
    rng = np.random.default_rng(7)
    sigma = math.sqrt(0.5 * 10 ** (-snr_db / 10) / 300 * RATE_HZ / 2)
    listener = receiver()
    for _ in range(5):
        decisions = listener.feed(wave() + rng.normal(scale=sigma, size=TIME_S.size))
        assert all(d.fields == FIELDS for d in decisions if d.valid)


def test_a_word_that_fails_its_check_is_refused() -> None:
    bits = encode(TONES27, FIELDS)
    bits[[3, 11]] ^= True
    decisions = receiver().feed(FmTransmitter(TONES27, 1700.0, RATE_HZ).block(bits, TIME_S.size))
    assert not any(d.valid for d in decisions)
    assert decisions[-1].reason == "check bits are wrong"
    np.testing.assert_array_equal(decisions[-1].bits, bits)


def test_the_windows() -> None:
    bits = encode(TONES27, FIELDS)
    levels = np.where(bits, 1.0, 0.0)
    quiet = np.zeros(27)
    assert judge_levels(TONES27, levels, quiet)[1:] == (FIELDS, "")
    present = int(np.flatnonzero(bits)[0])
    for level in (0.36, 0.5, 0.64, 1.36, math.nan, math.inf):
        levels[present] = level
        _, fields, reason = judge_levels(TONES27, levels, quiet)
        assert fields is None and f"of tone {TONES27.tones_hz[present]:g} Hz" in reason
    levels[present] = 0.65
    assert judge_levels(TONES27, levels, quiet)[1] == FIELDS
    assert "noise" in judge_levels(TONES27, levels, quiet + 0.11)[2]
    assert "noise" in judge_levels(TONES27, levels, quiet * math.nan)[2]
    tones18 = load_profile("tones18")
    assert "2 tones" in judge_levels(tones18, np.arange(18) < 2, np.zeros(18))[2]


def test_empty_input_and_memory() -> None:
    listener = receiver()
    assert listener.feed(np.zeros(0)) == []
    for _ in range(200):
        listener.feed(np.ones(1001) * 0.5)
        assert listener._waiting.size < 800 and listener._slot.size == 104
    listener.reset()
    assert listener.time_s == 0.0
    first, again = receiver().feed(wave()), listener.feed(wave())
    assert [d.reason for d in first] == [d.reason for d in again]


def test_decisions_cannot_be_changed() -> None:
    decision = receiver().feed(wave())[-1]
    with pytest.raises(AttributeError):
        decision.valid = False  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        decision.levels[0] = 1.0


@pytest.mark.parametrize(
    "samples", [[1, 2], np.zeros((2, 2)), np.zeros(3, dtype=complex), np.array(["a"]), 1.0]
)
def test_wrong_samples(samples: object) -> None:
    with pytest.raises(ValueError, match="samples must be real floats in one dimension"):
        receiver().feed(samples)  # type: ignore[arg-type]


def test_wrong_parameters() -> None:
    with pytest.raises(ValueError, match=r"multiple of 128 Hz, got 8000\.0"):
        ReferenceTrackCodeReceiver(TONES27, 1700.0, 8000.0)
    with pytest.raises(ValueError, match="sample_rate_hz must be 5650 Hz or more"):
        ReferenceTrackCodeReceiver(TONES27, 2600.0, 5632.0)
    with pytest.raises(ValueError, match="carrier_hz must be finite and above 440"):
        DemodulatorChain(TONES27, math.nan, RATE_HZ)
    with pytest.raises(ValueError, match="hop_samples must be a positive integer, got 0"):
        ReferenceTrackCodeReceiver(TONES27, 1700.0, RATE_HZ, hop_samples=0)
    with pytest.raises(ValueError, match="confirmations must be a positive integer, got 0"):
        ReferenceTrackCodeReceiver(TONES27, 1700.0, RATE_HZ, confirmations=0)
    with pytest.raises(ValueError, match="least_amplitude must be finite and above zero, got -1"):
        ReferenceTrackCodeReceiver(TONES27, 1700.0, RATE_HZ, least_amplitude=-1)
    assert Confirmation(1).confirm(np.array([True]))
