"""What the processes of a run tell the recorder, as frames in a pipe.

A frame is a kind (1 byte), the number of a channel (2), a length (4), and so many bytes, little
endian. A channel is opened by a frame with its topic; those of one process are in the order in
which it published. Transmitters repeat most of what they send, tick after tick with a new stamp:
after a message that is kept, such repetitions travel as their eight bytes alone.
"""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Final

from rail_msgs_py.waveform import STAMP_AT

#: Kinds of frames.
CHANNEL: Final = 1
MESSAGE: Final = 2
KEPT: Final = 3
REPEATED: Final = 4
ATTACHMENT: Final = 5
METADATA: Final = 6

_HEAD: Final = struct.Struct("<BHI")
_NAME: Final = struct.Struct("<H")
_READ_BYTES: Final = 1024 * 1024
MOST_CHANNELS: Final = 65_535
STAMP_BYTES: Final = 8

#: Kind, channel, body; the body is a view that is only valid until the next frame is taken.
Frame = tuple[int, int, memoryview]


@dataclass(frozen=True)
class ChannelInfo:
    """A topic: its name, the name of its type, the profiles offered as rosbag2 writes them."""

    topic: str
    type: str
    offered_qos_profiles: str


@dataclass(frozen=True)
class Attachment:
    """A file that a recording carries along."""

    name: str
    media_type: str
    data: bytes


def head(kind: int, channel: int, length: int) -> bytes:
    """What stands before the body of a frame."""
    return _HEAD.pack(kind, channel, length)


def channel_frame(number: int, info: ChannelInfo) -> bytes:
    """Frame that opens a channel."""
    body = json.dumps(asdict(info)).encode()
    return head(CHANNEL, number, len(body)) + body


def channel_of(body: memoryview) -> ChannelInfo:
    """Inverse of `channel_frame`."""
    return ChannelInfo(**json.loads(bytes(body)))


def repeated(kept: bytes, stamp: memoryview) -> bytes:
    r"""A kept waveform with another stamp, the body of a repetition.

    >>> repeated(bytes(STAMP_AT + 10), memoryview(b"12345678"))[STAMP_AT - 1 :]
    b'\x0012345678\x00\x00'
    """
    return b"".join((kept[:STAMP_AT], stamp, kept[STAMP_AT + STAMP_BYTES :]))


def attachment_frame(attachment: Attachment) -> bytes:
    """Frame with a file."""
    names = json.dumps([attachment.name, attachment.media_type]).encode()
    body = _NAME.pack(len(names)) + names + attachment.data
    return head(ATTACHMENT, 0, len(body)) + body


def attachment_of(body: memoryview) -> Attachment:
    """Inverse of `attachment_frame`."""
    (length,) = _NAME.unpack_from(body)
    name, media_type = json.loads(bytes(body[_NAME.size : _NAME.size + length]))
    return Attachment(name, media_type, bytes(body[_NAME.size + length :]))


def metadata_frame(name: str, values: dict[str, str]) -> bytes:
    """Frame with named values."""
    body = json.dumps([name, values]).encode()
    return head(METADATA, 0, len(body)) + body


def metadata_of(body: memoryview) -> tuple[str, dict[str, str]]:
    """Inverse of `metadata_frame`."""
    name, values = json.loads(bytes(body))
    return name, values


class FrameReader:
    """Reads frames from a pipe."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._buffer = bytearray(_READ_BYTES)
        self._end = 0

    def read(self) -> Iterator[Frame]:
        """Read once, and yield the frames that are complete; what remains waits for more.

        Raises
        ------
        EOFError
            If the pipe has been closed.
        """
        buffer = self._buffer
        view = memoryview(buffer)
        count = os.readv(self._fd, [view[self._end :]])
        if not count:
            raise EOFError
        at, end = 0, self._end + count
        needed = 0
        while end - at >= _HEAD.size:
            kind, channel, length = _HEAD.unpack_from(buffer, at)
            body = at + _HEAD.size
            if end - body < length:
                needed = _HEAD.size + length
                break
            at = body + length
            yield kind, channel, view[body:at]
        rest = bytes(view[at:end])
        if needed >= len(buffer):
            view.release()
            self._buffer = buffer = bytearray(needed + _READ_BYTES)
        buffer[: len(rest)] = rest
        self._end = len(rest)
