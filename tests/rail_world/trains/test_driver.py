from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_world.line.profile import StepProfile
from rail_world.trains.driver import BrakingEnvelope, limits_for_train, nearest_ahead
from rail_world.trains.vehicle import Extent


def test_limit_holds_until_the_tail_has_cleared_it() -> None:
    line = StepProfile([0.0, 500.0, 600.0], [20.0, 10.0, 30.0])
    limits = limits_for_train(line, Extent(120.0, 0.0), length_m=2000.0, cap_mps=25.0)
    assert limits.at([0.0, 499.0, 500.0, 719.0, 721.0]).tolist() == [20.0, 20.0, 10.0, 10.0, 25.0]
    back = limits_for_train(line, Extent(0.0, 120.0), length_m=2000.0, cap_mps=25.0)
    assert back.at([379.0, 381.0, 599.0, 601.0]).tolist() == [20.0, 10.0, 10.0, 25.0]


profiles = st.lists(
    st.tuples(st.floats(1.0, 300.0), st.floats(1.0, 40.0)), min_size=1, max_size=8
).map(
    lambda steps: StepProfile(
        [0.0, *np.cumsum([length for length, _ in steps])[:-1].tolist()], [v for _, v in steps]
    )
)


@given(profiles, st.floats(1.0, 400.0), st.sampled_from([1, -1]))
def test_limit_for_a_train_is_the_least_under_it(
    line: StepProfile, length_m: float, side: int
) -> None:
    extent = Extent(length_m, 0.0) if side > 0 else Extent(0.0, length_m)
    path_m = 2500.0
    limits = limits_for_train(line, extent, length_m=path_m, cap_mps=35.0)
    for p in np.linspace(0.5, path_m - 0.5, 60):
        body = np.linspace(p - extent.below_m, p + extent.above_m, 2000)
        least = min(float(line.at(body).min()), 35.0)
        got = float(limits.at(p))
        # The sampled body may miss a piece shorter than its spacing, never the other way.
        assert got <= least
        wider = np.linspace(p - extent.below_m - 0.3, p + extent.above_m + 0.3, 2000)
        assert got in np.append(line.at(wider), 35.0) or got == least


@given(profiles, st.sampled_from([1, -1]), st.floats(0.2, 2.0))
def test_envelope_is_the_lowest_braking_curve(
    limits: StepProfile, direction: int, braking_mps2: float
) -> None:
    envelope = BrakingEnvelope(limits, direction, braking_mps2)
    ends = [*limits.starts_m[1:].tolist(), math.inf]
    for p in np.linspace(0.25, 2000.0, 40):
        expected = math.inf
        for start, end, value in zip(limits.starts_m, ends, limits.values, strict=True):
            ahead = start - p if direction > 0 else p - end
            passed = p >= end if direction > 0 else p < start
            if not passed:
                expected = min(expected, value**2 + 2.0 * braking_mps2 * max(ahead, 0.0))
        assert envelope.speed_mps(direction * p) == pytest.approx(math.sqrt(expected))


def test_braking_distance_is_v_squared_over_2a() -> None:
    envelope = BrakingEnvelope(StepProfile([0.0, 1000.0], [30.0, 10.0]), 1, 0.8)
    distance_m = (30.0**2 - 10.0**2) / (2 * 0.8)
    assert envelope.speed_mps(1000.0 - distance_m) == pytest.approx(30.0)
    assert envelope.speed_mps(1000.0 - distance_m + 100.0) == pytest.approx(
        math.sqrt(900.0 - 160.0)
    )
    assert envelope.speed_mps(1000.0) == 10.0


def test_next_speed_follows_the_curve_to_the_stop() -> None:
    envelope = BrakingEnvelope(StepProfile([0.0], [20.0]), 1, 0.8)
    s, v, steps = 0.0, 20.0, 0
    while v > 0.0:
        faster = envelope.next_speed_mps(s, v, 500.0, 0.1)
        s += 0.05 * (v + faster) if faster > 0.0 else 500.0 - s
        v = faster
        steps += 1
        assert v**2 <= 2 * 0.8 * (500.0 - s) + 1e-9
    # 250 m at 20 m/s, then 25 s of braking.
    assert steps == pytest.approx(375, abs=2)


@given(profiles, st.floats(0.3, 2.0), st.floats(0.01, 0.1), st.sampled_from([1, -1]))
def test_a_step_never_ends_above_the_envelope(
    limits: StepProfile, braking_mps2: float, dt_s: float, direction: int
) -> None:
    envelope = BrakingEnvelope(limits, direction, braking_mps2)
    s = 0.0 if direction > 0 else -1500.0
    stop_s = s + 1400.0
    v = 0.0
    for _ in range(400):
        after = min(envelope.next_speed_mps(s, v, stop_s, dt_s), v + 1.5 * dt_s)
        assert after >= v - braking_mps2 * dt_s * (1 + 1e-9) - 1e-9
        s += 0.5 * (v + after) * dt_s
        v = after
        assert v <= envelope.speed_mps(s) + 1e-9
        assert v**2 <= 2 * braking_mps2 * (stop_s - s) + 1e-9


def test_nearest_ahead() -> None:
    points = [0.0, 10.0, 20.0]
    assert nearest_ahead(points, 0.0, 1.0) == 10.0
    assert nearest_ahead(points, 9.5, 1.0) == 20.0
    assert nearest_ahead(points, 20.0, 1.0) == math.inf
