"""The judge of runs: each judgement by runs made up of arrays in which it must say no, and yes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike

from rail_corridor.report.truth_judge import (
    ARRIVED_M,
    OVERSPEED_MPS,
    QUEUE_M,
    Motion,
    StoppingWay,
    collisions,
    least_limits,
    mislocated,
    overspeed,
    passed_ends,
    passed_tails,
    stuck,
)
from rail_signals.arrays import FloatArray

TICK_S = 0.5
LENGTH_M = 100.0
#: 1 s and then 1 m/s^2; 3 s more without a word; nothing pulls.
STOPPING = StoppingWay(1.0, 3.0, 1.0, 0.0)


def motion(*fronts_m: ArrayLike, direction: float = 1.0, **changes: Any) -> Motion:
    """Return the motion of trains of 100 m with these fronts; speeds are differences."""
    front_m = np.stack(np.broadcast_arrays(*map(np.asarray, fronts_m)), axis=-1).astype(float)
    front_m = direction * front_m
    speed_mps = np.diff(front_m, axis=0, prepend=front_m[:1]) / TICK_S
    trains = front_m.shape[1]
    values: dict[str, Any] = {
        "track": np.zeros(front_m.shape),
        "speed_mps": speed_mps,
        "on_line": np.ones(front_m.shape, dtype=bool),
        "length_m": np.full(trains, LENGTH_M),
        "direction": np.full(trains, direction),
    }
    return Motion(TICK_S, front_m=front_m, **values | changes)


# Collisions ------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(("gap_m", "deepest_m"), [(0.001, None), (-0.001, 0.001), (-7.0, 7.0)])
def test_trains_collide_where_their_intervals_meet(
    direction: float, gap_m: float, deepest_m: float | None
) -> None:
    ahead = np.full(9, 500.0)
    behind = np.linspace(300.0, 500.0 - LENGTH_M - gap_m, 9)
    found = collisions(motion(ahead, behind, direction=direction))
    assert len(found) == (deepest_m is not None)
    if deepest_m is not None:
        assert found[0].trains == (0, 1) and found[0].deepest_m == pytest.approx(deepest_m)
        assert found[0].tick == 8


def test_a_train_that_is_through_another_between_two_ticks_has_collided() -> None:
    found = collisions(motion([500.0] * 3, [350.0, 650.0, 700.0]))
    assert [(each.tick, each.deepest_m) for each in found] == [(1, math.inf)]


@pytest.mark.parametrize("which", ["track", "on_line"])
def test_trains_on_other_tracks_or_not_on_the_line_do_not_collide(which: str) -> None:
    other = np.tile([0, 1], (3, 1))
    changed = {"track": other.astype(float)} if which == "track" else {"on_line": other > 0}
    assert collisions(motion([500.0] * 3, [450.0] * 3, **changed)) == []


# Ends of authority -----------------------------------------------------------------------


def passed(
    front_m: ArrayLike,
    end_m: ArrayLike,
    direction: float = 1.0,
    stopping: StoppingWay = STOPPING,
) -> list[int]:
    """Return the ticks in which one train has passed its end."""
    run = motion(front_m, direction=direction)
    end = direction * np.broadcast_to(np.asarray(end_m, float), len(run.front_m))[:, None]
    ticks = passed_ends(run, end, stopping, np.zeros(run.on_line.shape, bool))
    return np.flatnonzero(ticks[:, 0]).tolist()


CREEPING = np.arange(100.0, 110.0)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_front_beyond_an_end_has_passed_it_while_it_moves(direction: float) -> None:
    assert passed(CREEPING, 109.0, direction) == []
    assert passed(CREEPING, 106.5, direction) == [7, 8, 9]
    assert passed([*CREEPING, 109.0, 109.0], 106.5, direction) == [7, 8, 9]


def test_who_never_had_an_authority_must_not_move() -> None:
    assert passed(CREEPING, math.nan) == list(range(1, 10))


def running(ticks: int, speed_mps: float, stops_after: int, braking_mps2: float) -> FloatArray:
    """Return a front at a speed that brakes from a tick on."""
    time_s = np.maximum(TICK_S * (np.arange(ticks) - stops_after), 0.0)
    speed = np.maximum(speed_mps - braking_mps2 * time_s, 0.0)
    return np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * TICK_S)))


@pytest.mark.parametrize("after", [math.nan, 105.0])
def test_an_end_taken_back_binds_from_where_the_train_can_have_stopped(after: float) -> None:
    end_m = np.where(np.arange(80) < 20, 1000.0, after)
    silent_s = 3.0 if math.isnan(after) else 0.0
    in_time = running(80, 10.0, 20 + round((1.0 + silent_s) / TICK_S), 1.0)
    assert passed(in_time, end_m) == []
    late = running(80, 10.0, 24 + round((1.0 + silent_s) / TICK_S), 1.0)
    assert passed(late, end_m) != []


def test_a_train_that_stands_is_bound_by_the_new_end_as_soon_as_the_old_one_has_run_out() -> None:
    stands_s = 12
    front_m = np.concatenate((np.full(2 * stands_s, 100.0), np.arange(101.0, 106.0)))
    end_m = np.where(np.arange(len(front_m)) < 4, 1000.0, math.nan)
    assert passed(front_m, end_m) == list(range(2 * stands_s, len(front_m)))
    # Within the time for which the old one holds it may still start.
    soon = np.concatenate((np.full(6, 100.0), np.arange(101.0, 103.0)))
    pulling = replace(STOPPING, pull_mps2=0.5)
    assert passed(soon, end_m[: len(soon)], stopping=pulling) == []
    assert pulling.way_m(0.0, silent=True) == 4.0 + 2.0  # 4 s to 2 m/s, then to a stand


def test_whoever_runs_on_sight_is_excused() -> None:
    run = motion(CREEPING)
    excused = np.arange(10)[:, None] > 4
    nothing = np.full(run.on_line.shape, math.nan)
    ticks = passed_ends(run, nothing, STOPPING, excused)
    assert np.flatnonzero(ticks[:, 0]).tolist() == [1, 2, 3, 4]


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_rear_behind_what_the_wayside_counts_on_has_passed_it(direction: float) -> None:
    run = motion([500.0] * 4, direction=direction)
    rear_m = direction * np.array([399.0, 400.0, 401.0, math.nan])[:, None]
    assert passed_tails(run, rear_m)[:, 0].tolist() == [False, False, True, False]


# Speed -----------------------------------------------------------------------------------

STARTS_M, LIMITS_MPS = np.array([0.0, 300.0, 350.0, 600.0]), np.array([20.0, 5.0, 15.0, 25.0])


@pytest.mark.parametrize(
    ("low_m", "high_m", "limit_mps"),
    [
        (100.0, 200.0, 20.0),
        (200.0, 300.0, 20.0),
        (200.0, 301.0, 5.0),
        (349.0, 449.0, 5.0),
        (250.0, 650.0, 5.0),
        (350.0, 450.0, 15.0),
        (620.0, 720.0, 25.0),
    ],
)
def test_the_limit_is_the_least_under_any_axle(
    low_m: float, high_m: float, limit_mps: float
) -> None:
    assert least_limits(np.array([[low_m]]), np.array([[high_m]]), STARTS_M, LIMITS_MPS) == [
        [limit_mps]
    ]


def test_a_train_is_too_fast_while_its_last_axle_is() -> None:
    # 6 m/s where 15 are allowed to the front, but the rear is still where 5 are.
    run = motion(np.arange(430.0, 472.0, 3.0))
    limit_mps = least_limits(run.low_m, run.high_m, STARTS_M, LIMITS_MPS)
    too_fast = overspeed(run, limit_mps)[1:, 0]
    assert too_fast.tolist() == (run.rear_m[1:, 0] < 350.0).tolist() and too_fast.any()
    assert not overspeed(run, np.full((14, 1), 6.0 - OVERSPEED_MPS)).any()
    assert overspeed(run, np.full((14, 1), 5.9 - OVERSPEED_MPS))[1:].all()


# Claims ----------------------------------------------------------------------------------


def test_an_interval_must_hold_the_front_or_claim_nothing() -> None:
    run = motion([500.0] * 6)
    low_m = np.array([499.0, 500.0, 500.5, 498.0, math.nan, 500.5])[:, None]
    high_m = np.array([501.0, 500.0, 502.0, 499.5, math.nan, 502.0])[:, None]
    claimed = np.array([True] * 5 + [False])[:, None]
    assert mislocated(run, low_m, high_m, claimed)[:, 0].tolist() == [
        *(False, False, True, True, True, False)
    ]


# Standstill ------------------------------------------------------------------------------


def test_a_train_that_does_not_go_on_is_stuck_unless_it_is_where_it_should_be() -> None:
    still = np.full(101, 400.0)
    goes_on = np.where(np.arange(101) < 90, 400.0, 400.0 + 0.2 * (np.arange(101) - 90))
    stops = np.where(np.arange(101) < 40, 300.0 + np.arange(101), 400.0)

    def at_end(*fronts_m: ArrayLike, to_m: float = 2000.0, **changes: Any) -> list[int]:
        run = motion(*fronts_m, **changes)
        return stuck(run, np.full(run.front_m.shape[1], to_m), 0, 100)

    assert at_end(still) == [0]
    assert at_end(goes_on) == []
    assert at_end(stops) == [0]  # it went on, but not for long
    assert at_end(still, to_m=400.0 + ARRIVED_M) == []
    assert at_end(still, to_m=400.5 + ARRIVED_M) == [0]
    assert at_end(still, on_line=np.arange(101)[:, None] < 50) == []


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_who_stands_behind_a_train_at_its_destination_waits_for_its_place(direction: float) -> None:
    fronts_m = (1000.0, 850.0, 850.0 - LENGTH_M - QUEUE_M, 400.0)
    run = motion(*(np.full(101, front_m) for front_m in fronts_m), direction=direction)
    assert stuck(run, np.full(4, direction * 1000.0), 0, 100) == [3]
    assert stuck(run, np.full(4, direction * 1050.0), 0, 100) == [0, 1, 2, 3]
