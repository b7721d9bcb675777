"""Stamps: every tick survives the trip through a double and through the clock message."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosgraph_msgs.msg import Clock

from rail_msgs_py.stamps import (
    NANOSECONDS,
    clock_from_cdr,
    clock_to_cdr,
    seconds_to_ns,
    to_ns,
    to_time,
)


@pytest.mark.parametrize("tick_ms", [10, 20, 25, 33, 50, 100, 125, 200, 333, 500, 999, 1000])
def test_every_tick_of_a_day_survives_the_double(tick_ms: int) -> None:
    tick_ns = tick_ms * 1_000_000
    stamps_ns = np.arange(86_400 * 1000 // tick_ms, dtype=np.int64) * tick_ns
    # NumPy divides, multiplies and rounds doubles as Python does
    back_ns = np.rint((stamps_ns / NANOSECONDS) * NANOSECONDS).astype(np.int64)
    assert np.array_equal(back_ns, stamps_ns)
    for stamp_ns in stamps_ns[:: len(stamps_ns) // 50].tolist():
        assert seconds_to_ns(stamp_ns / NANOSECONDS) == stamp_ns


@given(st.integers(10_000_000, 1_000_000_000), st.integers(0, 100_000))
def test_any_tick_survives_the_double(tick_ns: int, tick: int) -> None:
    stamp_ns = min(tick * tick_ns, 10**15)
    assert seconds_to_ns(stamp_ns / NANOSECONDS) == stamp_ns


@given(st.integers(0, 2**31 * NANOSECONDS - 1))
def test_the_clock_is_that_of_the_middleware(stamp_ns: int) -> None:
    message = deserialize_message(clock_to_cdr(stamp_ns), Clock)
    assert to_ns(message.clock) == stamp_ns
    assert clock_from_cdr(bytes(serialize_message(message))) == stamp_ns
    assert Time(**to_time(stamp_ns)) == message.clock
