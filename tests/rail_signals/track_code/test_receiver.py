"""The fast receiver decides as the document's chain does, however its input is cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rail_signals.track_code.block_demodulator import BlockDemodulator
from rail_signals.track_code.decision import Decision
from rail_signals.track_code.demodulator import Demodulator, DemodulatorChain
from rail_signals.track_code.profile import TrackCodeProfile, load_profile
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.reference_receiver import ReferenceTrackCodeReceiver
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import encode

TONES27 = load_profile("tones27")


def words(rng: np.random.Generator, profile: TrackCodeProfile, count: int) -> list[np.ndarray]:
    """Random words; fields are not zero, so that a tone is sent."""
    found = []
    for _ in range(count):
        fields = {
            name: int(rng.integers(profile.tones if profile.coding == "one_of_n" else 2**bits))
            for name, bits in profile.fields
            if name != "crc"
        }
        found.append(encode(profile, {k: v or 1 for k, v in fields.items()}))
    return found


def wave_of(
    rng: np.random.Generator,
    profile: TrackCodeProfile,
    rate_hz: float,
    *,
    carrier_hz: float = 1700.0,
    seconds: float = 3.2,
    count: int = 2,
    noise: float = 0.1,
) -> np.ndarray:
    """Words one after the other, in noise of the given standard deviation."""
    sender = FmTransmitter(profile, carrier_hz, rate_hz)
    samples = round(seconds * rate_hz)
    wave = np.concatenate([sender.block(w, samples) for w in words(rng, profile, count)])
    return np.asarray(wave + rng.normal(scale=noise, size=wave.size))


def assert_same(fast: list[Decision], slow: list[Decision], level: float = 5e-3) -> None:
    assert len(fast) == len(slow)
    for a, b in zip(fast, slow, strict=True):
        assert a.time_s == b.time_s
        assert (a.valid, a.fields, a.reason) == (b.valid, b.fields, b.reason), a.time_s
        assert a.bits.tolist() == b.bits.tolist()
        assert a.levels == pytest.approx(b.levels, abs=level, nan_ok=True)


@pytest.mark.parametrize(
    ("name", "rate_hz", "carrier_hz"),
    [
        ("tones27", 16_000.0, 1700.0),
        ("tones27", 48_000.0, 2600.0),
        ("tones18", 16_000.0, 2300.0),
        ("three_tones", 6400.0, 2000.0),
    ],
)
def test_every_decision_is_that_of_the_chain(name: str, rate_hz: float, carrier_hz: float) -> None:
    rng = np.random.default_rng(1)
    profile = load_profile(name)
    wave = wave_of(rng, profile, rate_hz, carrier_hz=carrier_hz)
    fast = TrackCodeReceiver(profile, carrier_hz, rate_hz).feed(wave)
    slow = ReferenceTrackCodeReceiver(profile, carrier_hz, rate_hz).feed(wave)
    assert_same(fast, slow)
    assert sum(d.valid for d in fast) > len(fast) / 4


def test_decisions_do_not_depend_on_the_blocks() -> None:
    rng = np.random.default_rng(2)
    wave = wave_of(rng, TONES27, 16_000.0).astype(np.float32)
    whole = TrackCodeReceiver(TONES27, 1700.0, 16_000.0).feed(wave)
    receiver = TrackCodeReceiver(TONES27, 1700.0, 16_000.0)
    cuts = np.sort(rng.integers(0, wave.size, 60))
    pieces = [d for block in np.split(wave, cuts) for d in receiver.feed(block)]
    assert receiver.feed(np.zeros(0)) == []
    assert_same(pieces, whole, level=0.0)


def test_a_level_in_no_window_is_no_word() -> None:
    profile = load_profile("tones18")
    middle = (profile.absent_max + profile.present_min) / 2 + 0.02
    weak = replace(profile, deviations_hz=tuple(middle * d for d in profile.deviations_hz))
    wave = FmTransmitter(weak, 2000.0, 6400.0).block(np.arange(18) == 4, 19200)
    fast = TrackCodeReceiver(profile, 2000.0, 6400.0).feed(wave)
    assert_same(fast, ReferenceTrackCodeReceiver(profile, 2000.0, 6400.0).feed(wave))
    assert fast[-1].bits.tolist() == (np.arange(18) == 4).tolist()
    assert not fast[-1].valid
    assert fast[-1].reason.endswith("is in no window")


def test_hops_of_other_lengths() -> None:
    wave = wave_of(np.random.default_rng(3), TONES27, 16_000.0)
    for hop in (5, 32):
        fast = TrackCodeReceiver(TONES27, 1700.0, 16_000.0, hop_samples=hop, confirmations=1)
        slow = ReferenceTrackCodeReceiver(
            TONES27, 1700.0, 16_000.0, hop_samples=hop, confirmations=1
        )
        assert_same(fast.feed(wave), slow.feed(wave))


def test_faults_of_the_input_are_told_as_by_the_chain() -> None:
    wave = wave_of(np.random.default_rng(4), TONES27, 16_000.0, seconds=8.0, count=2)
    wave[60_000] = np.nan
    wave[100_000:104_000] = np.clip(3 * wave[100_000:104_000], -1, 1)
    wave[140_000:160_000] = 0.0
    wave[200_000] = -1e9
    wave[240_000:250_000] *= 1e-5
    fast = TrackCodeReceiver(TONES27, 1700.0, 16_000.0).feed(wave)
    slow = ReferenceTrackCodeReceiver(TONES27, 1700.0, 16_000.0).feed(wave)
    reasons = {d.reason for d in fast}
    assert {
        "samples are not finite",
        "samples are clipped",
        "samples exceed 1e+06",
        "no carrier",
    } <= reasons
    # After a jump of 50 dB single precision keeps less of what was small.
    assert_same(fast, slow, level=0.02)


def test_reset_starts_anew() -> None:
    wave = wave_of(np.random.default_rng(5), TONES27, 16_000.0)
    receiver = TrackCodeReceiver(TONES27, 1700.0, 16_000.0)
    first = receiver.feed(wave[:70_123])
    receiver.reset()
    assert_same(receiver.feed(wave[:70_123]), first, level=1e-9)


def test_arrays_of_decisions_are_read_only() -> None:
    wave = wave_of(np.random.default_rng(6), TONES27, 16_000.0, count=1)
    for decision in TrackCodeReceiver(TONES27, 1700.0, 16_000.0).feed(wave):
        assert not decision.bits.flags.writeable
        assert not decision.levels.flags.writeable


@pytest.mark.parametrize("rate_hz", [5120.0, 16_000.0, 48_000.0])
def test_the_demodulated_wave_is_that_of_the_chain(rate_hz: float) -> None:
    rng = np.random.default_rng(7)
    chain = DemodulatorChain(TONES27, 1700.0, rate_hz)
    hops = round(rate_hz / 8)
    wave = wave_of(rng, TONES27, rate_hz, seconds=3.0, noise=0.05).reshape(-1, hops)
    found, amplitude, _ = BlockDemodulator(chain, 8).demodulate(wave.astype(np.float32))
    slow = Demodulator(chain)
    frames = [slow.frame(frame) for frame in wave]
    # The step out of silence has any angle, and the DC rejecter takes two seconds to forget it.
    settled = slice(16, None)
    wanted = np.array([f[0] for f in frames])[settled]
    # 64 dB below the wave, whose deviation is some 15 Hz in root mean square.
    assert np.sqrt(np.mean((found[settled] - wanted) ** 2)) < 0.01
    assert amplitude[settled] == pytest.approx([f[1] for f in frames][settled], rel=5e-3)


@pytest.mark.parametrize("samples", [np.zeros((2, 3)), np.zeros(3, dtype=int), np.zeros(3, "c16")])
def test_what_is_no_wave_is_refused(samples: np.ndarray) -> None:
    with pytest.raises(ValueError, match="real floats in one dimension"):
        TrackCodeReceiver(TONES27, 1700.0, 16_000.0).feed(samples)
