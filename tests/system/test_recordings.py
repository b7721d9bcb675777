"""Recordings of running corridors: complete, readable by others, and good for a replay.

That a recording gives the report of its run is asked where runs are looked at: of all kinds of
scenarios and placements, killed and stopped ones too (`Rail.recorded`, `Rail.again`).
"""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import NonSeekingReader
from rosbags.highlevel import AnyReader

from rail_corridor.equipment.registry import kind_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_corridor.recording.part_names import parts_of
from rail_corridor.recording.parts import Recording
from rail_corridor.recording.topic_selection import TopicSelection
from rail_corridor.run.recorded_topics import check_topics
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.topics.qos import STREAM
from rail_msgs_py.topics.tick import CLOCK, READY
from rail_msgs_py.waveform import Waveform

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system


def counts(path: Path) -> dict[str, int]:
    """Return the messages of each topic, as the independent library reads them."""
    with AnyReader([path]) as reader:
        total = dict.fromkeys((c.topic for c in reader.connections), 0)
        for connection, _, raw in reader.messages():
            reader.deserialize(raw, connection.msgtype)
            total[connection.topic] += 1
    return total


def clocks_before_the_cut(path: Path) -> int:
    """Return how often the clock is there, as the library of the format reads it in a stream."""
    found = 0
    with path.open("rb") as stream, pytest.raises(EndOfFile):
        for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
            found += channel.topic == "/clock"
    return found


def test_nothing_is_lost_and_a_replay_is_heard_by_live_subscribers(
    rail: Rail, listener: Listener
) -> None:
    path = rail.directory / "demo.mcap"
    report = rail.report("demo", "--duration", 4, "--processes", "one", "--record", path)
    found, ticks = counts(path), report["ticks"]
    assert (ticks, report["missing_ticks"]) == (16, 0)
    streams = {
        name: count
        for name, count in found.items()
        if (kind := kind_of(name)) and kind.qos is STREAM
    }
    assert len(streams) > 60
    assert {*streams.values()} == {ticks}
    assert {found[name] for name in found if name.endswith(("/position", "/channel"))} == {ticks}
    assert found["/world/state"] == found["/world/radio_medium/links"] == ticks
    assert (found["/world/finished"], found["/ready"]) == (1, report["nodes"] + 1)

    clock, ready = listener.listen(CLOCK), listener.listen(READY)
    replay = rail.start("replay", path, "--start", 1)
    listener.until(lambda: clock and to_ns(clock[-1].clock) == 3_750_000_000)
    assert rail.finish(replay) == 0, rail.errors(replay)
    stamps = [to_ns(message.clock) for message in clock]
    # A subscriber that keeps eight may miss some on a busy machine, but nothing comes twice.
    assert stamps == sorted({*stamps})
    assert stamps[0] >= 1_000_000_000
    assert len(stamps) > 5
    # What was latched before the start is there as well.
    assert len(ready) == report["nodes"] + 1

    stopped = rail.start("replay", path, "--rate", 0.2)
    listener.until(lambda: len(clock) > len(stamps))
    stopped.send_signal(signal.SIGINT)
    assert rail.finish(stopped) == 128 + signal.SIGINT
    assert "Traceback" not in rail.errors(stopped)


def test_a_recorder_that_is_killed_leaves_what_it_has_written(
    rail: Rail, wait_until: Callable[..., Any]
) -> None:
    path, json_path = rail.directory / "run.mcap", rail.directory / "report.json"
    run = rail.start(
        *("run", "plain_line", "--rate", 4, "--duration", 12, "--processes", "one"),
        *("--record", path, "--report", json_path),
    )
    wait_until(lambda: path.exists() and path.stat().st_size > 500_000)
    (pid,) = (pid for pid, name in rail.processes().items() if name == "rail_recorder")
    os.kill(pid, signal.SIGKILL)
    assert rail.finish(run) == 1
    assert "recording to" in rail.output(run)
    assert "the run goes on" in rail.output(run)
    assert json.loads(json_path.read_text())["complete"]
    shown = rail.start("report", path)
    assert rail.finish(shown) == 0
    assert rail.output(shown).count("is cut short at byte") == 1
    assert "stopped early" in rail.output(shown)
    assert clocks_before_the_cut(path) > 5


def test_a_full_disk_is_told_and_the_run_goes_on(rail: Rail) -> None:
    path = rail.directory / "full.mcap"
    path.symlink_to("/dev/full")
    json_path = rail.directory / "report.json"
    run = rail.start(
        *("run", "plain_line", "--duration", 3, "--processes", "one"),
        *("--record", path, "--report", json_path),
    )
    assert rail.finish(run) == 1
    assert rail.errors(run) == f"rail: {path}: No space left on device\n"
    assert rail.output(run).count("has failed") == 1
    assert json.loads(json_path.read_text())["complete"]


def test_a_selection_in_parts_gives_the_report_of_the_run(rail: Rail) -> None:
    path = rail.directory / "run.mcap"
    report = rail.report(
        *("moving_block", "--duration", 90, "--processes", "one", "--record", path),
        *("--no-waveforms", "--record-split", 1),
    )
    assert len(parts_of(path)) > 1
    assert rail.again(path) == report
    with Recording(path) as file:
        for _ in file.chunks(lambda _: False):
            pass
        names = {channel.topic for channel in file.channels}
    kinds = {name: kind_of(name) for name in names}
    assert not [name for name, kind in kinds.items() if kind and kind.view is Waveform]
    # Whatever is there can be asked for by its name.
    with TemporaryDirectory() as directory:
        plan = make_plan(load_scenario("moving_block"), Path(directory))
    check_topics(TopicSelection(tuple(names), waveforms=False), plan)
