"""Verdicts on positions by phase ranging: each says no where it must, and not before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.ranging.report import HANDOVER_DEPTH_M

from ...run_builder import RunBuilder, built_in

SIGMA_M = 0.25
#: Off by more than six sigma and a metre, a position that is claimed to be known misleads.
LIMIT_M = 6.0 * SIGMA_M + 1.0
WAY_M = 250.0  # in zone2 of the plain line, 50 m past its station
TICKS = 8


def plain(chainage_m: Any, sigma_m: Any = SIGMA_M, **more: Any) -> dict[str, Any]:
    """Return the figures of a train that is ranged at certain places while it stands."""
    run = RunBuilder("plain_line", TICKS).moves("train_a", WAY_M)
    section = run.ranged("train_a", chainage_m, sigma_m, channel=3.0, **more).train("train_a")
    values: dict[str, Any] = section["phase_ranging"]
    return values


def at(ticks: tuple[int, ...], value: float, otherwise: float = 0.0) -> Any:
    found = np.full(TICKS, otherwise)
    found[list(ticks)] = value
    return found


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("beyond_m", "misleading"), [(-1e-6, 0), (1e-6, 3)])
def test_a_position_misleads_from_six_sigma_and_a_metre_on(
    side: float, beyond_m: float, misleading: int
) -> None:
    values = plain(WAY_M + side * at((1, 2, 6), LIMIT_M + beyond_m))
    assert values["misleading_ticks"] == misleading
    assert values["wrong_track_ticks"] == 0
    assert values["max_m"] == pytest.approx(LIMIT_M, abs=1e-5)


def test_what_is_not_claimed_does_not_mislead() -> None:
    values = plain(WAY_M + 500.0, at((3,), SIGMA_M, math.inf))
    assert (values["misleading_ticks"], values["availability"]) == (1, 1 / TICKS)


def test_a_position_that_is_no_number_misleads() -> None:
    values = plain(at((2, 5), math.nan, WAY_M))
    assert (values["misleading_ticks"], values["wrong_track_ticks"]) == (2, 0)
    assert values["rmse_m"] == values["max_m"] == 0.0


def test_a_position_on_a_track_that_does_not_exist_is_on_a_wrong_one() -> None:
    values = plain(WAY_M, track="elsewhere")
    assert values["wrong_track_ticks"] == values["misleading_ticks"] == TICKS
    assert values["rmse_m"] is None


# At the junction of ``branch``, 760 m along main. Where the tracks are apart, zone5 begins on main
# and zone7 on the branch, both at the station of the junction.
JUNCTION_M = 760.0
ON_MAIN, ON_BRANCH = (layout_of(built_in("branch")).zone(name) for name in ("zone5", "zone7"))


def forked(true_m: float, claimed_m: float, speed_mps: float = 0.0) -> dict[str, Any]:
    """Return the figures of a train on the branch that is claimed to be on main.

    ``true_m`` counts along the branch, ``claimed_m`` along main.
    """
    run = RunBuilder("branch", TICKS)
    run.moves("train_b", true_m, speed_mps, track="branch", path_m=JUNCTION_M + true_m)
    section = run.ranged("train_b", claimed_m, 0.1, track="main", channel=5.0).train("train_b")
    values: dict[str, Any] = section["phase_ranging"]
    return values


@pytest.mark.parametrize(("beyond_m", "wrong"), [(-0.01, 0), (0.01, TICKS)])
def test_past_the_junction_main_is_a_wrong_track_for_a_train_on_the_branch(
    beyond_m: float, wrong: int
) -> None:
    # A train may be told on the other track for as long as a handover may take: 20 m, and half
    # a metre of travel in a tick. The claim is as far along the path as the truth.
    way_m = HANDOVER_DEPTH_M + 0.5 + beyond_m
    true_m = ON_BRANCH.start_m + way_m
    assert JUNCTION_M + true_m > ON_MAIN.start_m
    values = forked(true_m, JUNCTION_M + true_m, speed_mps=5.0)
    assert values["wrong_track_ticks"] == values["misleading_ticks"] == wrong


def test_before_the_junction_main_is_not_wrong() -> None:
    # zone7 follows zone4: what is told there is off by far, and on no wrong track.
    values = forked(ON_BRANCH.start_m + 50.0, 650.0)
    assert (values["wrong_track_ticks"], values["misleading_ticks"]) == (0, TICKS)


def test_a_train_on_main_is_not_on_a_branch_that_it_never_takes() -> None:
    run = RunBuilder("branch", TICKS).moves("train_a", 700.0)
    run.ranged("train_a", 60.0, 0.1, track="branch", channel=3.0)
    assert run.train("train_a")["phase_ranging"]["wrong_track_ticks"] == TICKS


# Handovers, at the station of zone2 200 m along the plain line: from channel 1 to channel 3.


def passing(channel_from_m: float, speed_mps: float = 20.0) -> dict[str, Any]:
    """Return the handovers of a train that changes to channel 3 at a place and runs to 240 m."""
    way_m = np.arange(170.0, 240.0, 0.1 * speed_mps)
    run = RunBuilder("plain_line", len(way_m)).moves("train_a", way_m, speed_mps)
    run.ranged("train_a", way_m, channel=np.where(way_m >= channel_from_m, 3.0, 1.0))
    handovers: dict[str, Any] = run.train("train_a")["handovers"]
    return handovers


@pytest.mark.parametrize(("at_m", "missed"), [(221.5, 0), (222.5, 1)])
def test_a_handover_is_missed_past_its_depth_and_a_tick_of_travel(at_m: float, missed: int) -> None:
    # 200 m, 20 m of depth and 2 m of travel in a tick; the train is at 222 m then.
    values = passing(at_m)
    assert (values["expected"], values["missed"]) == (1, missed)
    assert values["made"] == 1 - missed
    assert values["wrong"] == 0


@pytest.mark.parametrize(("at_m", "wrong"), [(179.0, 0), (177.0, 1)])
def test_a_change_of_channel_far_from_the_station_is_wrong(at_m: float, wrong: int) -> None:
    # The next zone is near from 22 m before its station on: at 178 m it is not yet.
    values = passing(at_m)
    assert (values["wrong"], values["missed"]) == (wrong, 0)
