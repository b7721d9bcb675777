"""Frames of the train bus: what they look like, what receives them, against closed forms."""

from __future__ import annotations

import math
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.stats import binom

from rail_signals.train_bus.frame import (
    CHECK_BITS,
    BusFrameFormat,
    bit_error_rate,
    checked_payload,
    frame_loss_rate,
    manchester,
)
from rail_signals.train_bus.receiver import BusFrameReceiver

FRAME = BusFrameFormat()
RECEIVER = BusFrameReceiver(FRAME)
GUARD = 100


def bits_of(payload: bytes) -> NDArray[np.bool_]:
    sealed = payload + zlib.crc32(payload).to_bytes(4, "big")
    return np.unpackbits(np.frombuffer(sealed, dtype=np.uint8)).astype(bool)


def late(payload: bytes, delay: float, frame: BusFrameFormat = FRAME) -> NDArray[np.float64]:
    """Block in which a frame begins `delay` samples late, sampled from its formula."""
    halves = np.concatenate((frame.start_halves, manchester(bits_of(payload))))
    each = frame.samples_per_bit // 2
    steps = np.diff(halves, prepend=0.0, append=0.0)
    wave = np.zeros(frame.samples + GUARD)
    for number, step in enumerate(steps):
        if step:
            near = slice(max(0, number * each + int(delay) - 8), number * each + int(delay) + 8)
            places = np.arange(len(wave))[near] + 0.5 - delay - number * each
            wave[near] += step * frame.edge(places)
            wave[near.stop :] += step
    return wave


def test_a_frame_has_the_bits_and_the_levels_that_are_told() -> None:
    assert (FRAME.bits, FRAME.samples) == (16 + 8 + 256 + 32, 312 * 8)
    assert FRAME.sample_rate_hz == 8e6
    payload = bytes(range(32))
    wave = FRAME.waveform(payload)
    assert wave == pytest.approx(late(payload, 0.0)[: FRAME.samples], abs=1e-9)
    # Rectangular edges: every half bit at its level, and no direct current in the data.
    square = BusFrameFormat(rise_time_s=0.0).waveform(payload)
    assert set(square) == {-1.0, 1.0}
    assert square.sum() == 0.0
    assert square[::4].tolist()[48:] == manchester(bits_of(payload)).tolist()


def test_the_delimiter_breaks_the_code_and_looks_like_nothing_else() -> None:
    halves = FRAME.start_halves.reshape(-1, 2)
    violated = halves[:, 0] == halves[:, 1]
    assert not violated[:16].any()
    assert np.count_nonzero(violated) == 4
    word = FRAME.start_halves
    assert max(np.correlate(word, word, "full")[len(word) :]) <= 20.0


@settings(max_examples=12)
@given(payload=st.binary(min_size=32, max_size=32), delay=st.floats(0.0, 60.0))
def test_every_payload_comes_through_at_any_delay(payload: bytes, delay: float) -> None:
    got = RECEIVER.receive(0.3 * late(payload, delay))
    assert got.payload == payload
    assert got.bits.tolist() == bits_of(payload).tolist()
    assert got.delay_s * FRAME.sample_rate_hz == pytest.approx(delay, abs=0.15)
    assert got.level == pytest.approx(0.3, rel=0.04)


def errors(frame: BusFrameFormat, ebn0: float, frames: int, seed: int) -> tuple[int, int]:
    """Wrong bits and bits of frames in white noise."""
    receiver, rng = BusFrameReceiver(frame), np.random.default_rng(seed)
    wrong = count = 0
    for _ in range(frames):
        payload = rng.bytes(32)
        wave = np.concatenate((frame.waveform(payload), np.zeros(GUARD)))
        sigma = math.sqrt(wave @ wave / frame.bits / (2.0 * ebn0))
        got = receiver.receive(wave + sigma * rng.standard_normal(len(wave)))
        assert got.detected
        assert got.payload in (None, payload)
        wrong += int(np.count_nonzero(got.bits != bits_of(payload)))
        count += len(got.bits)
    return wrong, count


def test_the_bit_error_rate_is_the_closed_form() -> None:
    for ebn0_db, frames in ((3.0, 100), (5.0, 300)):
        ebn0 = 10.0 ** (ebn0_db / 10.0)
        wrong, count = errors(BusFrameFormat(rise_time_s=0.0), ebn0, frames, seed=5)
        low, high = binom.interval(0.9999, count, float(bit_error_rate(ebn0)))
        assert low <= wrong <= high


def test_finite_edges_and_an_unknown_start_cost_less_than_half_a_decibel() -> None:
    ebn0 = 10.0**0.5
    wrong, count = errors(FRAME, ebn0, 300, seed=6)
    assert binom.ppf(1e-4, count, float(bit_error_rate(ebn0))) <= wrong
    assert wrong <= binom.ppf(1.0 - 1e-4, count, float(bit_error_rate(ebn0 * 10.0**-0.05)))


