"""Train positions as ``nav_msgs/Odometry`` in a track-aligned frame.

``header.frame_id`` is the track, ``child_frame_id`` the train, ``pose.position.x`` the
chainage [m], ``twist.linear.x`` the speed along the track [m/s]. An infinite variance says
that the position is *not known*: the chainage is then only the last one that was. The frame has
one dimension: the other coordinates are zero by its definition, and so are their variances.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, Final

from nav_msgs.msg import Odometry
from rclpy.serialization import serialize_message

from .stamps import NANOSECONDS, to_ns

_STAMP = struct.Struct("<iI")
# Tail of the serialised message: pose 7 + covariance 36, twist 6 + covariance 36.
_TAIL_VALUES: Final = 85
_TWIST_AT: Final = 43
_PACK = struct.Struct("<d")
_HEAD = struct.Struct("<4siII")
# Of chainage, its variance, speed, its variance in the tail [bytes].
_PLACES: Final = (0, 8 * 7, 8 * _TWIST_AT, 8 * (_TWIST_AT + 6))


@dataclass(frozen=True)
class Position:
    """Where a train is along a track.

    Parameters
    ----------
    stamp_ns : int
        Simulated time.
    train, track : str
        Names.
    chainage_m, variance_m2 : float
        Position along the track and its variance; infinite variance = unknown.
    speed_mps, speed_variance_m2ps2 : float
        Speed, positive with increasing chainage.
    """

    stamp_ns: int
    train: str
    track: str
    chainage_m: float
    variance_m2: float
    speed_mps: float
    speed_variance_m2ps2: float

    @property
    def known(self) -> bool:
        """Whether the position may be used."""
        return math.isfinite(self.variance_m2)

    def to_msg(self) -> Odometry:
        """Message form."""
        message = Odometry()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(self.stamp_ns, NANOSECONDS)
        message.header.frame_id = self.track
        message.child_frame_id = self.train
        message.pose.pose.position.x = self.chainage_m
        message.pose.pose.orientation.w = 1.0
        message.pose.covariance[0] = self.variance_m2
        message.twist.twist.linear.x = self.speed_mps
        message.twist.covariance[0] = self.speed_variance_m2ps2
        return message

    def to_cdr(self) -> bytes:
        """Serialised form."""
        return bytes(serialize_message(self.to_msg()))

    @classmethod
    def from_msg(cls, message: Any) -> Position:
        """View of a message."""
        return cls(
            to_ns(message.header.stamp),
            message.child_frame_id,
            message.header.frame_id,
            float(message.pose.pose.position.x),
            float(message.pose.covariance[0]),
            float(message.twist.twist.linear.x),
            float(message.twist.covariance[0]),
        )

    @classmethod
    def from_cdr(cls, raw: bytes) -> Position:
        """View of a serialised message."""
        stamp_ns, track, values = position_from_cdr(raw)
        # The name behind that of the track, which ends in a zero byte and is filled up to four.
        at = _HEAD.size + -(-(len(track.encode()) + 1) // 4) * 4
        length = int.from_bytes(raw[at : at + 4], "little")
        train = raw[at + 4 : at + 3 + length].decode()
        return cls(stamp_ns, train, track, *values)

    def describe(self) -> str:
        """In words, without the time."""
        line = f"{self.train} on {self.track}: "
        if not self.known:
            return f"{line}not known (last {self.chainage_m:.1f} m)"
        return (
            f"{line}{self.chainage_m:.3f} m ± {math.sqrt(self.variance_m2):.3f} m, "
            f"{self.speed_mps * 3.6:.1f} km/h"
        )


class PositionWriter:
    """Serialises the positions of one train on one track: only stamp and values change."""

    def __init__(self, train: str, track: str) -> None:
        raw = Position(0, train, track, 0.0, 0.0, 0.0, 0.0).to_cdr()
        self._raw = bytearray(raw)
        tail = len(raw) - 8 * _TAIL_VALUES
        self._places = tuple(tail + place for place in _PLACES)

    def write(self, position: Position) -> bytes:
        """Serialised position."""
        _STAMP.pack_into(self._raw, 4, *divmod(position.stamp_ns, NANOSECONDS))
        values = (
            position.chainage_m,
            position.variance_m2,
            position.speed_mps,
            position.speed_variance_m2ps2,
        )
        for place, value in zip(self._places, values, strict=True):
            _PACK.pack_into(self._raw, place, value)
        return bytes(self._raw)


def position_from_cdr(raw: bytes) -> tuple[int, str, tuple[float, float, float, float]]:
    """Stamp [ns], track, and chainage, variance, speed, speed variance of a serialised position.

    The part of a position that is read every tick, without unpacking the rest.
    """
    _, sec, nanosec, length = _HEAD.unpack_from(raw)
    track = raw[_HEAD.size : _HEAD.size + length - 1].decode()
    tail = len(raw) - 8 * _TAIL_VALUES
    values = tuple(_PACK.unpack_from(raw, tail + place)[0] for place in _PLACES)
    return sec * NANOSECONDS + nanosec, track, values
