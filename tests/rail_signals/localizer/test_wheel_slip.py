"""Effort and slip as told from the wheels."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.localizer.readings import WheelSpeed
from rail_signals.localizer.settings import OdometerModel
from rail_signals.localizer.wheel_slip import SlipDetector

MODEL = OdometerModel()


def watched(speeds_mps: np.ndarray, step_s: float = 0.1) -> tuple[SlipDetector, list[float]]:
    """Return a watch that has seen wheel speeds, and the slip that it reckoned with."""
    watch, slips = SlipDetector(MODEL), []
    for tick, speed_mps in enumerate(speeds_mps.tolist()):
        watch.update(step_s if tick else 0.0, WheelSpeed(speed_mps, 0.0))
        slips.append(float(watch.slip_mps[0]))
    return watch, slips


def coasting(speed_mps: float) -> float:
    return MODEL.creep * speed_mps + MODEL.creep_mps


def pulling(speed_mps: float) -> float:
    return MODEL.effort_creep * speed_mps + MODEL.effort_creep_mps


def slipping(speed_mps: float) -> float:
    return MODEL.slip * speed_mps + MODEL.slip_mps


def test_at_a_constant_speed_wheels_hardly_creep() -> None:
    _, slips = watched(np.full(50, 20.0))
    assert slips == pytest.approx([coasting(20.0)] * 50)


@pytest.mark.parametrize("step_s", [0.05, 0.1, 1.0])
@pytest.mark.parametrize(
    ("acceleration", "expected"),
    [(0.25, coasting), (0.6, pulling), (-1.3, pulling), (1.7, slipping), (-3.0, slipping)],
)
def test_a_steady_acceleration_is_told_whatever_the_tick(
    acceleration: float, expected: object, step_s: float
) -> None:
    seconds = np.arange(0.0, 8.0, step_s)
    speeds = 30.0 + acceleration * seconds
    _, slips = watched(speeds, step_s)
    fastest = max(30.0 - MODEL.limit_mps2 * seconds[-1], speeds[-1])
    assert callable(expected)
    assert slips[-1] == pytest.approx(expected(fastest))


def test_effort_is_assumed_for_a_time_after_it_was_seen() -> None:
    speeds = np.concatenate([20.0 + 0.08 * np.arange(50), np.full(120, 24.0)])
    _, slips = watched(speeds)
    assert slips[49] == pytest.approx(pulling(speeds[49]))
    assert slips[49 + 30] == pytest.approx(pulling(24.0))
    assert slips[-1] == pytest.approx(coasting(24.0))


def test_sliding_wheels_do_not_hide_how_fast_the_train_may_be() -> None:
    speeds = np.concatenate([np.full(20, 30.0), np.zeros(20)])
    _, slips = watched(speeds)
    assert slips[-1] == pytest.approx(slipping(30.0 - 20 * 0.1 * MODEL.limit_mps2))


def test_the_coefficient_of_the_scale_does_not_follow_noise() -> None:
    rng = np.random.default_rng(1)
    watch, _ = watched(np.full(20, 20.0))
    seen = set()
    for _ in range(300):
        watch.update(0.1, WheelSpeed(20.0 + 0.05 * float(rng.standard_normal()), 0.0))
        seen.add(float(watch.steady_mps[0]))
    assert seen == {20.0}
    for speed_mps in np.arange(20.0, 10.0, -0.1).tolist():
        watch.update(0.1, WheelSpeed(speed_mps, 0.0))
        assert abs(watch.steady_mps[0] - speed_mps) < 1.0


def test_runs_without_a_reading_keep_what_they_have() -> None:
    watch = SlipDetector(MODEL, (2,))
    both = np.array([[True], [True]])
    for tick in range(30):
        speed = np.full((2, 1), 20.0 + 0.06 * tick)
        watch.update(0.1, WheelSpeed(speed, np.zeros((2, 1)), both))
    one = np.array([[True], [False]])
    for _ in range(100):
        speed = np.array([[21.8], [0.0]])
        watch.update(0.1, WheelSpeed(speed, np.zeros((2, 1)), one))
    watch.update(0.1, None)
    assert watch.slip_mps[0, 0] == pytest.approx(coasting(21.8))
    assert watch.slip_mps[1, 0] < slipping(1.0)
    assert watch.steady_mps[1, 0] == pytest.approx(21.8, abs=1.0)