def test_closed_forms_in_their_limits() -> None:
    assert float(bit_error_rate(0.0)) == 0.5
    assert float(bit_error_rate(10.0)) == pytest.approx(3.87210822e-6, rel=1e-6)
    rate = float(bit_error_rate(8.0))
    assert float(frame_loss_rate(8.0, 1)) == pytest.approx(rate)
    assert float(frame_loss_rate(8.0, 288)) == pytest.approx(1.0 - (1.0 - rate) ** 288)
    with pytest.raises(ValueError, match=r"ebn0 must be 0 or more, got -1"):
        bit_error_rate(-1.0)


@pytest.mark.parametrize("ebn0_db", [8.0, 12.0, 16.0])
def test_the_receiver_measures_its_own_margin(ebn0_db: float) -> None:
    rng = np.random.default_rng(8)
    ratios = []
    for _ in range(20):
        wave = np.concatenate((FRAME.waveform(rng.bytes(32)), np.zeros(GUARD)))
        sigma = math.sqrt(wave @ wave / FRAME.bits / (2.0 * 10.0 ** (ebn0_db / 10.0)))
        ratios.append(RECEIVER.receive(wave + sigma * rng.standard_normal(len(wave))).ebn0)
    assert 10.0 * math.log10(np.mean(ratios)) == pytest.approx(ebn0_db, abs=0.8)


NOT_FRAMES = {
    "empty": np.zeros(0),
    "zeros": np.zeros(2600),
    "constant": np.ones(2600),
    "NaN": np.full(2600, np.nan),
    "infinite": np.full(2600, np.inf),
    "huge": np.full(2600, 1e300),
    "too short": FRAME.waveform(bytes(32))[:-1],
    "two dimensions": np.zeros((2, 2600)),
    "inverted": -late(bytes(32), 3.0),
    "noise": np.random.default_rng(3).standard_normal(2600),
}


@pytest.mark.parametrize("kind", NOT_FRAMES)
def test_what_is_no_frame_is_not_taken_for_one(kind: str) -> None:
    with np.errstate(all="raise"):
        got = RECEIVER.receive(NOT_FRAMES[kind])
    assert got.payload is None


def test_one_bad_sample_is_enough_and_a_clipped_frame_still_reads() -> None:
    payload = bytes(range(32))
    wave = late(payload, 5.3)
    assert RECEIVER.receive(np.clip(wave, -0.2, 0.2)).payload == payload
    wave[1000] = np.nan
    assert RECEIVER.receive(wave).payload is None


@given(
    payload=st.binary(min_size=32, max_size=32),
    flips=st.sets(st.integers(0, FRAME.data_bits - 1), min_size=1, max_size=40),
)
def test_wrong_bits_make_a_frame_invalid_never_another_one(payload: bytes, flips: set[int]) -> None:
    bits = bits_of(payload)
    bits[list(flips)] ^= True
    assert checked_payload(bits) is None


def test_frames_of_another_length_are_no_frames() -> None:
    short = BusFrameFormat(payload_bytes=16)
    wave = np.concatenate((short.waveform(bytes(16)), np.zeros(FRAME.samples)))
    assert RECEIVER.receive(wave).payload is None
    longer = BusFrameFormat(payload_bytes=48)
    assert RECEIVER.receive(longer.waveform(bytes(48))).payload is None
    assert checked_payload(np.zeros(CHECK_BITS, dtype=bool)) is None
    assert checked_payload(np.zeros(101, dtype=bool)) is None


@pytest.mark.parametrize(
    ("wrong", "bus_line"),
    [
        ({"payload_bytes": 0}, "payload_bytes must be from 1 to 1024, got 0"),
        ({"bit_rate_hz": math.nan}, "bit_rate_hz must be above 0, got nan"),
        ({"samples_per_bit": 5}, "samples_per_bit must be even and 4 or more, got 5"),
        ({"rise_time_s": 1e-6}, "rise_time_s must be from 0 to half a bit"),
    ],
)
def test_a_wrong_format_is_named(wrong: dict[str, float], bus_line: str) -> None:
    with pytest.raises(ValueError, match=bus_line):
        BusFrameFormat(**wrong)  # type: ignore[arg-type]


def test_a_wrong_payload_or_receiver_is_named() -> None:
    with pytest.raises(ValueError, match="payload must have 32 bytes, got 31"):
        FRAME.waveform(bytes(31))
    with pytest.raises(ValueError, match="longest_delay_s must be 0 or more, got -1"):
        BusFrameReceiver(FRAME, longest_delay_s=-1.0)
    with pytest.raises(ValueError, match="least_correlation must be between 0 and 1, got 1"):
        BusFrameReceiver(FRAME, least_correlation=1.0)
