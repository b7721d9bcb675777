"""Verdicts on track codes: each says no where it must, and not before."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.supervision_report import OVERSPEED_MPS
from rail_corridor.equipment.track_code.placement import circuits_of
from rail_corridor.equipment.track_code.report import OLDEST_S

from ...run_builder import RunBuilder, built_in

SCENARIO = built_in("follow_codes")
TICK_S = SCENARIO.tick_s
#: Circuits of 500 m along 5000 m of track.
STEP_M = 500.0
LENGTH_M = SCENARIO.trains[0].vehicle.length_m
OLDEST = round(OLDEST_S / TICK_S)


def code(run: RunBuilder, train: str = "follower") -> dict[str, Any]:
    values: dict[str, Any] = run.train(train)["track_code"]
    return values


def test_circuits_and_times_are_as_counted_on_below() -> None:
    assert [c.start_m for c in circuits_of(SCENARIO)] == [STEP_M * n for n in range(10)]
    assert (OLDEST, LENGTH_M) == (32, 118.0)


def crossing(ticks: int, after: int) -> RunBuilder:
    """Return a run in which the follower passes from tc1, word 100, to tc2, word 101."""
    way_m = np.where(np.arange(ticks) < after, STEP_M - 1.0, STEP_M + 1.0)
    return RunBuilder("follow_codes", ticks).moves("follower", way_m)


@pytest.mark.parametrize(("ticks", "wrong"), [(OLDEST, 0), (OLDEST + 1, 1), (OLDEST + 4, 4)])
def test_a_word_is_wrong_once_it_was_at_the_antenna_too_long_ago(ticks: int, wrong: int) -> None:
    # The old word is at the antenna up to tick 9, and understood for so many ticks more.
    run = crossing(60, 10)
    told = np.where(np.arange(60) < 10 + ticks, 100.0, 101.0)
    values = code(run.understood("follower", told))
    assert values["wrong"] == wrong


def test_a_word_that_no_circuit_under_the_train_sent_is_wrong_at_once() -> None:
    told = np.full(20, 100.0)
    told[7:12] = 104.0  # that of tc5, far away
    assert code(crossing(20, 30).understood("follower", told))["wrong"] == 5
    assert code(crossing(20, 30).understood("follower", told, valid=0.0))["wrong"] == 0


def test_a_word_told_before_it_was_sent_is_wrong() -> None:
    told = np.where(np.arange(20) < 9, 100.0, 101.0)
    assert code(crossing(20, 10).understood("follower", told))["wrong"] == 1


def test_a_train_off_the_line_is_not_judged() -> None:
    run = RunBuilder("follow_codes", 10).moves("follower", 100.0, 50.0, on_line=0.0)
    section = run.understood("follower", 7.0).train("follower")
    assert section["track_code"]["wrong"] == 0
    assert section["atp"]["overspeed_s"] == 0.0


# Blocks ----------------------------------------------------------------------------------


def entered(leader_m: float, *, at_m: float = STEP_M) -> int:
    """Return what is counted when the follower's front comes to a border, the leader standing."""
    way_m = np.where(np.arange(8) < 4, at_m - 1.0, at_m)
    run = RunBuilder("follow_codes", 8).moves("follower", way_m).moves("leader", leader_m)
    counted: int = run.train("follower")["atp"]["entered_occupied"]
    return counted


@pytest.mark.parametrize(
    ("leader_m", "count"),
    [
        (STEP_M + 300.0, 1),
        # Its rear: the last hand's breadth of the block, or just beyond.
        (2.0 * STEP_M + LENGTH_M - 0.1, 1),
        (2.0 * STEP_M + LENGTH_M, 0),
        # Its front has just come into the block, or has not.
        (STEP_M + 0.1, 1),
        (STEP_M - 0.5, 0),
    ],
)
def test_a_block_is_entered_that_another_train_is_in(leader_m: float, count: int) -> None:
    assert entered(leader_m) == count


def test_two_fronts_at_the_very_same_place_are_in_one_block() -> None:
    assert entered(STEP_M) == 0  # the block begins there: nothing of the other is inside of it
    run = RunBuilder("follow_codes", 8).moves("leader", STEP_M + 20.0)
    run.moves("follower", np.where(np.arange(8) < 4, STEP_M - 1.0, STEP_M + 20.0))
    atp = run.train("follower")["atp"]
    assert atp["entered_occupied"] == 1
    assert atp["margin_min_m"] == -LENGTH_M


def test_each_block_that_is_entered_counts_and_standing_in_it_does_not() -> None:
    way_m = np.repeat([100.0, 600.0, 1100.0, 1600.0], 3)
    run = RunBuilder("follow_codes", 12).moves("follower", way_m)
    run.moves("leader", way_m + 200.0)
    assert run.train("follower")["atp"]["entered_occupied"] == 3
    assert run.train("leader")["atp"]["entered_occupied"] == 0


