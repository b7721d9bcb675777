"""``rail report FILE.mcap``: the report of a recorded run, computed anew from its messages.

Load, measure, report: the messages go through the same intake and the same measures as those of
a run under way. Only what no message tells is taken from the notes of the run: how many nodes
and processes it had, whether it came to its end, and how long it took.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rclpy.serialization import deserialize_message
from rich.console import Console

from rail_corridor.errors import InputError
from rail_corridor.loading.scenario_files import scenario_from
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.recording.mcap_file import RecordedChannel, RecordedMessage
from rail_corridor.recording.parts import Recording
from rail_corridor.recording.run_facts import BEGIN, END, RunEnd, RunStart
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.message_definition import type_name

from .intake import Intake, Reader
from .report import make_report, print_report, print_verdict, write_report

REPORT = "report.json"


def show_report(path: Path, json_path: Path | None, console: Console) -> int:
    """Print the report of a recording, and write it; returns the exit code."""
    with Recording(path) as file:
        report = report_of(file)
    if file.cut_at is not None:
        console.print(
            f"{file.last_path} is cut short at byte {file.cut_at}: "
            "this is the report of what is there",
            soft_wrap=True,
            highlight=False,
        )
    print_report(report, console)
    different = differences(report, _reported(file))
    if different:
        line = f"not what the run itself reported: {', '.join(different)}"
        console.print(f"[yellow]{line}[/yellow]", soft_wrap=True, highlight=False)
    if json_path is not None:
        write_report(report, json_path)
        console.print(f"report written to {json_path}")
    print_verdict(report, console)
    return 0


class RecordedRun(NamedTuple):
    """A run as its recording tells it; ``run_end`` is None if that was cut short."""

    scenario: Scenario
    plan: Plan
    intake: Intake
    run_start: RunStart
    run_end: RunEnd | None


def report_of(file: Recording) -> dict[str, Any]:
    """Report of a recording; reads it to its end.

    Raises
    ------
    InputError
        If it is damaged, or not a recording of a corridor.
    """
    run = run_of(file)
    run_end, intake = run.run_end, run.intake
    wall_s = math.nan if run_end is None or run_end.wall_time_s is None else run_end.wall_time_s
    intake.first_tick_s, intake.last_tick_s = 0.0, wall_s
    return make_report(
        run.scenario,
        run.plan,
        intake,
        nodes=run.run_start.nodes,
        processes=run.run_start.processes,
        interrupted=run_end is None or not run_end.complete,
    )


def run_of(file: Recording) -> RecordedRun:
    """What a recording tells of its run; reads it to its end, raises as `report_of`."""
    name = str(file.path)
    with tempfile.TemporaryDirectory(prefix="rail_corridor_") as directory:
        try:
            scenario = scenario_from(file.attachments, Path(directory))
            run_start = RunStart.of(file.metadata.get(BEGIN, {}))
            plan = make_plan(scenario, Path(directory))
            intake = Intake(plan)
            _check_complete(file, run_start, intake)
            _feed(file, intake)
            run_end = RunEnd.of(file.metadata[END]) if END in file.metadata else None
        except InputError as error:
            raise error.located(name) from None
    recording = intake.recording
    if run_end is None:
        recording.end_at(max(recording.ticks - 1, 0))
    elif not run_end.complete:
        recording.end_at(run_end.ticks)
    return RecordedRun(scenario, plan, intake, run_start, run_end)


def differences(ours: Mapping[str, Any], theirs: Mapping[str, Any] | None) -> list[str]:
    """Names of the values in which two reports differ; none where there is but one report.

    >>> differences({"ticks": 3, "trains": {"a": {"max_m": 0.5}}}, {"ticks": 3, "trains": {}})
    ['trains']
    >>> differences({"trains": {"a": {"max_m": 0.5}}}, {"trains": {"a": {"max_m": 0.6}}})
    ['trains.a.max_m']
    """
    if theirs is None:
        return []
    report = []
    for key in sorted({*ours, *theirs}):
        one, other = ours.get(key), theirs.get(key)
        if isinstance(one, Mapping) and isinstance(other, Mapping) and {*one} == {*other}:
            report += [f"{key}.{name}" for name in differences(one, other)]
        elif one != other:
            report.append(key)
    return report


def _reported(file: Recording) -> dict[str, Any] | None:
    """The report that the run made itself, None if it did not come to that."""
    for attachment in file.attachments:
        if attachment.name == REPORT:
            try:
                report = json.loads(attachment.data)
            except ValueError:
                return None
            return report if isinstance(report, dict) else None
    return None


def _check_complete(file: Recording, run_start: RunStart, intake: Intake) -> None:
    """Raise InputError for a recording that does not hold all that a report reads."""
    if file.number:
        raise InputError(f"is part {file.number} of a recording: name the first, with no number")
    selection = run_start.selection
    names = [each.name for each in intake.readers if not selection.takes(each.topic, each.name)]
    if names:
        more = f" and {len(names) - 1} more topics" if len(names) > 1 else ""
        raise InputError(
            f"recorded with {selection.describe()}, without {names[0]}{more} that a report reads",
        )


def _feed(file: Recording, intake: Intake) -> None:
    """Give every message that the report reads to its reader."""
    readers = {reader.name: reader for reader in intake.readers}

    def wanted(channel: RecordedChannel) -> bool:
        reader = readers.get(channel.topic)
        if reader is None:
            return False
        kind = type_name(reader.topic.type)
        if channel.type != kind:
            raise InputError(f"must be of type {kind}", field=channel.topic, value=channel.type)
        return True

    for chunk in file.chunks(wanted):
        for message in chunk:
            _take(readers[message.channel.topic], message)


def _take(reader: Reader, message: RecordedMessage) -> None:
    try:
        data = message.data
        reader.take(data if reader.raw else deserialize_message(data, reader.topic.type))
    except Exception as error:  # whatever nonsense makes of the readers
        what = f"{type(error).__name__}: {error}"
        raise InputError(
            f"the message at {message.log_time_ns * 1e-9:g} s cannot be read: {what}",
            field=message.channel.topic,
            value=message.data[:16].hex(),
        ) from None
