"""Recordings that are cut short, damaged or foreign: what is there, or one line - never a crash."""

from __future__ import annotations

import io
import random
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.writer import MCAP0_MAGIC, CompressionType, Writer

from rail_corridor.errors import InputError
from rail_corridor.recording.mcap_file import RecordingFile

TIMES = [10 * n for n in range(24)]


def written(
    compression: CompressionType = CompressionType.LZ4, profile: str = "ros2", **more: Any
) -> bytes:
    """Return a file with a few chunks."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=200, compression=compression, **more)
    writer.start(profile, "test")
    writer.add_attachment(0, 0, "scenario.yaml", "application/yaml", b"name: tiny\n")
    writer.add_metadata("begin", {"seed": "7"})
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
    channels = [writer.register_channel(name, "cdr", schema) for name in ("/a", "/b")]
    for time_ns in TIMES:
        writer.add_message(channels[time_ns % 20 // 10], time_ns, b"%08d" % time_ns, time_ns)
    writer.finish()
    return stream.getvalue()


def times_of(path: Path) -> tuple[list[int], int | None]:
    """Return the times of all messages, and where the file is cut."""
    with RecordingFile(path) as file:
        times = [message.log_time_ns for chunk in file.chunks() for message in chunk]
    return times, file.cut_at


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunked", [True, False])
def test_a_whole_file_is_read_whole(
    tmp_path: Path, compression: CompressionType, chunked: bool
) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(written(compression, use_chunking=chunked))
    with RecordingFile(path) as file:
        assert [each.name for each in file.attachments] == ["scenario.yaml"]
        assert file.metadata == {"begin": {"seed": "7"}}
        messages = [message for chunk in file.chunks() for message in chunk]
    assert [message.log_time_ns for message in messages] == TIMES
    assert [message.data for message in messages] == [b"%08d" % ns for ns in TIMES]
    assert {message.channel.topic for message in messages} == {"/a", "/b"}
    assert {channel.type for channel in file.channels} == {"std_msgs/msg/String"}
    assert (file.cut_at, file.first_ns, file.last_ns) == (None, 0, TIMES[-1])


def test_only_what_is_wanted(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(written())
    asked = []
    with RecordingFile(path) as file:
        chunks = file.chunks(lambda channel: asked.append(channel.topic) or channel.topic == "/b")
        times = [message.log_time_ns for chunk in chunks for message in chunk]
    assert times == TIMES[1::2]
    assert sorted(asked) == ["/a", "/b"]
    assert file.last_ns == TIMES[-1]


def test_cut_anywhere_it_is_read_up_to_there(tmp_path: Path) -> None:
    whole, path = written(), tmp_path / "run.mcap"
    most = 0
    for size in range(len(MCAP0_MAGIC), len(whole), 5):
        path.write_bytes(whole[:size])
        times, cut_at = times_of(path)
        assert times == TIMES[: len(times)]
        assert len(times) >= most  # the longer the file, the more of it
        assert cut_at is not None
        assert cut_at <= size
        most = len(times)
    assert most == len(TIMES)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_flipped_bits_are_noticed_or_harmless(tmp_path: Path, compression: CompressionType) -> None:
    whole, path = written(compression), tmp_path / "run.mcap"
    rng = random.Random(5)
    refused = 0
    for _ in range(150):
        damaged = bytearray(whole)
        for _ in range(rng.choice((1, 1, 4, 30))):
            damaged[rng.randrange(len(MCAP0_MAGIC), len(whole))] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        try:
            times, cut_at = times_of(path)
        except InputError as error:
            assert str(error).startswith(f"{path}: ")
            assert "\n" not in str(error)
            refused += 1
            continue
        # Chunks have check sums; cut short is what has lost its end.
        assert times == TIMES[: len(times)]
        assert len(times) == len(TIMES) or cut_at is not None
    assert refused > 40


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def chunk(compression: str, data: bytes, size: int, crc: int = 0) -> bytes:
    head = struct.pack("<QQQI", 0, 1, size, crc)
    return record(6, head + text(compression) + struct.pack("<Q", len(data)) + data)


HEADER = record(1, text("ros2") + text("test"))
END = record(15, bytes(4)) + record(2, bytes(20))
MESSAGE = record(5, struct.pack("<HIQQ", 9, 0, 0, 0))
BOMB = bytes(300_000_000)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (HEADER + chunk("", MESSAGE, len(MESSAGE)), "channel 9"),
        (HEADER + chunk("", MESSAGE, len(MESSAGE), 17), "check sum"),
        (HEADER + chunk("", MESSAGE, 3), "instead of 3"),
        (HEADER + chunk("", record(5, b"short"), 14), "shorter"),
        (HEADER + chunk("", MESSAGE[:-1], len(MESSAGE) - 1), "amid a record"),
        (HEADER + chunk("", MESSAGE + b"\x05", len(MESSAGE) + 1), "channel 9"),
        (HEADER + chunk("rar", b"", 0), "'rar'"),
        (HEADER + chunk("lz4", b"nonsense", 8), "cannot be unpacked"),
        (HEADER + chunk("zstd", b"nonsense", 8), "cannot be unpacked"),
        (HEADER + chunk("lz4", b"", 2**60), "bytes"),
        (HEADER + record(6, b"too short"), "cannot be read"),
        (HEADER + record(9, b"too short"), "cannot be read"),
        (HEADER + record(12, text("name") + b"\xff\xff\xff\xff"), "cannot be read"),
        (HEADER + record(4, b""), "cannot be read"),
        (record(1, text("ros1") + text("")), "profile: 'ros1'"),
        (record(1, text("") + text("")), "profile: ''"),
        (record(1, b""), "cannot be read"),
        (MESSAGE, "no header"),
        (b"", "no header"),
        (HEADER + struct.pack("<BQ", 6, 2**63), "longer than the file"),
        (HEADER + record(0, b"x"), "no kind"),
        (HEADER + record(2, bytes(20)) + MESSAGE, "more after its end"),
        (HEADER + record(11, struct.pack("<QHIIIIQQI", 3, *[0] * 8)), "0 messages instead of 3"),
    ],
)
def test_nonsense_is_one_line_that_says_where(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(MCAP0_MAGIC + content + END + MCAP0_MAGIC)
    with pytest.raises(InputError) as caught:
        times_of(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ")
    assert told in line
    assert "\n" not in line


@pytest.mark.parametrize(
    ("compression", "pack"),
    [("lz4", lz4.frame.compress), ("zstd", zstandard.compress)],
)
def test_a_small_chunk_does_not_become_a_large_one(
    tmp_path: Path, compression: str, pack: Callable[[bytes], bytes]
) -> None:
    path = tmp_path / "run.mcap"
    packed = pack(BOMB)
    for size in (1000, len(BOMB)):
        path.write_bytes(MCAP0_MAGIC + HEADER + chunk(compression, packed, size) + END)
        with pytest.raises(InputError, match="damaged at byte"):
            times_of(path)


def test_an_attachment_has_a_check_sum_too(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    body = (
        struct.pack("<QQ", 0, 0) + text("scenario.yaml") + text("") + struct.pack("<Q", 2) + b"ab"
    )
    good = body + struct.pack("<I", zlib.crc32(body))
    path.write_bytes(MCAP0_MAGIC + HEADER + record(9, good) + END + MCAP0_MAGIC)
    assert times_of(path) == ([], None)
    path.write_bytes(MCAP0_MAGIC + HEADER + record(9, b"\1" + good[1:]) + END + MCAP0_MAGIC)
    with pytest.raises(InputError, match=r"check sum of scenario\.yaml"):
        times_of(path)


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"", "is empty"), (b"name: tiny\n", "is not an MCAP file"), (MCAP0_MAGIC[:5], "not an MCAP")],
)
def test_what_is_no_recording(tmp_path: Path, content: bytes, told: str) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        RecordingFile(path)


@pytest.mark.parametrize(
    ("name", "told"), [("missing.mcap", "no such file"), ("folder", "is a directory")]
)
def test_what_is_no_file(tmp_path: Path, name: str, told: str) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match=told):
        RecordingFile(tmp_path / name)
