"""Reads an MCAP file of ROS 2 messages, whole or cut short, and trusts nothing in it.

A run that was killed leaves a file without its end: everything up to there is read. A file that
has its end but not what should be before it is damaged, and refused.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import lz4.frame
import zstandard
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from rail_corridor.errors import InputError

from .frames import Attachment
from .mcap_recorder import PROFILE

_HEAD: Final = struct.Struct("<BQ")
_MESSAGE: Final = struct.Struct("<HIQQ")
_LARGEST_CHUNK: Final = 256 * 1024 * 1024
_LATEST_NS: Final = 2**63


@dataclass(frozen=True)
class RecordedChannel:
    """One topic of a file: its name, the name of its type, and what else the file says of it."""

    topic: str
    type: str
    encoding: str
    metadata: dict[str, str]


class RecordedMessage(NamedTuple):
    """One message: its topic, the time it was recorded at, its serialised form, its number.

    The numbers of a topic rise from 1 on, where the writer counts at all.
    """

    channel: RecordedChannel
    log_time_ns: int
    data: bytes
    sequence: int = 0


class _Damaged(Exception):
    """Something in the file is not as it must be; says what."""


class RecordingFile:
    """One file, opened: what stands before its first message is known.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        One line that names the file, and the byte where it is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.attachments: list[Attachment] = []
        self.metadata: dict[str, dict[str, str]] = {}
        #: Where the file ends before its time [byte], None if it is whole. Known when it is read.
        self.cut_at: int | None = None
        #: Times of the first and of the last message [ns]; 0 without any. Known likewise.
        self.first_ns = self.last_ns = 0
        self._count = 0
        self._stated: int | None = None
        self._schemas: dict[int, str] = {}
        self._channels: dict[int, RecordedChannel] = {}
        self._stream, self._size, self._whole = _opened(path)
        self._at = len(MCAP0_MAGIC)
        self._records = self._top_records()
        self._next = self._advance()

    def __enter__(self) -> RecordingFile:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    @property
    def holds_messages(self) -> bool:
        """Whether a message has been read."""
        return self._count > 0

    @property
    def channels(self) -> list[RecordedChannel]:
        """Topics that have been found so far."""
        return list(self._channels.values())

    def chunks(
        self, wanted: Callable[[RecordedChannel], bool] = lambda _: True
    ) -> Iterator[list[RecordedMessage]]:
        """Yield the messages of each chunk, in the order of the file; once.

        Parameters
        ----------
        wanted : callable of a channel
            Whether its messages are; asked once of each.

        Raises
        ------
        InputError
        """
        chosen: dict[int, RecordedChannel | None] = {}
        while self._next is not None:
            at, opcode, body = self._next
            with _located(self.path, at):
                content = _unpacked(body) if opcode == Opcode.CHUNK else None
                inner = [(opcode, body)] if content is None else _records_in(content)
                yield list(self._messages(inner, chosen, wanted))
            self._next = self._advance()

    def _messages(
        self,
        inner: Any,
        chosen: dict[int, RecordedChannel | None],
        wanted: Callable[[RecordedChannel], bool],
    ) -> Iterator[RecordedMessage]:
        for opcode, body in inner:
            if opcode != Opcode.MESSAGE:
                self._describe(opcode, body)
                continue
            if len(body) < _MESSAGE.size:
                raise _Damaged("a message is shorter than its head")
            number, sequence, log_time_ns, _ = _MESSAGE.unpack_from(body)
            if number not in chosen:
                if number not in self._channels:
                    raise _Damaged(f"a message of channel {number}, which there is not")
                channel = self._channels[number]
                chosen[number] = channel if wanted(channel) else None
            if log_time_ns >= _LATEST_NS:
                raise _Damaged(f"a message of the time {log_time_ns} ns")
            self.first_ns = min(self.first_ns, log_time_ns) if self._count else log_time_ns
            self.last_ns = max(self.last_ns, log_time_ns)
            self._count += 1
            known = chosen[number]
            if known is None:
                continue
            yield RecordedMessage(known, log_time_ns, bytes(body[_MESSAGE.size :]), sequence)

    def _advance(self) -> tuple[int, int, bytes] | None:
        """Read up to the next record that holds messages; None at the end."""
        for at, opcode, body in self._records:
            if opcode in (Opcode.CHUNK, Opcode.MESSAGE):
                return at, opcode, body
            with _located(self.path, at):
                self._describe(opcode, body)
        return None

    def _describe(self, opcode: int, body: bytes | memoryview) -> None:
        """Take a record that is not a message."""
        stream = ReadDataStream(io.BytesIO(body))
        if opcode == Opcode.SCHEMA:
            schema = _parsed(records.Schema.read, stream)
            self._schemas[schema.id] = schema.name
        elif opcode == Opcode.CHANNEL:
            channel = _parsed(records.Channel.read, stream)
            kind = self._schemas.get(channel.schema_id, "")
            self._channels[channel.id] = RecordedChannel(
                channel.topic, kind, channel.message_encoding, channel.metadata
            )
        elif opcode == Opcode.STATISTICS:
            self._stated = _parsed(records.Statistics.read, stream).message_count
        elif opcode == Opcode.METADATA:
            metadata = _parsed(records.Metadata.read, stream)
            self.metadata[metadata.name] = metadata.metadata
        elif opcode == Opcode.ATTACHMENT:
            attachment = _parsed(records.Attachment.read, stream)
            crc = int.from_bytes(body[-4:], "little")
            if crc and crc != zlib.crc32(body[:-4]):
                raise _Damaged(f"the check sum of {attachment.name} does not match")
            self.attachments.append(
                Attachment(attachment.name, attachment.media_type, attachment.data)
            )
        elif opcode == Opcode.HEADER:
            header = _parsed(records.Header.read, stream)
            if header.profile != PROFILE:
                raise InputError(
                    "is no recording of ROS 2 messages",
                    file=str(self.path),
                    field="profile",
                    value=header.profile,
                )

    def _top_records(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield place, kind and content of the records up to the end of the file."""
        while True:
            at = self._at
            head = self._stream.read(_HEAD.size)
            opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, self._size)
            if at + _HEAD.size + length > self._size:
                if self._whole:
                    raise _at(self.path, at, "a record is longer than the file")
                self.cut_at = at
                return
            if not opcode:
                raise _at(self.path, at, "a record of no kind")
            if at == len(MCAP0_MAGIC) and opcode != Opcode.HEADER:
                raise _at(self.path, at, "there is no header")
            if opcode == Opcode.FOOTER:
                self._end(at, at + _HEAD.size + length)
                return
            body = self._stream.read(length)
            self._at = at + _HEAD.size + length
            yield at, opcode, body

    def _end(self, at: int, end: int) -> None:
        """Compare what has been read with what the file says it holds."""
        if not self._whole:
            self.cut_at = at
        elif end + len(MCAP0_MAGIC) != self._size:
            raise _at(self.path, at, "there is more after its end")
        elif self._stated not in (None, self._count):
            raise _at(self.path, at, f"{self._count} messages instead of {self._stated}")


class _located:
    """Turns what is wrong into the one line of an InputError."""

    def __init__(self, path: Path, at: int) -> None:
        self._path, self._at = path, at

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: Any, error: BaseException | None, _: Any) -> None:
        if isinstance(error, _Damaged):
            raise _at(self._path, self._at, str(error)) from None


def _at(path: Path, at: int, what: str) -> InputError:
    return InputError(f"is damaged at byte {at}: {what}", file=str(path))


def _opened(path: Path) -> tuple[BinaryIO, int, bool]:
    """The file behind its magic, its size, and whether its end is there."""
    name = str(path)
    try:
        if path.is_dir():
            raise InputError("is a directory", file=name)
        if not path.is_file():
            reason = "is not a regular file" if path.exists() else "there is no such file"
            raise InputError(reason, file=name)
        stream = path.open("rb")
        size = path.stat().st_size
        magic = stream.read(len(MCAP0_MAGIC))
        stream.seek(max(size - len(MCAP0_MAGIC), 0))
        complete = size >= 2 * len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC
        stream.seek(len(MCAP0_MAGIC))
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=name) from None
    except ValueError:  # a null byte in the name
        raise InputError("is no file name", file=name) from None
    if not size:
        raise InputError("is empty", file=name)
    if magic != MCAP0_MAGIC:
        raise InputError("is not an MCAP file", file=name)
    return stream, size, complete


def _parsed(read: Callable[[Any], Any], stream: ReadDataStream) -> Any:
    try:
        return read(stream)
    except Exception as error:  # whatever a parser of the library makes of nonsense
        raise _Damaged(f"a record cannot be read: {type(error).__name__}") from None


def _unpacked(body: bytes) -> bytes:
    """Content of a chunk."""
    chunk = _parsed(records.Chunk.read, ReadDataStream(io.BytesIO(body)))
    size = chunk.uncompressed_size
    if size > _LARGEST_CHUNK:
        raise _Damaged(f"a chunk of {size} bytes")
    try:
        content = _decompressed(chunk.compression, chunk.data, size)
    except (RuntimeError, ValueError, zstandard.ZstdError, MemoryError):
        raise _Damaged("a chunk cannot be unpacked") from None
    if len(content) != size:
        raise _Damaged(f"a chunk of {len(content)} bytes instead of {size}")
    if chunk.uncompressed_crc and zlib.crc32(content) != chunk.uncompressed_crc:
        raise _Damaged("the check sum of a chunk does not match")
    return content


def _decompressed(compression: str, data: bytes, size: int) -> bytes:
    """At most so many bytes, whatever the data claim."""
    if compression == "lz4":
        content: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        return content
    if compression == "zstd":
        return zstandard.ZstdDecompressor().stream_reader(data).read(size + 1)
    if compression:
        raise _Damaged(f"a chunk is compressed by {compression[:20]!r}, which is not known")
    return data


def _records_in(content: bytes) -> Iterator[tuple[int, memoryview]]:
    """Yield kind and content of the records of a chunk."""
    view, at = memoryview(content), 0
    while at < len(content):
        if at + _HEAD.size > len(content):
            raise _Damaged("a chunk ends amid a record")
        opcode, length = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        if at + length > len(content):
            raise _Damaged("a chunk ends amid a record")
        yield opcode, view[at : at + length]
        at += length
