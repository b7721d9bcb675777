"""The track-code receiver: every word at 30 dB, reaction time, blocks that do not show.

Signal to noise is carrier power over the power of white noise in 300 Hz, the band between
two neighbouring carriers.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from rail_signals.track_code.decision import Decision
from rail_signals.track_code.demodulator import Demodulator, DemodulatorChain
from rail_signals.track_code.profile import TrackCodeProfile, load_profile
from rail_signals.track_code.reference_receiver import (
    ReferenceTrackCodeReceiver,
    receiver_estimator,
)
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.tone_levels import tone_columns
from rail_signals.track_code.word import encode

RATE_HZ = 6400.0
TONES27 = load_profile("tones27")


def noise(rng: np.random.Generator, samples: int, snr_db: float) -> np.ndarray:
    density = 0.5 * 10 ** (-snr_db / 10) / 300
    return rng.normal(scale=np.sqrt(density * RATE_HZ / 2), size=samples)


def random_fields(profile: TrackCodeProfile, rng: np.random.Generator) -> dict[str, int]:
    if profile.coding == "one_of_n":
        return {profile.fields[0][0]: int(rng.integers(profile.tones))}
    return {name: int(rng.integers(2**bits)) for name, bits in profile.fields if name != "crc"}


def words(
    profile: TrackCodeProfile, carrier_hz: float, snr_db: float, count: int, offset_hz: float = 0.0
) -> Iterator[tuple[float, dict[str, int], list[Decision]]]:
    """Start [s], fields and decisions of words that follow each other in one wave."""
    rng = np.random.default_rng(round(carrier_hz + snr_db))
    transmitter = FmTransmitter(profile, carrier_hz + offset_hz, RATE_HZ)
    receiver = ReferenceTrackCodeReceiver(profile, carrier_hz, RATE_HZ)
    for _ in range(count):
        start_s = transmitter.samples / RATE_HZ
        fields = random_fields(profile, rng)
        samples = round(RATE_HZ * rng.uniform(2.4, 2.525))
        wave = transmitter.block(encode(profile, fields), samples)
        yield start_s, fields, receiver.feed(wave + noise(rng, samples, snr_db))


@pytest.mark.parametrize("carrier_hz", TONES27.carriers_hz)
def test_every_word_arrives_at_30_db(carrier_hz: float) -> None:
    before: dict[str, int] = {}
    for start_s, fields, decisions in words(TONES27, carrier_hz, 30.0, 60):
        assert decisions[-1].fields == fields, decisions[-1].reason
        for decision in decisions:
            if decision.valid:
                # The word before may stand for a moment, until the short slot notices.
                old = decision.time_s - start_s < 0.3
                assert decision.fields == (before if old else fields)
        before = fields


def test_reaction_time() -> None:
    reactions, endings = [], []
    before: dict[str, int] = {}
    for start_s, fields, decisions in words(TONES27, 2000.0, 20.0, 80):
        if before:
            new = [d.time_s - start_s for d in decisions if d.valid and d.fields == fields]
            old = [d.time_s - start_s for d in decisions if d.valid and d.fields == before]
            reactions.append(min(new))
            endings.append(max(old, default=0.0))
        before = fields
    # Equation 8 sets the floor; above it our longer slot, one hop of confirmation, the filters.
    assert min(reactions) > 1.5625 + 0.0625 + 0.125
    assert np.median(reactions) < 1.95
    assert max(reactions) < 2.3
    # Without the short slot the old word stands for up to 0.43 s.
    assert max(endings) < 0.3


@pytest.mark.parametrize("offset_hz", [-5.0, 5.0])
def test_an_offset_of_the_carrier_is_tolerated(offset_hz: float) -> None:
    for _, fields, decisions in words(TONES27, 2300.0, 30.0, 15, offset_hz):
        assert decisions[-1].fields == fields


@pytest.mark.parametrize("name", ["tones18", "three_tones"])
def test_the_other_families(name: str) -> None:
    profile = load_profile(name)
    rng = np.random.default_rng(4)
    for _ in range(8):
        fields = random_fields(profile, rng)
        fields[profile.fields[0][0]] = fields[profile.fields[0][0]] or 1
        bits = encode(profile, fields)
        wave = FmTransmitter(profile, 1700.0, RATE_HZ).block(bits, 25_600)
        decisions = ReferenceTrackCodeReceiver(profile, 1700.0, RATE_HZ).feed(
            wave + noise(rng, wave.size, 20.0)
        )
        assert decisions[-1].fields == fields
        assert all(d.fields == fields for d in decisions if d.valid)


@pytest.mark.parametrize("rate_hz", [5888.0, 8192.0, 16_000.0, 48_000.0])
@pytest.mark.parametrize("bits", [np.ones(27, dtype=bool), np.arange(27) == 0])
def test_levels_at_other_rates(rate_hz: float, bits: np.ndarray) -> None:
    # The first word keeps the bands fullest, the second sends the tone nearest to the rejecter.
    wave = FmTransmitter(TONES27, 2600.0, rate_hz).block(bits, round(3 * rate_hz))
    levels = ReferenceTrackCodeReceiver(TONES27, 2600.0, rate_hz).feed(wave)[-1].levels
    np.testing.assert_allclose(levels, bits, atol=0.04)


@pytest.mark.parametrize("carrier_hz", [1700.0, 2600.0])
def test_figure_13_demodulated_equals_synthesised(carrier_hz: float) -> None:
    profile = load_profile("three_tones")
    chain = DemodulatorChain(profile, carrier_hz, 16_000.0)
    samples = 48_000
    wave = FmTransmitter(profile, carrier_hz, 16_000.0).block([True] * 3, samples)
    demodulated, amplitude = Demodulator(chain).frame(wave)
    slot = demodulated[-profile.slot_samples :]
    found = receiver_estimator(chain).amplitudes(slot)
    # The modulating wave at the newest sample: A sin(2 pi F t), in phase and size.
    last_s = (samples - 1) / 16_000
    sent = (
        -1j
        * np.array(profile.deviations_hz)
        * np.exp(2j * np.pi * last_s * np.array(profile.tones_hz))
    )
    np.testing.assert_allclose(found, sent, atol=0.02 * 20)
    through = tone_columns(profile.tones_hz, 64.0, slot.size) * chain.gain(profile.tones_hz)
    np.testing.assert_allclose(slot, (through @ sent).real, atol=0.03 * 60)
    assert amplitude == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("hop", [1, 8, 13])
@pytest.mark.parametrize("size", [1, 37, 1600])
def test_blocks_do_not_show(size: int, hop: int) -> None:
    profile = load_profile("tones18")
    rng = np.random.default_rng(5)
    transmitter = FmTransmitter(profile, 2000.0, RATE_HZ)
    wave = np.concatenate([transmitter.block(np.arange(18) == k, 16_000) for k in (3, 9)])
    wave += noise(rng, wave.size, 15.0)
    whole = ReferenceTrackCodeReceiver(profile, 2000.0, RATE_HZ, hop_samples=hop).feed(wave)
    receiver = ReferenceTrackCodeReceiver(profile, 2000.0, RATE_HZ, hop_samples=hop)
    cut = [d for at in range(0, wave.size, size) for d in receiver.feed(wave[at : at + size])]
    assert len(cut) == len(whole) == 320 // hop
    assert {d.fields["tone"] for d in whole if d.fields} == {3, 9}
    for one, other in zip(cut, whole, strict=True):
        assert (one.time_s, one.valid, one.fields, one.reason) == (
            *(other.time_s, other.valid, other.fields),
            other.reason,
        )
        np.testing.assert_array_equal(one.bits, other.bits)
        np.testing.assert_array_equal(one.levels, other.levels)


def test_confirmation_costs_one_hop_each() -> None:
    bits = encode(TONES27, {"speed": 80, "gradient": 1, "block_length": 2, "network": 3})
    wave = FmTransmitter(TONES27, 1700.0, RATE_HZ).block(bits, 25_600)
    first = [
        next(d.time_s for d in receiver.feed(wave) if d.valid)
        for receiver in (
            ReferenceTrackCodeReceiver(TONES27, 1700.0, RATE_HZ, confirmations=count)
            for count in (1, 2, 5)
        )
    ]
    np.testing.assert_allclose(np.diff(first), [0.125, 0.375])
