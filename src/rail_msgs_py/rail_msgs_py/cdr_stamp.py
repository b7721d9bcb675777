"""The simulated time that a serialised message carries, read without deserialising it."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any, Final

from .message_definition import type_name
from .stamps import CDR_LITTLE_ENDIAN, clock_from_cdr, seconds_to_ns

#: Serialised messages, or a view of them.
Raw = bytes | memoryview
#: Reads the stamp [ns] of a message; None if it has none, 0 if it is not set.
StampReader = Callable[[Raw], int | None]

_U32: Final = struct.Struct("<I")
_F64: Final = struct.Struct("<d")
_I64: Final = struct.Struct("<q")
_LATEST_S: Final = 1e9
_MOST_DIMENSIONS: Final = 16


def stamp_reader(message: Any) -> StampReader:
    """Reader of the stamps of a message class.

    A leading header or time is read; of multi-arrays the values in front of the data, which the
    views of this package put there.

    >>> from rosgraph_msgs.msg import Clock
    >>> from rail_msgs_py.stamps import clock_to_cdr
    >>> stamp_reader(Clock)(clock_to_cdr(1_500_000_000))
    1500000000
    """
    name = type_name(message)
    if name == "std_msgs/msg/Float64MultiArray":
        return _of_floats
    if name == "std_msgs/msg/UInt8MultiArray":
        return _of_bytes
    first = next(iter(message.get_fields_and_field_types().values()), "")
    if first in ("std_msgs/Header", "builtin_interfaces/Time"):
        return _of_header
    return _of_nothing


def _of_nothing(raw: Raw) -> int | None:
    return None


def _of_header(raw: Raw) -> int | None:
    if len(raw) < 12 or raw[:4] != CDR_LITTLE_ENDIAN:
        return None
    return clock_from_cdr(raw)


def _of_floats(raw: Raw) -> int | None:
    at, values = _data_of(raw)
    if values < 1:
        return None
    at += -(at - 4) % 8  # numbers are aligned, counted from the end of the encapsulation
    if len(raw) < at + _F64.size:
        return None
    stamp_s = _F64.unpack_from(raw, at)[0]
    if not (math.isfinite(stamp_s) and 0.0 <= stamp_s <= _LATEST_S):
        return None
    return seconds_to_ns(stamp_s)


def _of_bytes(raw: Raw) -> int | None:
    at, values = _data_of(raw)
    if values < _I64.size or len(raw) < at + _I64.size:
        return None
    stamp_ns: int = _I64.unpack_from(raw, at)[0]
    return stamp_ns if 0 <= stamp_ns <= _LATEST_S * 1e9 else None


def _data_of(raw: Raw) -> tuple[int, int]:
    """Where the data of a multi-array begin, and how many values stand before its elements."""
    try:
        if raw[:4] != CDR_LITTLE_ENDIAN:
            return 0, 0
        at = 8
        for _ in range(min(_U32.unpack_from(raw, 4)[0], _MOST_DIMENSIONS + 1)):
            at += 4 + _U32.unpack_from(raw, at)[0]  # the label
            at += -at % 4 + 8  # size and stride
        offset = _U32.unpack_from(raw, at)[0]
        count = _U32.unpack_from(raw, at + 4)[0]
    except struct.error:
        return 0, 0
    return at + 8, min(offset, count)
