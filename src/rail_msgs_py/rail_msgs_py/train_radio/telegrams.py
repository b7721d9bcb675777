"""Telegrams of a tick as ``std_msgs/UInt8MultiArray``.

Layout on the wire: dimensions ``telegram``, ``byte``; ``data_offset`` 8: the stamp in
nanoseconds, little endian. Of each telegram the first two bytes are the slot of the radio it
goes or came through, little endian; the others are a frame of the safe channel.
"""

from __future__ import annotations

import array
import struct
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import MultiArrayDimension, UInt8MultiArray

from .safe_frame import FRAME_BYTES

_STAMP = struct.Struct("<q")
_SLOT = struct.Struct("<H")
_ROW_BYTES = _SLOT.size + FRAME_BYTES
_LABELS = ("telegram", "byte")


@dataclass(frozen=True)
class Telegrams:
    """Frames by slot.

    Parameters
    ----------
    stamp_ns : int
        Simulated time of the tick.
    frames : tuple of (int, bytes)
        Slot and frame of each; more than one may have gone through the same slot.
    """

    stamp_ns: int
    frames: tuple[tuple[int, bytes], ...]

    def to_msg(self) -> UInt8MultiArray:
        """Message form.

        Raises
        ------
        ValueError
            If a frame has another length than those of the safe channel.
        """
        message = UInt8MultiArray()
        count = len(self.frames)
        message.layout.dim = [
            MultiArrayDimension(label=_LABELS[0], size=count, stride=count * _ROW_BYTES),
            MultiArrayDimension(label=_LABELS[1], size=_ROW_BYTES, stride=_ROW_BYTES),
        ]
        message.layout.data_offset = _STAMP.size
        data = array.array("B", _STAMP.pack(self.stamp_ns))
        for slot, frame in self.frames:
            if len(frame) != FRAME_BYTES:
                raise ValueError(f"a frame has {FRAME_BYTES} bytes, got {len(frame)}")
            data.frombytes(_SLOT.pack(slot) + frame)
        message.data = data
        return message

    def to_cdr(self) -> bytes:
        """Serialised form."""
        return bytes(serialize_message(self.to_msg()))

    @classmethod
    def from_msg(cls, message: Any) -> Telegrams:
        """View of a message.

        Raises
        ------
        ValueError
            If the layout is not that of telegrams.
        """
        labels = tuple(dim.label for dim in message.layout.dim)
        if labels != _LABELS or message.layout.data_offset != _STAMP.size:
            raise ValueError(f"not telegrams: dimensions {labels}")
        count, width = (int(dim.size) for dim in message.layout.dim)
        raw = bytes(message.data)
        if width != _ROW_BYTES or len(raw) != _STAMP.size + count * width:
            raise ValueError(f"not telegrams: {len(raw)} bytes for {count} of {width}")
        rows = (raw[at : at + width] for at in range(_STAMP.size, len(raw), width))
        return cls(
            _STAMP.unpack_from(raw)[0],
            tuple((_SLOT.unpack_from(row)[0], row[_SLOT.size :]) for row in rows),
        )

    @classmethod
    def from_cdr(cls, raw: bytes) -> Telegrams:
        """View of a serialised message; raises as `from_msg`."""
        return cls.from_msg(deserialize_message(raw, UInt8MultiArray))

    def describe(self) -> str:
        """In words, without the time."""
        slots = ", ".join(f"slot {slot}: {frame.hex()}" for slot, frame in self.frames)
        return slots or "no telegram"

    def in_slot(self, slot: int) -> list[bytes]:
        """Frames of one slot."""
        return [frame for each, frame in self.frames if each == slot]

    def newest(self, slots: int) -> dict[int, bytes]:
        """The last frame of each slot from 1 to ``slots``; others are left out."""
        return {slot: frame for slot, frame in self.frames if 1 <= slot <= slots}


def telegrams(stamp_ns: int, frames: Iterable[tuple[int, bytes]] = ()) -> Telegrams:
    """Telegrams of a tick."""
    return Telegrams(stamp_ns, tuple(frames))
