"""The time that a message carries, from its bytes: that of the views, and never an exception."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry, Path
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension, String, UInt8MultiArray
from visualization_msgs.msg import MarkerArray

from rail_msgs_py.cdr_stamp import stamp_reader
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.ranging.range_reading import RangeWriter
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import TableWriter
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_msgs_py.train_radio.telegrams import telegrams
from rail_msgs_py.waveform import Waveform, silence

STAMP_NS = 12_300_000_000
KINDS = [Clock, Header, Odometry, Path, Range, DiagnosticArray, DiagnosticStatus, String]
KINDS += [Float64MultiArray, UInt8MultiArray, MarkerArray]


def table(*names: str) -> bytes:
    return TableWriter(("train_a",), names).write(STAMP_NS, np.zeros((1, len(names))))


@pytest.mark.parametrize(
    ("kind", "raw"),
    [
        (Clock, clock_to_cdr(STAMP_NS)),
        (Header, header_to_cdr(STAMP_NS)),
        (Range, RangeWriter("zone1", 0.0, 400.0).write(STAMP_NS, 12.0, 0.1)),
        (
            Odometry,
            PositionWriter("train_a", "main").write(
                Position(STAMP_NS, "train_a", "main", 1.0, 0.5, 20.0, 0.1)
            ),
        ),
        # The numbers behind a label are aligned, however long it is.
        *[(Float64MultiArray, table(*("abcdefgh"[:n] for n in range(1, k)))) for k in range(2, 9)],
        (Float64MultiArray, silence(STAMP_NS, 4e6, 2.4e9, 1).to_cdr()),
        (
            Float64MultiArray,
            Waveform(STAMP_NS, 4e6, 2.4e9, 1, np.ones((2, 7), dtype=np.complex128)).to_cdr(),
        ),
        (UInt8MultiArray, telegrams(STAMP_NS).to_cdr()),
        (UInt8MultiArray, telegrams(STAMP_NS, [(3, bytes(FRAME_BYTES))]).to_cdr()),
    ],
    # Not the bytes themselves: what CDR fills gaps with is any.
    ids=lambda value: value.__name__ if isinstance(value, type) else f"{len(value)} bytes",
)
def test_it_is_the_time_that_was_put_in(kind: Any, raw: bytes) -> None:
    assert stamp_reader(kind)(raw) == STAMP_NS
    assert stamp_reader(kind)(memoryview(raw)) == STAMP_NS


def test_what_carries_no_time_has_none() -> None:
    assert stamp_reader(String)(serialize_message(String(data="/world"))) is None
    assert stamp_reader(DiagnosticStatus)(serialize_message(DiagnosticStatus())) is None
    assert stamp_reader(MarkerArray)(serialize_message(MarkerArray())) is None
    assert stamp_reader(Float64MultiArray)(serialize_message(Float64MultiArray())) is None
    # Somebody else's array, whose first value is none of ours.
    theirs = Float64MultiArray(data=[1.0, 2.0])
    theirs.layout.dim = [MultiArrayDimension(label="x", size=2, stride=2)]
    assert stamp_reader(Float64MultiArray)(serialize_message(theirs)) is None


@pytest.mark.parametrize("stamp_s", [math.nan, math.inf, -1.0, 1e30])
def test_no_time_that_cannot_be(stamp_s: float) -> None:
    message = Float64MultiArray(data=[stamp_s])
    message.layout.data_offset = 1
    assert stamp_reader(Float64MultiArray)(serialize_message(message)) is None


@given(st.sampled_from(KINDS), st.binary(max_size=80), st.booleans())
def test_nonsense_is_read_as_a_time_or_as_none(kind: Any, raw: bytes, headed: bool) -> None:
    stamp_ns = stamp_reader(kind)(b"\x00\x01\x00\x00" * headed + raw)
    assert stamp_ns is None or isinstance(stamp_ns, int)
