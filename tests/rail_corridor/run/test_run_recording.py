"""The recorder as a process: what it leaves when it is told all, and when the disk is full."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from rail_corridor.errors import InputError
from rail_corridor.recording.frames import Attachment
from rail_corridor.recording.mcap_file import RecordingFile
from rail_corridor.recording.part_names import part_path, parts_of
from rail_corridor.recording.parts import Recording
from rail_corridor.recording.topic_selection import TopicSelection
from rail_corridor.run.options import RecordOptions
from rail_corridor.run.run_recording import RunRecording
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.topics.ranging import WRS_TX
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.waveform import Waveform

TICK_NS = 100_000_000
SCENARIO = Attachment("scenario.yaml", "application/yaml", b"name: tiny\n")
#: Only ever reached by a test that fails.
PATIENCE_S = 20.0


@contextmanager
def no_file_larger_than(size: int) -> Iterator[None]:
    """As a disk that fills up, for processes started within."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def block(stamp_ns: int, rng: np.random.Generator) -> bytes:
    """Return noise, which does not compress."""
    return Waveform(stamp_ns, 4e6, 2.4e9, 1, rng.standard_normal((1, 4000)) + 0j).to_cdr()


def told(recording: RunRecording, ticks: int) -> int:
    """Tell a clock and a waveform, until there is trouble; return the ticks that were told."""
    tap, rng = recording.start(), np.random.default_rng(4)
    clock = tap.open(CLOCK, "/clock")
    send = tap.open(WRS_TX, "/wayside/wrs1/zone1/tx")
    for tick in range(ticks):
        clock(clock_to_cdr(tick * TICK_NS))
        send(block(tick * TICK_NS, rng))
        if recording.trouble() is not None:
            return tick
    return ticks


def test_all_that_was_told_is_there_and_an_old_file_is_gone(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(b"old" * 1_000_000)
    recording = RunRecording(RecordOptions(path), (), [SCENARIO], {"begin": {"seed": "7"}})
    assert told(recording, 40) == 40
    recording.tell([Attachment("report.json", "application/json", b"{}")], {"end": {}})
    assert recording.finish() is None
    with RecordingFile(path) as file:
        times = [message.log_time_ns for chunk in file.chunks() for message in chunk]
    assert times == [tick * TICK_NS for tick in range(40) for _ in range(2)]
    assert [each.name for each in file.attachments] == ["scenario.yaml", "report.json"]
    assert file.cut_at is None


def test_a_disk_that_fills_up_leaves_every_whole_chunk(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, room = tmp_path / "run.mcap", 5_000_000
    with no_file_larger_than(room):
        recording = RunRecording(RecordOptions(path), (), [SCENARIO], {})
    begun_s = time.monotonic()
    ticks = told(recording, 2000)
    assert time.monotonic() - begun_s < PATIENCE_S
    assert ticks < 2000
    assert recording.finish() is not None
    assert capfd.readouterr().err == f"rail: {path}: File too large\n"
    with RecordingFile(path) as file:
        times = [message.log_time_ns for chunk in file.chunks() for message in chunk]
    assert file.cut_at is not None
    assert [each.name for each in file.attachments] == ["scenario.yaml"]
    # A tick is 64 kB, and a chunk somewhat more than a megabyte.
    assert len(times) * 32_000 > room - 1_500_000
    assert times == [tick * TICK_NS for tick in range(ticks) for _ in range(2)][: len(times)]


@pytest.mark.parametrize(
    ("name", "told_reason"),
    [("folder.mcap", "Is a directory"), ("none/run.mcap", "No such file or directory")],
)
def test_what_cannot_be_written_is_one_line(tmp_path: Path, name: str, told_reason: str) -> None:
    (tmp_path / "folder.mcap").mkdir()
    with pytest.raises(InputError, match=f"--record: .*: {told_reason}"):
        RunRecording(RecordOptions(tmp_path / name), (), [], {})


def test_it_is_divided_and_told_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    options = RecordOptions(path, split_bytes=1_000_000)
    recording = RunRecording(options, (), [SCENARIO], {})
    assert told(recording, 80) == 80
    assert recording.finish() is None
    parts = parts_of(path)
    assert len(parts) > 2
    assert recording.describe() == f"{path} and {len(parts) - 1} more, to {parts[-1]}"
    with Recording(path) as file:
        times = [message.log_time_ns for chunk in file.chunks() for message in chunk]
    assert times == [tick * TICK_NS for tick in range(80) for _ in range(2)]
    again = RunRecording(RecordOptions(path, split_bytes=10**9), (), [SCENARIO], {})
    assert told(again, 3) == 3
    assert again.finish() is None
    assert parts_of(path) == [path]
    assert again.describe() == str(path)


def test_a_part_never_replaces_what_is_none(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    other = part_path(path, 1)
    other.write_bytes(b"of somebody else")
    with pytest.raises(InputError, match=r"--record-split: .*run_1\.mcap: is none of an"):
        RunRecording(RecordOptions(path, split_bytes=1_000_000), (), [], {})
    assert other.read_bytes() == b"of somebody else"
    assert not path.exists()


def test_what_is_not_selected_is_not_told(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    options = RecordOptions(path, TopicSelection(waveforms=False))
    recording = RunRecording(options, (), [], {})
    tap = recording.start()
    assert tap(WRS_TX, "/wayside/wrs1/zone1/tx") is None
    assert tap.select(WRS_TX, "/wayside/wrs1/zone1/tx") is None
    assert tap(CLOCK, "/clock") is not None
    assert recording.finish() is None