def test_put_on_the_line_in_a_block_is_not_entering_it() -> None:
    on_line = np.arange(8) >= 4
    run = RunBuilder("follow_codes", 8).moves("follower", STEP_M + 1.0, on_line=on_line)
    run.moves("leader", STEP_M + 300.0)
    assert run.train("follower")["atp"]["entered_occupied"] == 0


# How fast, and how near ------------------------------------------------------------------


@pytest.mark.parametrize(("over_mps", "ticks"), [(-1e-9, 0), (1e-9, 5)])
def test_overspeed_begins_half_a_metre_per_second_above_the_limit(
    over_mps: float, ticks: int
) -> None:
    # 80 km/h from 2350 m to 3000 m, 100 km/h before.
    way_m = np.where(np.arange(10) < 5, 2349.0, 2350.5)
    fast_mps = 80.0 / 3.6 + OVERSPEED_MPS + over_mps
    run = RunBuilder("follow_codes", 10).moves("follower", way_m, fast_mps)
    assert run.train("follower")["atp"]["overspeed_s"] == ticks * TICK_S


@pytest.mark.parametrize("gap_m", [0.5, 0.0, -0.5])
def test_the_gap_is_to_the_rear_of_the_train_ahead(gap_m: float) -> None:
    run = RunBuilder("follow_codes", 6).moves("leader", 1000.0)
    run.moves("follower", 1000.0 - LENGTH_M - gap_m)
    assert run.train("follower")["atp"]["margin_min_m"] == pytest.approx(gap_m)
    assert run.train("leader")["atp"]["margin_min_m"] is None


def test_a_block_that_is_entered_while_occupied_is_an_event() -> None:
    way_m = np.repeat([100.0, 600.0, 1100.0, 1600.0], 3)
    run = RunBuilder("follow_codes", 12).moves("follower", way_m)
    run.moves("leader", way_m + 200.0)
    report = run.report()
    events = [event for event in report["events"] if event["train"] == "follower"]
    assert [event["at_m"] for event in events] == [600.0, 1100.0, 1600.0]
    assert {event["kind"] for event in events} == {"occupied block entered"}
    assert report["event_counts"]["occupied_block_entered"] == 3


# Claims of circuits, and the code ---------------------------------------------------------


def test_a_circuit_clear_over_a_train_counts_once_it_had_time_to_notice() -> None:
    run = RunBuilder("follow_codes", 20).moves("leader", 1400.0).moves("follower", 100.0)
    for name in run.circuits:
        run.sensed(name, 0.0)
    section = run.train("leader")["track_code"]
    assert section["false_clear_s"] == section["clear_over_train_s"] == (20 - 6) * TICK_S
    # Held in the circuit behind it, it is clear over the train and yet harmless.
    section = run.sensed("tc2", 1.0).train("leader")["track_code"]
    assert (section["false_clear_s"], section["clear_over_train_s"] > 0.0) == (0.0, True)


def test_a_circuit_occupied_by_nobody_counts_for_the_train_before_it() -> None:
    run = RunBuilder("follow_codes", 40).moves("leader", 3000.0).moves("follower", 100.0)
    assert run.train("follower")["track_code"]["false_occupied_s"] == (40 - 14) * TICK_S
    run.sensed("tc2", 0.0)
    assert run.train("follower")["track_code"]["false_occupied_s"] == 0.0


def test_running_above_the_code_without_a_brake_counts() -> None:
    run = RunBuilder("follow_codes", 10).moves("follower", 100.0, 15.0)
    assert run.commanded("follower", 20.0).train("follower")["atp"]["above_code_s"] == 0.0
    assert run.commanded("follower", 10.0).train("follower")["atp"]["above_code_s"] == 10 * TICK_S
    run.commanded("follower", 10.0, service_brake=1.0)
    assert run.train("follower")["atp"]["above_code_s"] == 0.0


def test_running_above_what_the_circuit_sends_counts_whatever_is_permitted() -> None:
    run = RunBuilder("follow_codes", 10).moves("follower", 100.0, 15.0).sent("tc1", 100.0, 0x00)
    assert run.train("follower")["atp"]["above_code_s"] == 10 * TICK_S


def test_the_code_of_a_circuit_elsewhere_is_foreign() -> None:
    run = RunBuilder("follow_codes", 40).moves("follower", 100.0, 10.0)
    assert run.understood("follower", 100.0).train("follower")["atp"]["foreign_obeyed_s"] == 0.0
    run.understood("follower", 101.0)
    assert run.train("follower")["atp"]["foreign_obeyed_s"] == (40 - 17) * TICK_S
