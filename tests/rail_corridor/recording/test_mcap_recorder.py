"""A recording as others read it: with the independent rosbags library, and with that of MCAP."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from rail_corridor.recording.frames import (
    ATTACHMENT,
    CHANNEL,
    KEPT,
    MESSAGE,
    METADATA,
    REPEATED,
    Attachment,
    ChannelInfo,
    attachment_frame,
    channel_frame,
    metadata_frame,
)
from rail_corridor.recording.mcap_file import RecordingFile
from rail_corridor.recording.mcap_recorder import CHUNK_NS, McapRecorder, Source
from rail_msgs_py.message_definition import type_name
from rail_msgs_py.ranging.range_reading import RangeWriter
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.topics.qos_text import offered_profiles
from rail_msgs_py.topics.ranging import RANGE, WRS_TX
from rail_msgs_py.topics.tick import CLOCK, READY
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import STAMP_AT, Waveform

TICK_NS = 250_000_000
RANGE_NAME, TX = "/wayside/wrs1/zone1/range", "/wayside/wrs1/zone1/tx"
SCENARIO = Attachment("scenario.yaml", "application/yaml", b"name: tiny\n")


class Recording:
    """A recorder and one source that it is fed from."""

    def __init__(self, stream: Any, **more: Any) -> None:
        self.recorder = McapRecorder(stream, **more)
        self.source = Source()
        self._numbers: dict[str, int] = {}

    def open(self, topic: Topic, name: str, source: Source | None = None) -> int:
        """Open a channel; return its number."""
        number = self._numbers.setdefault(name, len(self._numbers) + 1)
        info = ChannelInfo(name, type_name(topic.type), offered_profiles(topic.qos))
        body = memoryview(channel_frame(number, info))[7:]
        self.recorder.take(source or self.source, CHANNEL, number, body)
        return number

    def put(
        self, number: int, raw: bytes, kind: int = MESSAGE, source: Source | None = None
    ) -> None:
        """Record a message."""
        self.recorder.take(source or self.source, kind, number, memoryview(raw))


def block(tick: int, value: complex = 0.5) -> bytes:
    return Waveform(tick * TICK_NS, 4e6, 2.4e9, 1, np.full((1, 16), value)).to_cdr()


def record(path: Path, ticks: int) -> None:
    """Record a clock, ranges and blocks."""
    with path.open("wb") as stream:
        recording = Recording(stream, attachments=[SCENARIO], metadata={"begin": {"seed": "7"}})
        ready = recording.open(READY, "/ready")
        clock = recording.open(CLOCK, "/clock")
        ranges, send = recording.open(RANGE, RANGE_NAME), recording.open(WRS_TX, TX)
        recording.put(ready, serialize_message(String(data="/world")))
        writer = RangeWriter("zone1", 0.0, 400.0)
        for tick in range(ticks):
            recording.put(clock, clock_to_cdr(tick * TICK_NS))
            recording.put(ranges, writer.write(tick * TICK_NS, 12.0 + tick, 0.25))
            repeats = tick > 1
            stamp = block(tick)[STAMP_AT : STAMP_AT + 8]
            kind = REPEATED if repeats else KEPT
            recording.put(send, stamp if repeats else block(tick), kind)
        recording.put(ready, serialize_message(String(data="/late")))
        end = memoryview(metadata_frame("end", {"ticks": str(ticks)}))[7:]
        recording.recorder.take(recording.source, METADATA, 0, end)
        report = memoryview(attachment_frame(Attachment("report.json", "application/json", b"{}")))
        recording.recorder.take(recording.source, ATTACHMENT, 0, report[7:])
        recording.recorder.close()


def test_an_independent_library_reads_all_of_it(tmp_path: Path) -> None:
    path, ticks = tmp_path / "run.mcap", 40
    record(path, ticks)
    with AnyReader([path]) as reader:
        found = {c.topic: c for c in reader.connections}
        assert {name: c.msgcount for name, c in found.items()} == {
            "/ready": 2,
            **dict.fromkeys(("/clock", RANGE_NAME, TX), ticks),
        }
        assert {name: c.msgtype for name, c in found.items()} == {
            "/ready": "std_msgs/msg/String",
            "/clock": "rosgraph_msgs/msg/Clock",
            RANGE_NAME: "sensor_msgs/msg/Range",
            TX: "std_msgs/msg/Float64MultiArray",
        }
        profiles = {name: c.ext.offered_qos_profiles for name, c in found.items()}  # type: ignore[union-attr]
        assert profiles["/ready"][0].durability.name == "TRANSIENT_LOCAL"
        assert (profiles[TX][0].durability.name, profiles[TX][0].depth) == ("VOLATILE", 8)
        heard: dict[str, list[tuple[int, Any]]] = {name: [] for name in found}
        for connection, time_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            heard[connection.topic].append((time_ns, message))
    stamps = [tick * TICK_NS for tick in range(ticks)]
    for name in ("/clock", RANGE_NAME, TX):
        assert [time_ns for time_ns, _ in heard[name]] == stamps
    assert [round(message.range) for _, message in heard[RANGE_NAME]] == [
        12 + t for t in range(ticks)
    ]
    blocks = [message.data for _, message in heard[TX]]
    assert [data[0] for data in blocks] == [ns / 1e9 for ns in stamps]
    assert all(np.array_equal(data[4:], blocks[0][4:]) for data in blocks)
    # What carries no time belongs to the tick in which it was said.
    assert [(ns, message.data) for ns, message in heard["/ready"]] == [
        (0, "/world"),
        (stamps[-1], "/late"),
    ]


def test_the_library_of_the_format_finds_what_is_attached(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    record(path, 3)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        attached = {each.name: each.data for each in reader.iter_attachments()}
        noted = {each.name: each.metadata for each in reader.iter_metadata()}
        summary = reader.get_summary()
        assert summary
        encodings = {schema.encoding for schema in summary.schemas.values()}
        messages = [message for _, _, message in reader.iter_messages()]
    assert attached == {"scenario.yaml": SCENARIO.data, "report.json": b"{}"}
    assert noted == {"begin": {"seed": "7"}, "end": {"ticks": "3"}}
    assert encodings == {"ros2msg"}
    assert all(message.log_time == message.publish_time for message in messages)
    per_channel: dict[int, list[int]] = {}
    for message in messages:
        per_channel.setdefault(message.channel_id, []).append(message.sequence)
    assert all(found == list(range(1, len(found) + 1)) for found in per_channel.values())


def test_a_topic_of_many_publishers_is_one_channel() -> None:
    stream = io.BytesIO()
    recording, other = Recording(stream), Source()
    first = recording.open(READY, "/ready")
    recording.open(READY, "/ready", other)
    recording.put(first, serialize_message(String(data="/a")))
    recording.put(first, serialize_message(String(data="/b")), source=other)
    recording.recorder.close()
    stream.seek(0)
    summary = make_reader(stream).get_summary()
    assert summary
    assert summary.statistics
    assert (len(summary.channels), summary.statistics.message_count) == (1, 2)


@pytest.mark.parametrize("seconds", [20, 60])
def test_what_is_older_than_a_few_seconds_is_in_the_file(tmp_path: Path, seconds: int) -> None:
    """However little is said: a recorder that is killed now has lost no more than that."""
    path = tmp_path / "run.mcap"
    with path.open("wb", buffering=0) as raw, io.BufferedWriter(raw) as stream:
        recording = Recording(stream)
        clock = recording.open(CLOCK, "/clock")
        for tick in range(4 * seconds):
            recording.put(clock, clock_to_cdr(tick * TICK_NS))
        left = tmp_path / "left.mcap"
        left.write_bytes(path.read_bytes())
    with RecordingFile(left) as file:
        times = [message.log_time_ns for chunk in file.chunks() for message in chunk]
    assert file.cut_at is not None
    assert times == [tick * TICK_NS for tick in range(len(times))]
    assert seconds * 1e9 - times[-1] <= CHUNK_NS + TICK_NS
