"""The odometer against physics: what is no motion of a train, and the bounds from there on."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_onboard.train_radio.odometer_watch import OdometerWatch, RunningLimits
from rail_onboard.train_radio.train_location import TrainLocation

LIMITS = RunningLimits(
    accelerating_mps2=1.0,
    braking_mps2=1.3,
    sure_braking_mps2=0.7,
    delay_s=0.6,
    fastest_mps=25.0,
)


@pytest.mark.parametrize("tick_s", [0.1, 0.25, 0.5, 1.0])
def test_what_brakes_and_motors_can_do_is_no_slide(tick_s: float) -> None:
    watch = OdometerWatch(0.02, LIMITS)
    speed_mps = 0.0
    for change_mps2, until_mps in ((1.0, 20.0), (-1.3, 0.0)):
        while abs(speed_mps - until_mps) > 1e-6:
            step_mps = change_mps2 * tick_s
            before_mps, speed_mps = speed_mps, min(20.0, max(0.0, speed_mps + step_mps))
            way_m = 0.5 * (before_mps + speed_mps) * tick_s
            watch.step(tick_s, way_m, speed_mps, False)
            assert not watch.doubted


@pytest.mark.parametrize("ratio", [0.0, 0.6, 0.8, 1.5, 3.0])
def test_a_slide_or_spin_ends_within_the_bounds_of_physics(ratio: float) -> None:
    """The train brakes at the guaranteed rate while its wheels show anything."""
    where = TrainLocation(0.02, limits=LIMITS)
    tick_s, v, s, counted_m = 0.25, 15.0, 0.0, 0.0
    where.update(0.0, 0.0, v)
    where.place(0.0, 0.0, 1.0)
    stood = 0
    for tick in range(1, 400):
        braked = where.odometer_doubted
        slower = max(0.0, v - 0.7 * tick_s) if braked and tick > 4 else v
        run_m = 0.5 * (v + slower) * tick_s
        v, s, counted_m = slower, s + run_m, counted_m + ratio * run_m
        where.update(tick * tick_s, counted_m, ratio * v, braked=braked)
        here = where.location(tick * tick_s)
        assert abs(here.position_m - s) <= here.uncertainty_m + 1e-6
        assert where.odometer_doubted or v == 0.0
        stood += v == 0.0
    # Physics has brought it to a stand: it may start again.
    assert stood and not where.odometer_doubted


def test_after_a_doubt_wheels_have_to_prove_that_they_count() -> None:
    where = TrainLocation(0.0, limits=LIMITS)
    where.update(0.0, 0.0, 10.0)
    where.place(0.0, 0.0, 1.0)
    where.update(0.5, 3.0, 6.0)
    assert where.odometer_doubted and where.fastest_mps > 10.0
    s, counted_m = 5.0, 3.0
    for tick in range(2, 40):
        s, counted_m = s + 3.0, counted_m + 3.0
        where.update(0.5 * tick, counted_m, 6.0)
        where.fix(0.5 * tick, s, 1.0)
        here = where.location(0.5 * tick)
        assert abs(here.position_m - s) <= here.uncertainty_m
    assert not where.odometer_doubted and where.fastest_mps == 6.0


def test_ranges_tell_of_a_slide_that_made_no_step() -> None:
    where = TrainLocation(0.02, limits=LIMITS)
    where.update(0.0, 0.0, 10.0)
    where.place(0.0, 0.0, 1.0)
    s = counted_m = 0.0
    doubted_s = None
    for tick in range(1, 60):
        s, counted_m = s + 5.0, counted_m + 4.0
        where.update(0.5 * tick, counted_m, 10.0)
        where.fix(0.5 * tick, s, 1.0)
        if where.odometer_doubted and doubted_s is None:
            doubted_s = 0.5 * tick
    assert doubted_s is not None and doubted_s <= 3.0


@pytest.mark.parametrize("name", ["accelerating_mps2", "braking_mps2", "sure_braking_mps2"])
def test_bad_limits_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        RunningLimits(**{name: 0.0})
    with pytest.raises(ValueError, match="delay_s"):
        RunningLimits(delay_s=-1.0)


@pytest.mark.parametrize(("before_mps", "ratio"), [(2.08, 0.402), (6.0, 0.7), (4.0, 1.3)])
def test_a_slip_that_begins_within_a_long_tick_is_seen_by_the_way(
    before_mps: float, ratio: float
) -> None:
    """The speeds alone could be those of a train that brakes, or gathers speed."""
    limits = RunningLimits(accelerating_mps2=1.8, braking_mps2=2.5)
    after_mps = before_mps + 0.3
    assert -2.5 < ratio * after_mps - before_mps < 1.8
    watch = OdometerWatch(0.02, limits)
    watch.step(0.0, 0.0, before_mps, False)
    watch.step(1.0, ratio * 0.5 * (before_mps + after_mps), ratio * after_mps, False)
    assert watch.doubted


@given(
    st.floats(0.0, 25.0),
    st.lists(st.floats(-2.5, 1.5), min_size=10, max_size=10),
    st.floats(-0.02, 0.02),
    st.sampled_from([0.1, 0.5, 1.0]),
)
def test_no_motion_within_the_limits_is_doubted(
    speed_mps: float, accelerations: list[float], error: float, elapsed_s: float
) -> None:
    limits = RunningLimits(accelerating_mps2=1.5, braking_mps2=2.5)
    watch = OdometerWatch(0.0205, limits)
    watch.step(0.0, 0.0, (1.0 + error) * speed_mps, False)
    dt_s, way_m = elapsed_s / len(accelerations), 0.0
    for acceleration in accelerations:
        after_mps = max(0.0, speed_mps + acceleration * dt_s)
        way_m, speed_mps = way_m + 0.5 * (speed_mps + after_mps) * dt_s, after_mps
    watch.step(elapsed_s, (1.0 + error) * way_m, (1.0 + error) * speed_mps, False)
    assert not watch.doubted
