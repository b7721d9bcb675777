"""Ranges as ``sensor_msgs/Range``, with the special values of REP 117.

``+inf``: no signal found. ``nan``: a signal is there but the reading must not be used
(two trains in the zone, or a jammer). ``min_range``/``max_range`` are the unambiguous interval.
``radiation_type`` is INFRARED, of the two that are defined the electromagnetic one; the field of
view is 0: the distance is that along the axis of the frame, the zone.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, NamedTuple

from rclpy.serialization import serialize_message
from sensor_msgs.msg import Range

from rail_msgs_py.stamps import NANOSECONDS, clock_from_cdr, to_ns

_STAMP = struct.Struct("<iI")
_TAIL = struct.Struct("<5f")
_VALUES = struct.Struct("<2f")


@dataclass(frozen=True)
class RangeReading:
    """Range from a wayside station to the train in one of its zones.

    Parameters
    ----------
    stamp_ns : int
        Simulated time.
    zone : str
        Zone that the antenna looks into (``header.frame_id``).
    range_m, variance_m2 : float
        Straight-line distance; ``inf`` = no signal, ``nan`` = not to be used.
    min_range_m, max_range_m : float
        Unambiguous interval of the comparator.
    """

    stamp_ns: int
    zone: str
    range_m: float
    variance_m2: float
    min_range_m: float
    max_range_m: float

    @property
    def usable(self) -> bool:
        """Whether the reading is a distance."""
        return math.isfinite(self.range_m)

    @property
    def disturbed(self) -> bool:
        """Whether a signal was heard that could not be read."""
        return math.isnan(self.range_m)

    def to_msg(self) -> Range:
        """Message form."""
        message = Range()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.stamp_ns, NANOSECONDS)
        message.header.frame_id = self.zone
        # The type has no constant for radio, and a tool that switches over those that it has must
        # find one of them: the electromagnetic one is the nearer.
        message.radiation_type = Range.INFRARED
        message.min_range = self.min_range_m
        message.max_range = self.max_range_m
        message.range = self.range_m
        message.variance = self.variance_m2
        return message

    @classmethod
    def from_msg(cls, message: Any) -> RangeReading:
        """View of a message."""
        return cls(
            to_ns(message.header.stamp),
            message.header.frame_id,
            float(message.range),
            float(message.variance),
            float(message.min_range),
            float(message.max_range),
        )

    @classmethod
    def from_cdr(cls, raw: bytes) -> RangeReading:
        """View of a serialised message."""
        length = int.from_bytes(raw[12:16], "little")
        zone = raw[16 : 15 + length].decode()
        _, low_m, high_m, range_m, variance_m2 = _TAIL.unpack_from(raw, len(raw) - _TAIL.size)
        return cls(clock_from_cdr(raw), zone, range_m, variance_m2, low_m, high_m)

    def describe(self) -> str:
        """In words, without the time."""
        if self.usable:
            return f"{self.zone}: {self.range_m:.3f} m ± {math.sqrt(self.variance_m2):.3f} m"
        return f"{self.zone}: {'disturbed' if self.disturbed else 'no signal'}"


def range_from_cdr(raw: bytes) -> tuple[int, float, float]:
    """Stamp [ns], range [m] and variance [m^2] of a serialised reading, and no more."""
    range_m, variance_m2 = _VALUES.unpack_from(raw, len(raw) - _VALUES.size)
    return clock_from_cdr(raw), range_m, variance_m2


class RangeView(NamedTuple):
    """A reading of one antenna as it is sent, not serialised yet.

    The message has single precision, so this has as well.
    """

    stamp_ns: int
    range_m: float
    variance_m2: float
    writer: RangeWriter

    def to_cdr(self) -> bytes:
        """Serialised form."""
        return self.writer.write(self.stamp_ns, self.range_m, self.variance_m2)


class RangeWriter:
    """Makes the readings of one antenna: only stamp and values change."""

    def __init__(self, zone: str, min_range_m: float, max_range_m: float) -> None:
        blank = RangeReading(0, zone, 0.0, 0.0, min_range_m, max_range_m)
        raw = serialize_message(blank.to_msg())
        self._head, self._middle = raw[:4], raw[12 : len(raw) - 8]

    def view(self, stamp_ns: int, range_m: float, variance_m2: float) -> RangeView:
        """Return a reading that is serialised when somebody needs it so."""
        if not range_m == variance_m2 == math.inf:
            range_m, variance_m2 = _VALUES.unpack(_VALUES.pack(range_m, variance_m2))
        return RangeView(stamp_ns, range_m, variance_m2, self)

    def write(self, stamp_ns: int, range_m: float, variance_m2: float) -> bytes:
        """Serialised reading."""
        return b"".join(
            (
                self._head,
                _STAMP.pack(*divmod(stamp_ns, NANOSECONDS)),
                self._middle,
                _VALUES.pack(range_m, variance_m2),
            )
        )
