"""Ranges, positions, tables and headers: message, view and serialised bytes say the same."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Range
from std_msgs.msg import Float64MultiArray, Header, MultiArrayDimension

from rail_msgs_py import position, table
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.ranging.range_reading import RangeReading, RangeWriter, range_from_cdr
from rail_msgs_py.stamps import clock_from_cdr, to_ns
from rail_msgs_py.table import Table, TableWriter

# Stamps are 32 bit of seconds; names of every length modulo the alignment of CDR.
STAMPS = st.integers(0, 2**31 * 10**9 - 1)
NAMES = st.text(st.characters(min_codepoint=33, max_codepoint=0x24F), min_size=0, max_size=20)
SINGLE = st.floats(width=32)
DOUBLE = st.floats(width=64)


def same(one: Any, other: Any) -> bool:
    """Whether two frozen views are equal, NaN being equal to NaN."""
    a, b = vars(one), vars(other)
    return a.keys() == b.keys() and all(
        a[key] == b[key] or (a[key] != a[key] and b[key] != b[key]) for key in a
    )


@given(st.builds(RangeReading, STAMPS, NAMES, SINGLE, SINGLE, SINGLE, SINGLE))
def test_a_range_in_all_its_forms(reading: RangeReading) -> None:
    raw = bytes(serialize_message(reading.to_msg()))
    writer = RangeWriter(reading.zone, reading.min_range_m, reading.max_range_m)
    written = writer.write(reading.stamp_ns, reading.range_m, reading.variance_m2)
    assert same(RangeReading.from_msg(reading.to_msg()), reading)
    assert same(RangeReading.from_cdr(raw), reading)
    assert same(RangeReading.from_cdr(written), reading)
    assert same(RangeReading.from_msg(deserialize_message(written, Range)), reading)


#: What a station computes, with one digit more than the message can carry.
COMPUTED = st.sampled_from([math.inf, math.nan, 0.1, 123.456789012345, -1e-40, 3.4e38])


@given(STAMPS, COMPUTED, COMPUTED)
def test_a_range_is_the_same_in_the_process_and_outside(
    stamp_ns: int, range_m: float, variance_m2: float
) -> None:
    view = RangeWriter("zone1", 0.0, 400.0).view(stamp_ns, range_m, variance_m2)
    np.testing.assert_equal(tuple(view)[:3], range_from_cdr(view.to_cdr()))


@pytest.mark.parametrize(
    ("range_m", "usable", "disturbed"),
    [(12.5, True, False), (-1.0, True, False), (math.inf, False, False), (math.nan, False, True)],
)
def test_special_ranges_mean_what_rep_117_says(
    range_m: float, usable: bool, disturbed: bool
) -> None:
    reading = RangeReading(0, "zone1", range_m, 1.0, 0.0, 200.0)
    assert (reading.usable, reading.disturbed) == (usable, disturbed)


def test_a_range_has_a_radiation_type_that_the_message_defines() -> None:
    raw = RangeWriter("zone1", 0.0, 400.0).write(0, 12.0, 0.25)
    for message in (RangeReading.from_cdr(raw).to_msg(), deserialize_message(raw, Range)):
        assert message.radiation_type == Range.INFRARED


def test_a_range_names_its_zone_and_its_unambiguous_interval() -> None:
    message = RangeReading(1_250_000_000, "zone1", 120.5, 0.25, -20.0, 379.75).to_msg()
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 250_000_000)
    assert message.header.frame_id == "zone1"
    assert (message.range, message.variance) == (120.5, 0.25)
    assert (message.min_range, message.max_range) == (-20.0, 379.75)


@given(st.builds(Position, STAMPS, NAMES, NAMES, DOUBLE, DOUBLE, DOUBLE, DOUBLE))
def test_a_position_in_all_its_forms(place: Position) -> None:
    written = PositionWriter(place.train, place.track).write(place)
    for raw in (place.to_cdr(), written):
        assert same(Position.from_msg(deserialize_message(raw, Odometry)), place)
        stamp_ns, track, values = position.position_from_cdr(raw)
        read = Position(stamp_ns, place.train, track, *values)
        assert same(read, place)
        assert same(Position.from_cdr(raw), place)


def test_a_position_writer_leaves_nothing_of_the_last_one() -> None:
    writer = PositionWriter("train_a", "main")
    writer.write(Position(9, "train_a", "main", math.nan, math.inf, math.nan, math.inf))
    place = Position(10, "train_a", "main", 1.5, 0.25, -20.0, 0.5)
    assert deserialize_message(writer.write(place), Odometry) == place.to_msg()


def test_a_position_lies_in_the_frame_of_its_track() -> None:
    message = Position(0, "train_a", "main", 812.5, 0.04, 22.0, 0.01).to_msg()
    assert (message.header.frame_id, message.child_frame_id) == ("main", "train_a")
    assert message.pose.pose.position.x == 812.5
    assert message.twist.twist.linear.x == 22.0
    assert message.pose.covariance[0] == 0.04
    assert message.pose.pose.orientation.w == 1.0


def test_a_position_of_infinite_variance_is_not_known() -> None:
    assert Position(0, "t", "main", 1.0, 4.0, 0.0, 1.0).known
    assert not Position(0, "t", "main", 1.0, math.inf, 0.0, math.inf).known


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Any table: without rows or columns, and every number included."""
    names = st.text(st.characters(codec="ascii", categories=["L", "N"]), min_size=1, max_size=8)
    rows, columns = (tuple(draw(st.lists(names, max_size=4, unique=True))) for _ in range(2))
    values = draw(hnp.arrays(np.float64, (len(rows), len(columns)), elements=DOUBLE))
    return Table(draw(st.integers(0, 10**15)), rows, columns, values)


