"""Messages in words: each view that a topic may have, and what is of no known kind."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from std_msgs.msg import Float64MultiArray, String

from rail_corridor.cli.decoded import decode
from rail_corridor.equipment.registry import topics
from rail_msgs_py.map_pose import MapPose
from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.table import Table
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import Waveform

STAMP_NS = 2_500_000_000
SHOWN: dict[type, tuple[Any, str]] = {
    MapPose: (
        MapPose(STAMP_NS, 10.0, -2.5, 3.0, 0.5, 0.01, 0.04),
        "x 10.00 m, y -2.50 m, z 3.00 m ± 0.200 m along, heading 28.6°, +10.0 ‰",
    ),
    Position: (
        Position(STAMP_NS, "train_a", "main", 120.5, 0.04, 20.0, 0.1),
        "train_a on main: 120.500 m ± 0.200 m, 72.0 km/h",
    ),
    RangeReading: (
        RangeReading(STAMP_NS, "zone1", 55.5, 0.01, 0.0, 400.0),
        "zone1: 55.500 m ± 0.100 m",
    ),
    Table: (Table(STAMP_NS, ("train_a",), ("speed_mps",), np.array([[20.0]])), "speed_mps 20"),
    Telegrams: (Telegrams(STAMP_NS, ((3, bytes(FRAME_BYTES)),)), f"slot 3: {'00' * FRAME_BYTES}"),
    Waveform: (Waveform(STAMP_NS, 4e6, 2.4e9, 1, np.full((1, 8), 0.1 + 0j)), "1 x 8 samples"),
}


@pytest.mark.parametrize("view", sorted({t.view for t in topics() if t.view}, key=str), ids=str)
def test_every_view_of_a_topic_is_put_into_words(view: type) -> None:
    shown, words = SHOWN[view]
    topic = next(topic for topic in topics() if topic.view is view)
    parts = ("train", "site", "zone", "base", "supervision", "channel", "source")
    text = decode(topic.name(**dict.fromkeys(parts, "x")), shown.to_msg())
    assert text.startswith("     2.500 s  ")
    assert words in text


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (Position(0, "train_a", "main", 7.0, float("inf"), 0.0, 0.0), "not known (last 7.0 m)"),
        (RangeReading(0, "zone1", float("nan"), 0.0, 0.0, 1.0), "zone1: disturbed"),
        (RangeReading(0, "zone1", float("inf"), 0.0, 0.0, 1.0), "zone1: no signal"),
    ],
)
def test_what_is_not_known_is_said_to_be_so(message: Any, words: str) -> None:
    assert words in message.describe()


def test_messages_that_are_not_what_their_topic_carries_are_shown_field_by_field() -> None:
    text = decode("/train_a/odometer", Float64MultiArray(data=[1.0]))
    assert text.startswith("(") and "data: [1.0]" in text
    assert decode("/else", String(data="so")) == "data: 'so'"
