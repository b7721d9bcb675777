"""Where the front is: the interval holds it, whatever the order of the fixes."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_onboard.train_radio.train_location import NOWHERE, TrainLocation

SPEED = 20.0


def running(error: float = 0.01, until_s: int = 5, direction: int = 1) -> TrainLocation:
    """Return a location whose odometer has counted 20 m/s in ticks of 1 s."""
    where = TrainLocation(error, direction=direction)
    for second in range(until_s + 1):
        assert where.update(float(second), SPEED * second, SPEED)
    return where


def test_nothing_is_known_before_a_fix_and_an_odometer() -> None:
    assert TrainLocation(0.01).location(0.0) == NOWHERE
    assert not TrainLocation(0.01).fix(0.0, 100.0, 1.0)
    assert running().location(5.0) == NOWHERE


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("fix_s", [0.0, 1.5, 3.25, 5.0])
def test_a_fix_is_brought_to_now_by_the_odometer(direction: int, fix_s: float) -> None:
    where = running(direction=direction)
    assert where.place(fix_s, 1000.0, 3.0)
    run_m = SPEED * (5.0 - fix_s)
    here = where.location(5.0)
    assert here.position_m == pytest.approx(1000.0 + direction * run_m)
    assert here.uncertainty_m == pytest.approx(3.0 + 0.01 * run_m)
    where.update(6.0, 120.0, SPEED)
    assert where.location(6.0).uncertainty_m == pytest.approx(3.0 + 0.01 * (run_m + SPEED))


def test_between_ticks_a_change_of_speed_is_allowed_for() -> None:
    where = TrainLocation(0.0)
    where.update(0.0, 0.0, 10.0)
    where.update(2.0, 18.0, 8.0)  # 10 m/s, falling to 8 at 1 s at once
    where.place(1.0, 100.0, 0.0)
    here = where.location(2.0)
    assert here.uncertainty_m == pytest.approx(0.25 * 2.0 * 2.0)
    assert here.position_m - here.uncertainty_m == pytest.approx(108.0)


def test_a_narrower_fix_is_intersected_with_what_is_known() -> None:
    where = running(error=0.0)
    where.place(5.0, 100.0, 4.0)  # 96 to 104
    where.fix(5.0, 102.0, 3.0)  # 99 to 105
    here = where.location(5.0)
    assert (here.position_m, here.uncertainty_m) == (101.5, 2.5)
    assert where.consistent
    where.fix(5.0, 99.0, 3.0)  # 96 to 102, but not narrower
    assert where.location(5.0) == here


def test_a_train_at_a_stand_does_not_erode_its_interval() -> None:
    where = running()
    where.place(5.0, 100.0, 4.0)
    for n in range(50):
        where.update(6.0 + n, 100.0, 0.0)
        where.fix(6.0 + n, 100.0 + math.sin(n), 4.0)
    assert where.location(55.0).uncertainty_m == 4.0


def test_fixes_that_contradict_each_other_leave_the_hull_until_one_agrees() -> None:
    where = running(error=0.0)
    where.place(5.0, 100.0, 2.0)
    assert where.fix(5.0, 110.0, 3.0)
    here, agreed = where.location(5.0), where.consistent
    assert not agreed
    assert (here.position_m, here.uncertainty_m, here.valid) == (105.5, 7.5, True)
    where.fix(5.0, 101.0, 1.5)
    assert where.consistent
    assert where.location(5.0).position_m == 100.75


def test_fixes_from_the_future_or_from_before_the_history_are_refused() -> None:
    where = TrainLocation(0.01, history_s=3.0, most_readings=1000)
    for tick in range(101):
        where.update(0.1 * tick, 2.0 * tick, SPEED)
    assert not where.fix(10.1, 1000.0, 1.0)
    assert not where.fix(6.9, 1000.0, 1.0)
    assert where.location(10.0) == NOWHERE
    assert where.place(7.1, 1000.0, 1.0)
    assert where.location(8.0).position_m == pytest.approx(1018.0)
    assert where.location(10.1) == NOWHERE
    assert where.location(6.0) == NOWHERE


def test_memory_is_bounded() -> None:
    where = TrainLocation(0.01, most_readings=8)
    for tick in range(100):
        where.update(0.01 * tick, 0.2 * tick, SPEED)
    assert not where.fix(0.9, 1000.0, 1.0)
    assert where.fix(0.95, 1000.0, 1.0)
    assert len(where._readings) == 8


def test_steps_backwards_forget_everything() -> None:
    for time_s, distance_m in ((4.0, 100.0), (6.0, 99.0)):
        where = running()
        where.place(5.0, 100.0, 1.0)
        assert where.location(5.0).valid
        assert where.update(time_s, distance_m, SPEED)
        assert where.location(time_s) == NOWHERE
        assert not where.fix(time_s - 0.5, 100.0, 1.0)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_not_accepted(bad: float) -> None:
    where = running()
    where.place(5.0, 100.0, 1.0)
    here = where.location(5.0)
    for reading in ((bad, 120.0, SPEED), (6.0, bad, SPEED), (6.0, 120.0, bad)):
        assert not where.update(*reading)
    for fix in ((bad, 100.0, 0.1), (5.0, bad, 0.1), (5.0, 100.0, bad), (5.0, 100.0, -1.0)):
        assert not where.fix(*fix)
    assert where.location(5.0) == here
    assert where.location(6.0) == NOWHERE
    assert where.location(bad) == NOWHERE
    where.update(7.0, 140.0, SPEED)
    assert where.location(7.0).position_m == pytest.approx(140.0)


@pytest.mark.parametrize(
    "make",
    [
        lambda: TrainLocation(1.0),
        lambda: TrainLocation(-0.01),
        lambda: TrainLocation(0.01, direction=0),
        lambda: TrainLocation(0.01, history_s=math.nan),
        lambda: TrainLocation(0.01, most_readings=1),
    ],
)
def test_bad_parameters_are_refused(make: object) -> None:
    with pytest.raises(ValueError, match=r": .* is "):
        make()  # type: ignore[operator]


@settings(max_examples=60)
@given(
    st.sampled_from([1, -1]),
    st.sampled_from([0.1, 0.25, 0.5]),
    st.lists(st.tuples(st.floats(-1.0, 1.0), st.integers(1, 8)), min_size=4, max_size=20),
    st.lists(
        st.tuples(
            st.floats(0.0, 1.0), st.floats(0.0, 3.0), st.floats(0.1, 20.0), st.floats(-1.0, 1.0)
        ),
        min_size=3,
        max_size=12,
    ),
    st.floats(-1.0, 1.0),
)
def test_the_front_is_always_in_the_interval(
    direction: int,
    tick_s: float,
    drive: list[tuple[float, int]],
    fixes: list[tuple[float, float, float, float]],
    wheels: float,
) -> None:
    """Every bound used up, fixes late and out of order; no fix moves the worst front on."""
    error = 0.02
    where = TrainLocation(error, direction=direction)
    time_s, s, counted_m, v = 0.0, 0.0, 0.0, 10.0
    path = [(0.0, 0.0, 10.0, 0.0)]  # time, s, speed, acceleration from there on
    where.update(0.0, 0.0, v)
    accelerations = [a for a, ticks in drive for _ in range(ticks)]
    due = sorted((int((share + 1e-9) * len(accelerations) * 0.99), *rest) for share, *rest in fixes)
    for tick, a in enumerate(accelerations):
        faster = min(25.0, max(0.0, v + a * tick_s))
        run_m = 0.5 * (v + faster) * tick_s
        path[-1] = (time_s, s, v, (faster - v) / tick_s)
        time_s, s, v = time_s + tick_s, s + run_m, faster
        counted_m += run_m / (1.0 + wheels * error)
        path.append((time_s, s, v, 0.0))
        where.update(time_s, counted_m, v)
        for _, late_s, half_m, off in (item for item in due if item[0] == tick):
            true_s = max(0.0, time_s - late_s)
            t0, s0, v0, a0 = max(entry for entry in path if entry[0] <= true_s)
            then = s0 + v0 * (true_s - t0) + 0.5 * a0 * (true_s - t0) ** 2
            before = where.location(time_s)
            take = where.fix if before.valid else where.place
            assert take(true_s, direction * (then + off * half_m), half_m)
            assert where.consistent
            worst = direction * before.position_m + before.uncertainty_m
            here = where.location(time_s)
            assert direction * here.position_m + here.uncertainty_m <= worst + 1e-9
        here = where.location(time_s)
        if here.valid:
            assert abs(here.position_m - direction * s) <= here.uncertainty_m + 1e-9


def test_ranges_in_a_row_locate_a_train_that_knows_nothing() -> None:
    where = TrainLocation(0.0)
    for tick, at_m in enumerate((1000.0, 400.0, 1000.0, 1000.5, 1001.0)):
        where.update(0.5 * tick, 100.0, 0.0)
        where.fix(0.5 * tick, at_m, 2.0)
        # One from elsewhere breaks the row: three, over a second, are needed after it.
        assert where.location(0.5 * tick).valid == (tick == 4)
    assert where.location(2.0).position_m == 1000.0


def test_ranges_that_go_on_to_contradict_are_believed_where_a_slide_can_have_put_the_train() -> (
    None
):
    for off_m, believed in ((15.0, True), (300.0, False)):
        where = TrainLocation(0.0)
        for tick in range(60):
            where.update(0.5 * tick, 0.0, 0.0)
            if tick == 0:
                where.place(0.0, 1000.0, 2.0)
            where.fix(0.5 * tick, 1000.0 + off_m, 2.0)
            here = where.location(0.5 * tick)
            if tick < 20:  # in the hull for ten seconds
                assert (here.position_m, here.uncertainty_m) == (
                    1000.0 + off_m / 2.0,
                    2.0 + off_m / 2.0,
                )
        assert (where.location(29.5).uncertainty_m == 2.0) == believed
        assert where.consistent == believed
