"""A run of one train made up of messages, and its recording."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import deserialize_message, serialize_message

from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.loading.scenario_files import files_of
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.recording.frames import (
    ATTACHMENT,
    CHANNEL,
    MESSAGE,
    METADATA,
    Attachment,
    ChannelInfo,
    attachment_frame,
    channel_frame,
    metadata_frame,
)
from rail_corridor.recording.mcap_recorder import McapRecorder, Source
from rail_corridor.recording.part_names import Split
from rail_corridor.recording.parts import Recording
from rail_corridor.recording.run_facts import BEGIN, END, RunEnd, RunStart
from rail_corridor.recording.topic_selection import EVERY_TOPIC, TopicSelection
from rail_corridor.report.from_recording import report_of
from rail_corridor.report.intake import Intake
from rail_corridor.report.report import make_report, report_text
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.failures import failure
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.message_definition import type_name
from rail_msgs_py.position import Position, PositionWriter
from rail_msgs_py.stamps import clock_to_cdr, to_time
from rail_msgs_py.table import TableWriter
from rail_msgs_py.topics.qos_text import offered_profiles
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.tick import CLOCK, DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE
from rail_world.ranging.description import RadioDescription

TRAIN = "train_a"
TICKS = 60
NODES, PROCESSES = 9, 3


class Said(NamedTuple):
    """One message on a topic."""

    topic: Topic
    name: str
    raw: bytes


def _situation(directory: Path) -> tuple[Scenario, Plan]:
    """Return the scenario and plan of the run."""
    scenario = load_scenario("plain_line", overrides=Overrides(duration_s=TICKS * 0.1))
    return scenario, make_plan(scenario, directory)


def _health(stamp_ns: int, name: str, level: bytes, message: str) -> bytes:
    array = DiagnosticArray(status=[DiagnosticStatus(level=level, name=name, message=message)])
    for key, value in to_time(stamp_ns).items():
        setattr(array.header.stamp, key, value)
    return bytes(serialize_message(array))


def _messages(plan: Plan, ticks: int = TICKS) -> Iterator[Said]:
    """Yield what is said in so many ticks."""
    rng = np.random.default_rng(3)
    state = TableWriter((TRAIN,), STATE.columns)
    links = TableWriter((TRAIN,), LINKS.columns)
    channels = {a.downlink_channel for a in plan.world.part("ranging", RadioDescription).stations}
    channel = TableWriter((TRAIN,), tuple(f"c{n}" for n in range(2 + len(channels))))
    position = PositionWriter(TRAIN, "main")
    here = STATE.index
    for tick in range(ticks):
        ns, way_m = tick * plan.world.tick_ns, 20.0 + 2.0 * tick
        values = np.zeros((1, len(here)))
        values[0, [here["path_m"], here["x_m"], here["chainage_m"]]] = way_m
        values[0, [here["speed_mps"], here["on_line"]]] = 20.0, 1.0
        yield Said(STATE, STATE.name(), state.write(ns, values))
        yield Said(CLOCK, CLOCK.name(), clock_to_cdr(ns))
        row = np.array([[1.0, 2.0, -50.0, *[-90.0] * (len(channels) - 1)]])
        yield Said(VRS_CHANNEL, VRS_CHANNEL.name(train=TRAIN), channel.write(ns, row))
        known = tick % 9 != 4
        told = Position(
            *(ns, TRAIN, "main", way_m + 0.2 * rng.standard_normal()),
            *(0.04 if known else math.inf, 20.0, 1.0),
        )
        raw = position.write(told)
        yield Said(POSITION, POSITION.name(train=TRAIN), raw)
        snr = np.array([[900.0, 1100.0, 1.0, 2.0]])
        yield Said(LINKS, LINKS.name(), links.write(ns, snr))
        if tick == 30:
            for by in ("/world/radio_medium", "the launcher"):
                raw = bytes(serialize_message(failure("/wayside/wrs3", "silent", by, ns)))
                yield Said(FAILED, "/failed", raw)
        if tick % 20 == 7:
            for name in ("/wayside/wrs1: zone1", "/train_a/vrs: ranging"):
                raw = _health(ns, name, DiagnosticStatus.WARN, f"jammed at {tick}")
                yield Said(DIAGNOSTICS, "/diagnostics", raw)
    if ticks == TICKS:
        yield Said(FINISHED, "/world/finished", header_to_cdr((ticks - 1) * 100_000_000))


def _heard(plan: Plan, scenario: Scenario, said: list[Said]) -> Intake:
    """Return an intake that has heard all of this, as a live one would."""
    intake = Intake(plan)
    readers = {reader.name: reader for reader in intake.readers}
    for topic, name, raw in said:
        if name in readers:
            reader = readers[name]
            reader.take(raw if reader.raw else deserialize_message(raw, topic.type))
    intake.first_tick_s, intake.last_tick_s = 0.0, 2.625
    return intake


def _write(
    path: Path,
    scenario: Scenario,
    said: list[Said],
    report: dict[str, Any] | None = None,
    *,
    files: list[Attachment] | None = None,
    selection: TopicSelection = EVERY_TOPIC,
    part_bytes: int | None = None,
) -> None:
    """Record these messages; with the report of the run, if it came to one."""
    run_start = RunStart(scenario.name, scenario.seed, NODES, PROCESSES, selection)
    split = None if part_bytes is None else Split(path, part_bytes, "made up")
    with path.open("wb") as stream:
        recorder = McapRecorder(
            stream,
            files_of(scenario) if files is None else files,
            {BEGIN: run_start.values()},
            split,
        )
        source, numbers = Source(), {}
        for topic, name, raw in said:
            if name not in numbers:
                numbers[name] = len(numbers) + 1
                info = ChannelInfo(name, type_name(topic.type), offered_profiles(topic.qos))
                frame = memoryview(channel_frame(numbers[name], info))[7:]
                recorder.take(source, CHANNEL, numbers[name], frame)
            recorder.take(source, MESSAGE, numbers[name], memoryview(raw))
        if report is not None:
            file = Attachment("report.json", "application/json", report_text(report).encode())
            recorder.take(source, ATTACHMENT, 0, memoryview(attachment_frame(file))[7:])
            end = RunEnd(report["complete"], report["ticks"], report["wall_time_s"])
            recorder.take(source, METADATA, 0, memoryview(metadata_frame(END, end.values()))[7:])
        recorder.close()
        recorder.stream.close()


class MadeUpRun:
    """A run: what was said, and the report made while it went."""

    def __init__(self, directory: Path, ticks: int = TICKS, ending: int | None = None) -> None:
        self.path = directory / "run.mcap"
        self.scenario, self.plan = _situation(directory)
        self.said = list(_messages(self.plan, ticks))
        intake = _heard(self.plan, self.scenario, self.said)
        if ending is not None:
            intake.recording.end_at(ending)
        self.report = make_report(
            self.scenario,
            self.plan,
            intake,
            nodes=NODES,
            processes=PROCESSES,
            interrupted=ending is not None,
        )

    def write(self, said: list[Any] | None = None, *, whole: bool = True, **more: Any) -> None:
        report = self.report if whole else None
        _write(self.path, self.scenario, said or self.said, report, **more)

    def reported(self) -> dict[str, Any]:
        with Recording(self.path) as file:
            return report_of(file)


@pytest.fixture
def made_up(tmp_path: Path) -> Callable[..., MadeUpRun]:
    """Return what makes up a run: of so many ticks, the report of which ends at one of them."""
    return lambda **more: MadeUpRun(tmp_path, **more)
