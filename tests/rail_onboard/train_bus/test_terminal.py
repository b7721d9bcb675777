"""Messages between head and tail, and what a terminal counts of them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_msgs_py.topics.train_bus import BUS_LINK
from rail_onboard.train_bus.message import NONE, PATTERN, PAYLOAD_BYTES, BusMessage, pattern_errors
from rail_onboard.train_bus.terminal import BusTerminal
from rail_signals.train_bus.receiver import NOT_DETECTED, ReceivedFrame

TICK_S = 0.25


@given(
    end=st.sampled_from(["head", "tail"]),
    tick=st.integers(0, NONE - 1),
    heard=st.none() | st.integers(0, NONE - 1),
    lost=st.integers(0, NONE - 1),
)
def test_a_message_comes_back_as_it_was(end: str, tick: int, heard: int | None, lost: int) -> None:
    message = BusMessage(end, tick, heard, lost)  # type: ignore[arg-type]
    raw = message.to_bytes()
    assert len(raw) == PAYLOAD_BYTES
    assert BusMessage.from_bytes(raw) == message


@given(raw=st.binary(min_size=0, max_size=40))
def test_anything_else_is_refused(raw: bytes) -> None:
    with pytest.raises(ValueError, match="not a message of the bus"):
        BusMessage.from_bytes(raw)


def test_a_message_with_any_byte_changed_is_another_one_or_none() -> None:
    message = BusMessage("tail", 7, 6, 0)
    raw = message.to_bytes()
    for at in range(len(raw)):
        other = raw[:at] + bytes([raw[at] ^ 0x40]) + raw[at + 1 :]
        try:
            assert BusMessage.from_bytes(other) != message
        except ValueError:
            continue


def test_the_pattern_is_a_maximal_length_sequence() -> None:
    bits = np.unpackbits(np.frombuffer(PATTERN, dtype=np.uint8))
    assert all(bits[n] == bits[n - 7] ^ bits[n - 6] for n in range(7, 128))
    sequence = 1.0 - 2.0 * bits[:127]
    circular = [float(sequence @ np.roll(sequence, k)) for k in range(1, 127)]
    assert set(circular) == {-1.0}


def frame(payload: bytes | None, flips: int = 0, ebn0: float = 100.0) -> ReceivedFrame:
    """What a receiver makes of a payload, with wrong bits in its pattern."""
    raw = payload if payload is not None else BusMessage("tail", 0, None, 0).to_bytes()
    bits = np.concatenate(
        (np.unpackbits(np.frombuffer(raw, dtype=np.uint8)).astype(bool), np.zeros(32, bool))
    )
    bits[200 : 200 + flips] ^= True
    return ReceivedFrame(None if flips else payload, True, 0.0, 1.0, ebn0, bits)


def test_wrong_bits_of_the_pattern_are_counted() -> None:
    assert pattern_errors(frame(None).bits) == (0, 128)
    assert pattern_errors(frame(None, flips=5).bits) == (5, 128)


def named(terminal: BusTerminal, tick: int) -> dict[str, float]:
    return dict(zip(BUS_LINK.columns, terminal.link_values(tick), strict=True))


def test_head_and_tail_confirm_each_other() -> None:
    head, tail = BusTerminal("head", TICK_S, 1.0), BusTerminal("tail", TICK_S, 1.0)
    for tick in range(4):
        down, up = head.payload(tick), tail.payload(tick)
        head.take(tick, frame(up))
        tail.take(tick, frame(down))
    assert named(head, 3) == {
        **{"sent": 4.0, "received": 4.0, "lost": 0.0, "bits": 512.0, "bit_errors": 0.0},
        **{"ebn0_db": 20.0, "other_end": 1.0},
        # The answer in tick 3 is to what the head said in tick 2.
        "other_end_age_s": TICK_S,
    }
    assert named(tail, 3)["other_end_age_s"] == 0.0
    assert not head.loses(3)


def test_the_end_of_the_train_is_not_confirmed_by_a_tail_that_hears_nothing() -> None:
    head, tail = BusTerminal("head", TICK_S, 1.0), BusTerminal("tail", TICK_S, 1.0)
    for tick in range(8):
        up = tail.payload(tick)
        head.take(tick, frame(up))
        tail.take(tick, NOT_DETECTED)
    assert head.lost == 0
    assert not head.is_confirmed(7)
    assert math.isinf(head.age_s(7))
    assert tail.lost == 8


def test_what_is_lost_is_counted_and_confirmation_ages() -> None:
    head, tail = BusTerminal("head", TICK_S, 1.0), BusTerminal("tail", TICK_S, 1.0)
    for tick in range(12):
        down, up = head.payload(tick), tail.payload(tick)
        gone = tick >= 4
        head.take(tick, frame(up, flips=3 if gone else 0))
        tail.take(tick, NOT_DETECTED if gone else frame(down))
        assert head.is_confirmed(tick) == (1 <= tick <= 6)
        assert head.loses(tick) == gone
    found = named(head, 11)
    assert (found["received"], found["lost"], found["bit_errors"]) == (4.0, 8.0, 24.0)
    assert found["other_end_age_s"] == (11 - 2) * TICK_S
    assert math.isnan(named(tail, 11)["ebn0_db"])
    assert named(tail, 11)["bits"] == 512.0


def test_a_stale_frame_or_ones_own_is_not_a_message() -> None:
    head, tail = BusTerminal("head", TICK_S, 1.0), BusTerminal("tail", TICK_S, 1.0)
    old = tail.payload(0)
    head.take(0, frame(old))
    head.take(1, frame(old))
    head.take(2, frame(head.payload(2)))
    head.take(3, frame(bytes(PAYLOAD_BYTES)))
    assert (head.received, head.lost) == (1, 3)