@given(tables())
def test_a_table_in_all_its_forms(written: Table) -> None:
    raw = TableWriter(written.rows, written.columns).write(written.stamp_ns, written.values)
    for message in (written.to_msg(), deserialize_message(raw, Float64MultiArray)):
        read = Table.from_msg(message)
        assert (read.stamp_ns, read.rows, read.columns) == (
            written.stamp_ns,
            written.rows,
            written.columns,
        )
        assert np.array_equal(read.values, written.values, equal_nan=True)
    stamp_ns, values = table.values_from_cdr(raw, *written.values.shape)
    assert stamp_ns == written.stamp_ns
    assert np.array_equal(values, written.values, equal_nan=True)


def test_a_row_of_a_table_by_name() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    rows = Table(0, ("train_a", "train_b"), ("x_m", "speed_mps"), values)
    assert rows.row("train_b") == {"x_m": 3.0, "speed_mps": 4.0}
    with pytest.raises(ValueError):
        rows.row("train_c")


def test_table_data_begin_with_the_stamp() -> None:
    raw = TableWriter(("a",), ("x_m", "y_m")).write(2_500_000_000, np.array([[1.0, -1.0]]))
    assert np.frombuffer(raw[-24:], np.float64).tolist() == [2.5, 1.0, -1.0]


@pytest.mark.parametrize(
    ("dims", "values", "offset"),
    [
        ([], 1, 1),
        ([("a", 1)], 2, 1),
        ([("a", 1), ("x_m", 1), ("more", 1)], 2, 1),
        ([("a", 1), ("x_m", 1)], 2, 0),
        ([("a", 1), ("x_m", 1)], 3, 1),
        ([("a,b", 1), ("x_m", 1)], 2, 1),
        ([("", 1), ("x_m", 1)], 2, 1),
    ],
)
def test_foreign_layouts_are_no_table(
    dims: list[tuple[str, int]], values: int, offset: int
) -> None:
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(label=label, size=size) for label, size in dims]
    message.layout.data_offset = offset
    message.data = [0.0] * values
    with pytest.raises(ValueError, match="not a table"):
        Table.from_msg(message)


@given(STAMPS)
def test_a_bare_header_carries_the_stamp(stamp_ns: int) -> None:
    raw = header_to_cdr(stamp_ns)
    header = deserialize_message(raw, Header)
    assert (to_ns(header.stamp), header.frame_id) == (stamp_ns, "")
    assert clock_from_cdr(raw) == stamp_ns
    # a header that somebody else wrote, with a frame name
    header.frame_id = "world"
    assert clock_from_cdr(bytes(serialize_message(header))) == stamp_ns
