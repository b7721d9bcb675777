"""What the report notes of what nodes say of their health: changes, each at its first time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_corridor.report.intake import Intake, names_read
from rail_msgs_py.stamps import to_time
from rail_msgs_py.topics.qos import LATCHED

OK, WARN = DiagnosticStatus.OK, DiagnosticStatus.WARN


@pytest.fixture
def intake(tmp_path: Path) -> Intake:
    return Intake(make_plan(load_scenario("plain_line"), tmp_path))


def say(intake: Intake, time_s: float, *statuses: tuple[str, bytes, str]) -> None:
    array = DiagnosticArray(
        status=[
            DiagnosticStatus(name=name, level=level, message=text, hardware_id=name.split(":")[0])
            for name, level, text in statuses
        ]
    )
    for field, value in to_time(round(time_s * 1e9)).items():
        setattr(array.header.stamp, field, value)
    (reader,) = (reader for reader in intake.readers if reader.name == "/diagnostics")
    reader.take(bytes(serialize_message(array)))


def noted(intake: Intake) -> list[tuple[Any, ...]]:
    return [(round(e["time_s"], 6), e["name"], e["level"], e["message"]) for e in intake.events]


def test_repeats_are_not_events(intake: Intake) -> None:
    lamp, good, bad = ("/d: lamp", OK, "lit"), ("/d: cable", OK, "good"), ("/d: cable", WARN, "bad")
    other = ("/e: cable", WARN, "bad")
    say(intake, 0.5, bad)
    for time_s in (1.0, 2.0, 3.0):
        say(intake, time_s, bad, lamp)
        say(intake, time_s, other)
    say(intake, 3.2, good)
    say(intake, 3.4, bad)  # as before: a change all the same
    say(intake, 4.0, bad, lamp)
    say(intake, 4.5, good)
    say(intake, 5.0, good, lamp)
    assert noted(intake) == [
        (0.5, *("/d: cable", "warn", "bad")),
        (1.0, *("/d: lamp", "ok", "lit")),
        (1.0, *("/e: cable", "warn", "bad")),
        (3.2, *("/d: cable", "ok", "good")),
        (3.4, *("/d: cable", "warn", "bad")),
        (4.5, *("/d: cable", "ok", "good")),
    ]


def test_what_is_not_kept_for_the_report_is_waited_for(tmp_path: Path) -> None:
    plan = make_plan(load_scenario("moving_block"), tmp_path)
    kept = {reader.name for reader in Intake(plan).readers if reader.topic.qos is LATCHED}
    assert kept == {"/failed", "/world/finished"}
    assert names_read(plan) == {reader.name for reader in Intake(plan).readers} - kept
