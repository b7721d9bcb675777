"""Patterns of topics that a run will not have are refused before anything starts."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.recording.topic_selection import TopicSelection
from rail_corridor.run.options import RecordOptions, RunOptions
from rail_corridor.run.recorded_topics import check_recorded_topics, check_topics


@cache
def plan_of(name: str) -> Plan:
    """Return the plan of a built-in scenario."""
    with TemporaryDirectory() as directory:
        return make_plan(load_scenario(name), Path(directory))


def check(scenario: str, *patterns: str, waveforms: bool = True) -> None:
    check_topics(TopicSelection(patterns, waveforms), plan_of(scenario))


@pytest.mark.parametrize(
    ("scenario", "pattern"),
    [
        *(("demo", p) for p in ("*", "/clock", "/ready", "*/done", "/report/t*", "/world/main/*")),
        ("demo", "/report/train_a/truth/pose"),
        *(("demo", p) for p in ("/train_a/*", "/train_?/vrs/channel_[12]/rx", "*/zone1/tx")),
        ("demo", "/world/radio_medium/done"),
        ("moving_block", "/wayside/base1/cbtc/*link"),
        ("moving_block", "/wayside/zone_controller/first/authority"),
        ("moving_block", "/first/atp/command"),
        ("hostile_network", "/world/backbone/*"),
        ("failing_bus", "*/bus_head/link"),
        ("follow_codes", "/wayside/tc1/track_code/occupancy"),
        ("sensors", "*/doppler/fix"),
    ],
)
def test_a_topic_of_the_run_is_found(scenario: str, pattern: str) -> None:
    check(scenario, pattern)


@pytest.mark.parametrize(
    ("scenario", "pattern"),
    [
        *(("demo", p) for p in ("", "clock", "/train_z/*", "*/zone99/tx", "/world/radio", "*/Tx")),
        *(("demo", p) for p in ("/train_a/vrs/channel_77/rx", "/*/doppler/*", "*/atp/*")),
        ("moving_block", "/world/backbone/*"),
        ("moving_block", "/first/code_supervision/command"),
        ("plain_line", "*/occupancy"),
    ],
)
def test_one_that_it_will_not_have_is_one_line(scenario: str, pattern: str) -> None:
    with pytest.raises(InputError, match=f"fits no topic of {scenario}$") as caught:
        check(scenario, "*", pattern)
    assert (caught.value.field, caught.value.value) == ("--record-topics", pattern)


def test_waveforms_that_are_left_out_cannot_be_selected() -> None:
    check("demo", "*/tx")
    with pytest.raises(InputError, match="fits no topic of demo that carries no waveforms"):
        check("demo", "*/tx", waveforms=False)


def test_beside_somebody_elses_node_every_pattern_is_good() -> None:
    record = RecordOptions(Path("run.mcap"), TopicSelection(("/mine/*",)))
    check_recorded_topics(RunOptions(), plan_of("demo"))
    check_recorded_topics(RunOptions(record=record, external=("/wayside/wrs1",)), plan_of("demo"))
    with pytest.raises(InputError, match="'/mine/\\*'"):
        check_recorded_topics(RunOptions(record=record), plan_of("demo"))
