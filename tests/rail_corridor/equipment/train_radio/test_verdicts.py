"""Verdicts on train control by radio: each says no where it must, and not before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.supervision_report import OVERSPEED_MPS

from ...run_builder import FAR_M, RunBuilder, built_in

SCENARIO = built_in("moving_block")
TICK_S = SCENARIO.tick_s
EMERGENCY_MPS2 = 0.9
LENGTH_M = 118.0
TICKS = 12
AT_M = 1000.0


def run(ticks: int = TICKS) -> RunBuilder:
    """Return a run in which all trains stand, the first ahead of the second by 350 m."""
    return RunBuilder("moving_block", ticks)


def test_the_figures_that_the_ways_below_are_computed_from() -> None:
    plan, train = SCENARIO.cbtc, SCENARIO.trains[0]
    assert plan is not None
    assert (plan.emergency_mps2, train.vehicle.length_m) == (EMERGENCY_MPS2, LENGTH_M)
    assert (TICK_S, plan.braking_mps2, plan.timeout_s) == (0.25, 0.7, 3.0)
    assert OVERSPEED_MPS == 0.5


def test_a_good_run_has_nothing_to_be_ashamed_of() -> None:
    for train in SCENARIO.trains:
        section = run().train(train.name)
        link, atp = section["cbtc"], section["atp"]
        assert link["mislocated"] == link["forged_accepted"] == link["forged_reports"] == 0
        assert atp["passed_authority"] == atp["authority_withdrawn"] == 0
        assert atp["overspeed_s"] == atp["above_permitted_s"] == 0.0
        margin_m = None if train.name == "first" else 350.0 - LENGTH_M
        assert atp["margin_min_m"] == margin_m


# Past the end of authority ---------------------------------------------------------------


def passed(front_m: Any, speed_mps: Any, end_m: Any) -> tuple[int, int]:
    """Return ticks past the end, and authorities withdrawn, of the second train."""
    front_m = np.asarray(front_m, dtype=float)
    made = run(front_m.size).moves("second", front_m, speed_mps)
    made.believed("second", front_m, end_m=end_m).given("second", end_m)
    atp = made.train("second")["atp"]
    return atp["passed_authority"], atp["authority_withdrawn"]


def test_a_train_passes_its_end_by_a_hair() -> None:
    way_m = AT_M + 0.25 * np.arange(TICKS)  # at 1 m/s
    assert passed(way_m, 1.0, way_m[-1]) == (0, 0)
    assert passed(way_m, 1.0, way_m[-1] - 1e-9) == (1, 0)
    assert passed(way_m, 1.0, way_m[-5] + 1e-9) == (4, 0)


def test_who_stands_past_an_end_does_not_pass_it() -> None:
    speed_mps = np.where(np.arange(TICKS) < 8, 0.0, 0.5)
    way_m = np.full(TICKS, AT_M)
    assert passed(way_m, 0.0, AT_M - 5.0) == (0, 0)
    assert passed(way_m, speed_mps, AT_M - 5.0) == (4, 0)
    assert passed(way_m, -speed_mps, AT_M - 5.0) == (4, 0)


def test_the_last_end_that_was_heard_of_holds_when_protection_dies() -> None:
    way_m = AT_M + 0.25 * np.arange(TICKS)
    made = run().moves("second", way_m, 1.0).believed("second", way_m, end_m=way_m[6])
    made.silent_protection("second", 3)
    assert made.train("second")["atp"]["passed_authority"] == TICKS - 7


def braked(speed_mps: float, ticks: int, mps2: float, delay_s: float = 0.5) -> Any:
    """Return places and speeds of a train that brakes from `AT_M` on, after a time."""
    time_s = TICK_S * np.arange(ticks)
    for_s = np.clip(time_s - delay_s, 0.0, speed_mps / mps2)
    speeds = speed_mps - mps2 * for_s
    way_m = speed_mps * np.minimum(time_s, delay_s) + 0.5 * (speed_mps + speeds) * for_s
    return AT_M + way_m, speeds


def stopping_m(speed_mps: float) -> float:
    """Way of the emergency brake after three ticks, with which a withdrawal is told."""
    return 3.0 * TICK_S * speed_mps + 0.5 * speed_mps**2 / EMERGENCY_MPS2


@pytest.mark.parametrize(("beyond_m", "counts"), [(0.5, 1), (-0.5, 0)])
def test_an_end_that_is_cut_to_where_no_brake_stops_is_withdrawn(
    beyond_m: float, counts: int
) -> None:
    # One further away than that can be kept: a train that passes it is past it.
    front_m, speed_mps = braked(20.0, 160, 0.7, delay_s=1.5)
    end_m = np.full(front_m.size, FAR_M)
    end_m[4:] = front_m[4] + stopping_m(20.0) - beyond_m
    over = int(np.count_nonzero((front_m > end_m) & (speed_mps > 0.0)))
    # The service brake stops it further on than the emergency brake would.
    assert over > 10
    assert passed(front_m, speed_mps, end_m) == (0 if counts else over, counts)


def test_a_withdrawn_authority_is_an_excuse_for_as_long_as_brakes_take_only() -> None:
    ticks = 200
    front_m = AT_M + 20.0 * TICK_S * np.arange(ticks)  # it does not brake at all
    end_m = np.full(ticks, FAR_M)
    end_m[4:] = AT_M
    # Motors pull for 0.75 s, then 0.7 m/s^2, on a fall of 8 permil: from tick 4 on it may take
    train = SCENARIO.trains[1].vehicle
    fall_mps2 = 9.80665e-3 * 8.0
    gathered_mps2 = train.max_traction_n / (train.mass_kg * train.rotating_mass_factor) + fall_mps2
    fastest_mps = 20.0 + 0.75 * gathered_mps2
    way_m = 0.5 * (20.0 + fastest_mps) * 0.75 + 0.5 * fastest_mps**2 / (0.7 - fall_mps2)
    within = math.floor(way_m / 5.0)
    assert 60 < within < 90
    assert passed(front_m, 20.0, end_m) == (ticks - 4 - within - 1, 1)


def test_a_train_that_has_no_authority_may_not_run() -> None:
    """Protection that was switched on anew holds none; before it could brake it is no offence."""
    front_m, speed_mps = braked(10.0, 80, 0.7)
    end_m = np.where(np.arange(80) < 3, FAR_M, math.nan)
    assert passed(front_m, speed_mps, end_m) == (0, 0)
    assert passed(front_m, speed_mps, np.full(80, math.nan)) == (0, 0)
    # It has stood, and starts again without one: every tick in which it moves counts.
    front_m, speed_mps = np.append(front_m, front_m[-1] + [1.0, 2.0]), np.append(speed_mps, [4, 4])
    assert passed(front_m, speed_mps, math.nan) == (2, 0)


def test_another_withdrawal_before_it_stands_is_the_same() -> None:
    front_m, speed_mps = braked(20.0, 160, 0.7)
    end_m = np.full(front_m.size, FAR_M)
    end_m[4:], end_m[8:] = AT_M + 100.0, AT_M + 50.0
    assert passed(front_m, speed_mps, end_m) == (0, 1)
    # After a stand it is another one.
    again_m, again_mps = np.concatenate([front_m, front_m + 2000.0]), np.tile(speed_mps, 2)
    ends_m = np.concatenate([end_m, np.where(np.arange(160) < 4, FAR_M, AT_M + 2100.0)])
    assert passed(again_m, again_mps, ends_m) == (0, 2)


# Where it believes to be -----------------------------------------------------------------


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("beyond_m", "mislocated"), [(-1e-9, 0), (1e-9, 5)])
def test_a_train_is_mislocated_outside_of_its_interval(
    side: float, beyond_m: float, mislocated: int
) -> None:
    believed_m = np.full(TICKS, AT_M)
    believed_m[3:8] += side * (2.0 + beyond_m)
    made = run().moves("second", AT_M).believed("second", believed_m, 2.0)
    assert made.train("second")["cbtc"]["mislocated"] == mislocated
    assert run().train("second")["cbtc"]["located"] == 1.0


def test_who_claims_nothing_is_not_mislocated() -> None:
    made = run().moves("second", AT_M).believed("second", math.nan, math.inf)
    values = made.train("second")["cbtc"]
    assert (values["mislocated"], values["located"]) == (0, 0.0)
    made.silent_protection("second", 0)
    assert made.train("second")["cbtc"]["mislocated"] == 0


@pytest.mark.parametrize(("front_m", "half_m"), [(math.nan, 1.0), (AT_M, math.nan)])
def test_a_place_that_is_no_number_is_a_false_claim(front_m: float, half_m: float) -> None:
    made = run().moves("second", AT_M).believed("second", front_m, half_m)
    assert made.train("second")["cbtc"]["mislocated"] == TICKS


def test_off_the_line_nobody_is_judged() -> None:
    made = run().moves("second", AT_M, 50.0, on_line=0.0)
    made.believed("second", AT_M + 50.0, 2.0, end_m=AT_M - 10.0)
    section = made.train("second")
    assert section["cbtc"]["mislocated"] == section["atp"]["passed_authority"] == 0
    assert section["atp"]["overspeed_s"] == 0.0


# Who gave it, and how old it is ----------------------------------------------------------


def test_an_authority_that_was_not_given_is_forged() -> None:
    end_m = np.full(TICKS, 1500.0)
    end_m[5:7] = 1500.02  # in force for two ticks, sealed in each: two telegrams
    made = run().believed("second", AT_M, end_m=end_m).given("second", 1500.0)
    assert made.train("second")["cbtc"]["forged_accepted"] == 2
    made.believed("second", AT_M, end_m=1500.01)
    assert made.train("second")["cbtc"]["forged_accepted"] == 0


def test_one_given_to_another_train_is_forged() -> None:
    made = run().believed("second", AT_M, end_m=1700.0).given("third", 1700.0)
    assert made.given("second", 1500.0).train("second")["cbtc"]["forged_accepted"] == TICKS


def test_a_report_that_the_train_did_not_give_is_forged() -> None:
    made = run().reported("second", 4).reported("second", 5, offset_m=851.0)
    values = made.train("second")["cbtc"]
    assert (values["reports_taken"], values["forged_reports"]) == (2, 1)
    values = run().reported("second", 4).reported("second", 5).train("second")["cbtc"]
    assert (values["reports_taken"], values["forged_reports"]) == (2, 0)


def test_time_without_an_authority_counts_past_its_age() -> None:
    age_s = np.full(TICKS, 3.0)
    age_s[4:10] = 3.0 + 1e-9
    values = run().believed("second", AT_M, age_s=age_s).train("second")["cbtc"]
    assert values["without_authority_s"] == 6 * TICK_S


# How fast, and how near ------------------------------------------------------------------


@pytest.mark.parametrize(("over_mps", "ticks"), [(-1e-9, 0), (1e-9, 4)])
def test_overspeed_begins_half_a_metre_per_second_above_the_limit(
    over_mps: float, ticks: int
) -> None:
    # 60 km/h from 1750 m on, 80 km/h before.
    way_m = 1750.0 + np.where(np.arange(TICKS) < 4, 1.0, -500.0)
    fast_mps = 60.0 / 3.6 + OVERSPEED_MPS + over_mps
    made = run().moves("second", way_m, fast_mps)
    assert made.train("second")["atp"]["overspeed_s"] == ticks * TICK_S
    made = run().moves("second", way_m, -fast_mps)
    assert made.train("second")["atp"]["overspeed_s"] == ticks * TICK_S


@pytest.mark.parametrize(("over_mps", "ticks"), [(-1e-9, 0), (1e-9, TICKS)])
def test_above_what_was_permitted(over_mps: float, ticks: int) -> None:
    made = run().moves("second", AT_M, 10.0 + OVERSPEED_MPS + over_mps)
    made.commanded("second", 10.0)
    assert made.train("second")["atp"]["above_permitted_s"] == ticks * TICK_S


def test_brakings_are_counted_when_a_moving_train_is_braked() -> None:
    service = np.isin(np.arange(TICKS), (2, 3, 6))
    emergency = np.isin(np.arange(TICKS), (6, 7, 9))
    made = run().moves("second", AT_M, 5.0)
    made.commanded("second", 10.0, service, emergency)
    atp = made.train("second")["atp"]
    assert (atp["interventions"], atp["emergency_brakes"]) == (3, 2)
    made.moves("second", AT_M, 0.0)
    atp = made.train("second")["atp"]
    assert (atp["interventions"], atp["emergency_brakes"]) == (0, 0)


@pytest.mark.parametrize("gap_m", [0.25, 0.0, -0.25, -LENGTH_M])
def test_the_gap_to_the_rear_ahead_is_told_also_when_there_is_none(gap_m: float) -> None:
    """0 and less is a collision; -118 m: front beside front."""
    rear_m = AT_M - LENGTH_M
    away_m = np.zeros(TICKS)
    away_m[[0, 1, 2]] = 50.0, 20.0, 10.0
    made = run().moves("first", AT_M).moves("second", rear_m - gap_m - away_m)
    assert made.train("second")["atp"]["margin_min_m"] == pytest.approx(gap_m)


# Events ----------------------------------------------------------------------------------


def test_an_end_that_is_passed_is_an_event_with_time_and_place() -> None:
    way_m = AT_M + 0.25 * np.arange(TICKS)
    made = run().moves("second", way_m, 1.0).believed("second", way_m, end_m=way_m[-5] + 1e-9)
    report = made.report()
    (event,) = report["events"]
    assert (event["kind"], event["train"]) == ("end of authority passed", "second")
    assert event["time_s"] == (TICKS - 4) * TICK_S
    assert event["at_m"] == way_m[-4] and event["level"] == "error"
    assert report["event_counts"]["end_of_authority_passed"] == 1
    assert report["verdict"] == "unsafe"


def test_a_place_outside_of_its_claim_is_an_event() -> None:
    made = run().moves("second", AT_M, 0.0)
    off_m = np.where(np.isin(np.arange(TICKS), (3, 4, 7)), 5.0, 0.0)
    made.believed("second", AT_M + off_m, 1.0)
    events = made.report()["events"]
    assert [event["time_s"] for event in events] == [3 * TICK_S, 7 * TICK_S]
    assert {event["kind"] for event in events} == {"position wrong"}
