"""Frames in slots, there and back."""

import numpy as np
import pytest

from rail_signals.train_radio.burst import RadioBurstFormat, RadioBurstReceiver
from rail_signals.train_radio.slots import BEACON_SLOT, RadioSlots, bits_of, frame_of
from rail_signals.train_radio.space_time_block import scheme
from rail_signals.train_radio.symbol_mapping import constellation

BURST = RadioBurstFormat(scheme("alamouti_2x2"), constellation("qpsk"), 512, samples_per_symbol=2)
SLOTS = RadioSlots(BURST, 3)


def test_what_is_sent_in_a_slot_is_found_there_and_nowhere_else() -> None:
    rng = np.random.default_rng(3)
    frames = {slot: rng.bytes(64) for slot in (BEACON_SLOT, 2)}
    block = SLOTS.block(frames)
    assert block.shape == (2, SLOTS.samples)
    channel = np.array([[1.0, 0.3j], [0.2, -0.8]])
    found = RadioBurstReceiver(BURST).receive(SLOTS.cut(channel @ block))
    assert found.detected.tolist() == [True, False, True, False]
    assert {slot: frame_of(found.bits[slot]) for slot in frames} == frames


def test_a_block_without_frames_is_silent() -> None:
    assert not SLOTS.block({}).any()


def test_bytes_and_bits() -> None:
    frames = [bytes(range(64)), bytes(64)]
    assert [frame_of(bits) for bits in bits_of(frames)] == frames


def test_slots_do_not_overlap() -> None:
    spans = [SLOTS.span(slot) for slot in range(SLOTS.count)]
    assert [end for _, end in spans[:-1]] == [first for first, _ in spans[1:]]
    assert spans[0][0] == 0 and spans[-1][1] == SLOTS.samples
    assert SLOTS.duration_s == pytest.approx(4 * BURST.duration_s)


@pytest.mark.parametrize("slot", [-1, 4])
def test_there_is_no_other_slot(slot: int) -> None:
    with pytest.raises(ValueError, match=f"slot must be from 0 to 3, got {slot}"):
        SLOTS.span(slot)


def test_what_slots_are_made_of_is_checked() -> None:
    with pytest.raises(ValueError, match="trains must be 1 or more, got 0"):
        RadioSlots(BURST, 0)
    odd = RadioBurstFormat(scheme("siso"), constellation("bpsk"), 10)
    with pytest.raises(ValueError, match="whole bytes, got 10"):
        RadioSlots(odd, 1)
