"""Telegrams of a tick on the wire."""

import pytest
from rclpy.serialization import deserialize_message
from std_msgs.msg import UInt8MultiArray

from rail_msgs_py.train_radio.telegrams import Telegrams, telegrams

FRAMES = ((1, bytes(range(64))), (300, bytes(64)), (1, b"\xff" * 64))


@pytest.mark.parametrize("frames", [(), FRAMES])
def test_there_and_back(frames: tuple[tuple[int, bytes], ...]) -> None:
    batch = Telegrams(1_250_000_000, frames)
    assert Telegrams.from_cdr(batch.to_cdr()) == batch
    assert Telegrams.from_msg(batch.to_msg()) == batch


def test_stock_tools_can_read_it() -> None:
    message = deserialize_message(telegrams(5, FRAMES).to_cdr(), UInt8MultiArray)
    assert [(dim.label, dim.size) for dim in message.layout.dim] == [("telegram", 3), ("byte", 66)]
    assert bytes(message.data[10:74]) == FRAMES[0][1]


def test_frames_of_a_slot() -> None:
    assert Telegrams(0, FRAMES).in_slot(1) == [FRAMES[0][1], FRAMES[2][1]]
    assert Telegrams(0, FRAMES).in_slot(2) == []


def test_the_newest_frame_of_each_slot_that_is_there() -> None:
    batch = Telegrams(0, (*FRAMES, (0, bytes(64)), (2, b"\1" * 64)))
    assert batch.newest(2) == {1: FRAMES[2][1], 2: b"\1" * 64}
    assert batch.newest(300).keys() == {1, 2, 300}
    assert Telegrams(0, ()).newest(8) == {}


def test_other_lengths_and_layouts_are_refused() -> None:
    with pytest.raises(ValueError, match="64 bytes, got 3"):
        Telegrams(0, ((1, b"abc"),)).to_msg()
    message = Telegrams(0, FRAMES).to_msg()
    message.data = message.data[:-1]
    with pytest.raises(ValueError, match="205 bytes for 3 of 66"):
        Telegrams.from_msg(message)
    with pytest.raises(ValueError, match="not telegrams"):
        Telegrams.from_msg(UInt8MultiArray())
