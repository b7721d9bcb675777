"""A recording in parts: each a file in itself, all of them together one recording."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader

from rail_corridor.errors import InputError
from rail_corridor.recording.mcap_file import RecordingFile
from rail_corridor.recording.part_names import NEXT, PART, part_path, parts_of
from rail_corridor.recording.parts import Recording, part_number, remove_old_parts
from rail_corridor.recording.replay import ReplayOptions, offers_of, ordered, span_of
from rail_corridor.recording.topic_selection import TopicSelection
from rail_corridor.report.from_recording import report_of

#: Small enough for several parts, large enough for the scenario and a chunk in each.
PART_BYTES = 12_000


@pytest.fixture
def run(made_up: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a run that is recorded in several parts."""
    monkeypatch.setattr("rail_corridor.recording.mcap_recorder.CHUNK_NS", 500_000_000)
    made = made_up()
    made.write(part_bytes=PART_BYTES)
    return made


def messages_of(path: Path) -> list[Any]:
    """Return every message from a part on."""
    with Recording(path) as file:
        return [message for chunk in file.chunks() for message in chunk]


def replayed(path: Path) -> list[Any]:
    """Return what is published from a part on."""
    with Recording(path) as file:
        for _ in file.chunks(lambda _: False):
            pass
        offers, (begin_ns, end_ns) = offers_of(file.channels, ()), span_of(file, ReplayOptions())
    with Recording(path) as file:
        return list(ordered(file, offers, begin_ns, end_ns))


def test_together_they_hold_every_message_once_in_its_order(run: Any) -> None:
    assert len(parts_of(run.path)) > 2
    found = [(message.channel.topic, message.data) for message in messages_of(run.path)]
    assert found == [(name, raw) for _, name, raw in run.said]
    assert run.reported() == run.report


def test_the_latest_failure_is_there_in_each_part_behind_it_but_said_once(run: Any) -> None:
    failures = [m for m in messages_of(run.path) if m.channel.topic == "/failed"]
    assert len(failures) == 2
    last = parts_of(run.path)[-1]
    repeated = [m for m in messages_of(last) if m.channel.topic == "/failed"]
    assert [m.data for m in repeated] == [m.data for m in failures]
    assert {m.log_time_ns for m in repeated} == {min(m.log_time_ns for m in messages_of(last))}


def test_each_part_is_a_file_in_itself_for_an_independent_library(run: Any) -> None:
    paths = parts_of(run.path)
    clocks = 0
    for number, path in enumerate(paths):
        assert path.stat().st_size > PART_BYTES or path == paths[-1]
        with RecordingFile(path) as file:
            for _ in file.chunks():
                pass
        assert "scenario.yaml" in [each.name for each in file.attachments]
        assert file.cut_at is None
        assert part_number(file) == number
        assert (NEXT in file.metadata) is (path != paths[-1])
        with AnyReader([path]) as reader:
            for connection, _, raw in reader.messages():
                reader.deserialize(raw, connection.msgtype)
                clocks += connection.topic == "/clock"
    assert clocks == sum(name == "/clock" for _, name, _ in run.said)


def test_a_part_has_room_for_messages_however_much_it_begins_with(run: Any) -> None:
    for path in parts_of(run.path):
        path.unlink()
    run.write(part_bytes=1)
    assert len(parts_of(run.path)) < 12
    assert run.reported() == run.report


def test_a_replay_publishes_all_of_them_or_from_one_on(run: Any) -> None:
    out = replayed(run.path)
    assert sorted((m.channel.topic, m.data) for m in out) == sorted((s[1], s[2]) for s in run.said)
    last = replayed(parts_of(run.path)[-1])
    clocks = [m.data for m in out if m.channel.topic == "/clock"]
    late = [m.data for m in last if m.channel.topic == "/clock"]
    assert 0 < len(late) < len(clocks)
    assert clocks[-len(late) :] == late
    assert last[0].channel.topic == "/failed"


def test_one_that_is_cut_short_ends_the_recording(run: Any) -> None:
    run.write(whole=False, part_bytes=PART_BYTES)  # as of a recorder that was killed
    last = parts_of(run.path)[-1]
    last.write_bytes(last.read_bytes()[:-300])
    with Recording(run.path) as file:
        report = report_of(file)
    assert file.cut_at is not None
    assert file.last_path == last
    assert report["complete"] is False
    assert 0 < report["ticks"] < run.report["ticks"]


def test_a_part_that_is_missing_or_of_another_recording_is_one_line(
    run: Any, made_up: Callable[..., Any]
) -> None:
    second, third = part_path(run.path, 1), part_path(run.path, 2)
    raw = second.read_bytes()
    second.write_bytes(third.read_bytes())
    with pytest.raises(InputError, match=r"run_1\.mcap: does not go on with run\.mcap"):
        run.reported()
    second.write_bytes(raw.replace(b"made up", b"made on"))
    with pytest.raises(InputError, match=r"run_1\.mcap: does not go on with run\.mcap"):
        run.reported()
    second.unlink()
    with pytest.raises(InputError, match=r"run_1\.mcap: the recording goes on there: there is no"):
        run.reported()


def test_a_later_part_gives_no_report(run: Any) -> None:
    with (
        pytest.raises(InputError, match=r"run_1\.mcap: is part 1 of a recording"),
        Recording(part_path(run.path, 1)) as file,
    ):
        report_of(file)


def test_a_recording_without_what_a_report_reads_is_one_line(run: Any) -> None:
    run.write(selection=TopicSelection(("/train_a/*",)))
    told = r"recorded with --record-topics /train_a/\*, without /failed and \d+ more topics"
    with pytest.raises(InputError, match=told) as caught:
        run.reported()
    assert str(caught.value).startswith(f"{run.path}: ")


def test_a_recording_without_waveforms_gives_the_same_report(run: Any) -> None:
    run.write(selection=TopicSelection(waveforms=False))
    assert run.reported() == run.report


def test_a_number_that_is_none_is_one_line(run: Any) -> None:
    second = part_path(run.path, 1)
    with RecordingFile(second) as file:
        file.metadata[PART]["number"] = "one"
        with pytest.raises(InputError, match=r"rail_corridor\.part\.number: 'one'"):
            part_number(file)


def test_old_parts_are_removed_unless_one_is_something_else(run: Any) -> None:
    paths = parts_of(run.path)
    other = part_path(run.path, len(paths))
    other.write_bytes(run.path.read_bytes())  # a first part, under the name of a later one
    with pytest.raises(InputError, match="is none of an earlier recording's parts"):
        remove_old_parts(run.path)
    assert parts_of(run.path) == [*paths, other]
    other.unlink()
    remove_old_parts(run.path)
    assert parts_of(run.path) == [run.path]
