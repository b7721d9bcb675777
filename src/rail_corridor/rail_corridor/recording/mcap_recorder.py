"""Writes what a run tells into an MCAP file that ROS 2 tools read, or into several.

Profile ``ros2``: CDR messages, ``ros2msg`` schemas, and per channel the profiles that its
publisher offered, as rosbag2 writes them. Log and publish time are the simulated time of the
tick, so that tools show that.

Each of several files begins with what was latched before, under its old number and publish time:
who opens it alone has the map, and who reads all of them can tell that it is said again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, BinaryIO, Final, cast

from mcap.writer import CompressionType, Writer
from rclpy.qos import DurabilityPolicy

from rail_corridor.yaml_file import parse_yaml
from rail_msgs_py.cdr_stamp import Raw, StampReader, stamp_reader
from rail_msgs_py.message_definition import message_class, message_definition
from rail_msgs_py.topics.qos_text import profile_from

from . import frames as frames
from .frames import Attachment, ChannelInfo
from .part_names import NEXT, PART, Split, part_path

PROFILE: Final = "ros2"
_LIBRARY: Final = "rail_corridor"
#: A chunk is what a killed run loses at most; and what must be unpacked to read one message.
CHUNK_BYTES: Final = 1024 * 1024
#: ... and it is closed after so much simulated time, whatever its size.
CHUNK_NS: Final = 5_000_000_000


@dataclass
class _Channel:
    """One topic in the file."""

    info: ChannelInfo
    stamp_of: StampReader
    #: What the next part begins with: time, number and message.
    latched: deque[tuple[int, int, bytes]]
    number: int = 0
    sequence: int = 0


class Source:
    """One process of the run: its channels, what it repeats, how far its time has come."""

    def __init__(self) -> None:
        self.channels: dict[int, _Channel] = {}
        self.kept: dict[int, bytes] = {}
        self.now_ns = 0


class McapRecorder:
    """One recording.

    Parameters
    ----------
    stream : binary file
        Written from its start.
    attachments : iterable of Attachment
        Written first, so that a recording cut short has them.
    metadata : dict
        Name to values, likewise.
    split : Split, optional
        How it is divided; one file unless given.
    """

    def __init__(
        self,
        stream: BinaryIO,
        attachments: Iterable[Attachment] = (),
        metadata: dict[str, dict[str, str]] | None = None,
        split: Split | None = None,
    ) -> None:
        self._attachments, self._metadata = tuple(attachments), dict(metadata or {})
        self._split = split
        #: Which part is being written, from 0, and where.
        self.part = 0
        self.stream = stream
        self._topics: dict[tuple[str, str], _Channel] = {}
        self._chunk_ns: int | None = None
        self.messages = 0
        self._begin(stream)

    def _begin(self, stream: BinaryIO) -> None:
        """Begin a file."""
        self.stream = stream
        # LZ4 takes a quarter of the space for a twentieth more of the time; Zstandard saves
        # another quarter for three times that (benchmarks/recording_cost.py).
        self._writer: Any = Writer(stream, CHUNK_BYTES, CompressionType.LZ4)
        self._writer.start(PROFILE, _LIBRARY)
        self._schemas: dict[str, int] = {}
        for attachment in self._attachments:
            self._attach(attachment)
        for name, values in self._metadata.items():
            self._writer.add_metadata(name, values)
        if self._split is not None:
            self._writer.add_metadata(PART, self._split.values(self.part))
        stream.flush()
        self._set_limit()

    def _set_limit(self) -> None:
        """Have room for new messages in a part, however much it begins with."""
        if self._split is not None:
            self._most_bytes = max(self._split.most_bytes, 2 * self.stream.tell())

    def take(self, source: Source, kind: int, channel: int, body: memoryview) -> None:
        """Write one frame of a process."""
        if kind == frames.MESSAGE:
            self._message(source, source.channels[channel], body)
        elif kind == frames.REPEATED:
            raw = frames.repeated(source.kept[channel], body)
            self._message(source, source.channels[channel], raw)
        elif kind == frames.KEPT:
            source.kept[channel] = bytes(body)
            self._message(source, source.channels[channel], body)
        elif kind == frames.CHANNEL:
            source.channels[channel] = self._channel(frames.channel_of(body))
        elif kind == frames.ATTACHMENT:
            self.flush()
            self._attach(frames.attachment_of(body))
        elif kind == frames.METADATA:
            self.flush()
            self._writer.add_metadata(*frames.metadata_of(body))

    def flush(self) -> None:
        """Close the chunk at hand: all that was taken is in the file, and readable."""
        self._writer.flush()
        self._chunk_ns = None

    def close(self) -> None:
        """Write what makes the file complete: summary, indices, footer."""
        self._writer.finish()
        self.stream.flush()

    def _go_on(self, split: Split, stamp_ns: int) -> None:
        """Close a part, and begin the next one with what is latched."""
        self.flush()
        self._writer.add_metadata(NEXT, split.values(self.part + 1))
        self.close()
        self.stream.close()
        self.part += 1
        self._begin(part_path(split.path, self.part).open("wb"))
        for channel in self._topics.values():
            self._register(channel)
            for said_ns, sequence, raw in channel.latched:
                self._writer.add_message(channel.number, stamp_ns, raw, said_ns, sequence)
        self.flush()
        self._set_limit()

    def _attach(self, attachment: Attachment) -> None:
        self._writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)

    def _channel(self, info: ChannelInfo) -> _Channel:
        """The channel of a topic: one, however many publish on it."""
        known = self._topics.get((info.topic, info.type))
        if known is not None:
            return known
        profile = profile_from(parse_yaml(info.offered_qos_profiles)[0])
        latched = profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        kept = profile.depth if latched and self._split is not None else 0
        created = _Channel(info, stamp_reader(message_class(info.type)), deque(maxlen=kept))
        self._register(created)
        self._topics[info.topic, info.type] = created
        return created

    def _register(self, channel: _Channel) -> None:
        """Describe a topic in the file at hand."""
        info = channel.info
        if info.type not in self._schemas:
            definition = message_definition(info.type).encode()
            self._schemas[info.type] = self._writer.register_schema(
                info.type, "ros2msg", definition
            )
        channel.number = self._writer.register_channel(
            info.topic,
            "cdr",
            self._schemas[info.type],
            {"offered_qos_profiles": info.offered_qos_profiles},
        )

    def _message(self, source: Source, channel: _Channel, raw: Raw) -> None:
        # What carries no time, or zero for "not set", belongs to the tick of its process.
        stamp_ns = channel.stamp_of(raw) or source.now_ns
        source.now_ns = max(source.now_ns, stamp_ns)
        if self._split is not None and self.stream.tell() >= self._most_bytes:
            self._go_on(self._split, stamp_ns)
        if self._chunk_ns is None:
            self._chunk_ns = stamp_ns
        elif abs(stamp_ns - self._chunk_ns) >= CHUNK_NS:
            self.flush()
            self._chunk_ns = stamp_ns
        channel.sequence += 1
        self.messages += 1
        # The library copies what it is given at once: a view will do.
        data = cast("bytes", raw)
        self._writer.add_message(channel.number, stamp_ns, data, stamp_ns, channel.sequence)
        if channel.latched.maxlen:
            channel.latched.append((stamp_ns, channel.sequence, bytes(raw)))
