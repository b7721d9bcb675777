"""Simulated time as integer nanoseconds, and its two forms on the wire."""

from __future__ import annotations

import struct
from typing import Any, Final

NANOSECONDS: Final = 1_000_000_000
_CLOCK = struct.Struct("<4siI")
CDR_LITTLE_ENDIAN: Final = b"\x00\x01\x00\x00"


def to_ns(stamp: Any) -> int:
    """Nanoseconds of a ``builtin_interfaces/Time``."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def to_time(stamp_ns: int) -> dict[str, int]:
    """Keyword arguments of a ``builtin_interfaces/Time`` for ``stamp_ns``."""
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return {"sec": sec, "nanosec": nanosec}


def seconds_to_ns(time_s: float) -> int:
    """Nearest nanosecond: every tick stamp survives the trip through a double.

    >>> seconds_to_ns(0.1 * 3)
    300000000
    """
    return round(time_s * NANOSECONDS)


def clock_to_cdr(stamp_ns: int) -> bytes:
    """Serialised ``rosgraph_msgs/Clock``.

    >>> clock_from_cdr(clock_to_cdr(12_345_678_901))
    12345678901
    """
    sec, nanosec = divmod(stamp_ns, NANOSECONDS)
    return _CLOCK.pack(CDR_LITTLE_ENDIAN, sec, nanosec)


def clock_from_cdr(raw: bytes | memoryview) -> int:
    """Nanoseconds of a serialised ``rosgraph_msgs/Clock`` or of a leading ``std_msgs/Header``."""
    _, sec, nanosec = _CLOCK.unpack_from(raw)
    return int(sec) * NANOSECONDS + int(nanosec)
