"""Wheels against physics and against the lengths of blocks."""

from __future__ import annotations

import pytest

from rail_onboard.track_code.block_check import BlockCheck
from rail_onboard.track_code.wheel_check import WheelCheck

DT_S = 0.25


def ride(ratio: float, *, slide_s: float = 60.0, accelerates: float = 0.3) -> list[bool]:
    """Return of each tick whether speed and way are at least the true ones."""
    wheels = WheelCheck(most_braking_mps2=1.4, most_traction_mps2=1.1)
    speed, way, shown = 15.0, 0.0, 0.0
    bounds, trusted = [], []
    for tick in range(400):
        time_s = DT_S * tick
        slides = 10.0 <= time_s < 10.0 + slide_s
        speed = min(25.0, speed + accelerates * DT_S)
        way += speed * DT_S
        now = ratio if slides else 1.0
        shown += now * speed * DT_S
        fastest = wheels.update(time_s, shown, now * speed)
        if tick == 0:
            way = shown = 0.0
        bounds.append(fastest >= speed - 1e-6)
        trusted.append(wheels.trusted)
    assert trusted[39]
    assert not any(trusted[40 : 40 + round(slide_s / DT_S)])
    assert trusted[-1]
    return bounds


@pytest.mark.parametrize("ratio", [0.3, 0.5, 0.8])
def test_a_slide_is_noticed_at_once_and_trusted_again_when_it_ends(ratio: float) -> None:
    assert all(ride(ratio))


def test_spinning_wheels_are_noticed_too() -> None:
    assert all(ride(1.5))


def test_brakes_and_traction_are_no_slide() -> None:
    wheels = WheelCheck(most_braking_mps2=1.4, most_traction_mps2=1.1)
    speed = 20.0
    for tick in range(400):
        speed = max(0.0, speed - 1.4 * DT_S) if tick < 200 else min(20.0, speed + 1.1 * DT_S)
        wheels.update(tick * DT_S, tick * 1.0, speed)
        assert wheels.trusted


def test_a_demanded_brake_brings_the_worst_of_the_speed_down_to_a_stand() -> None:
    wheels = WheelCheck(most_braking_mps2=1.4, most_traction_mps2=1.1)
    wheels.update(0.0, 0.0, 20.0)
    wheels.update(DT_S, 2.5, 10.0)
    fastest = [
        wheels.update(DT_S * t, 2.5, 0.0, braked=True, guaranteed_mps2=0.5) for t in range(2, 240)
    ]
    assert max(fastest) > 20.0
    assert fastest[-1] == 0.0


def test_a_block_too_short_by_the_wheels_is_noticed() -> None:
    def ratio_of(run_m: float, length_m: float = 500.0) -> float | None:
        check = BlockCheck(0.3, 0.02)
        check.run_to(0.0, 10.0)
        check.enter()
        assert check.leave(500.0, follows=True) is None
        check.run_to(run_m, 10.0)
        check.enter()
        return check.leave(length_m, follows=True)

    assert ratio_of(505.0) == 1.0
    assert ratio_of(250.0) == pytest.approx(250.0 / 525.0)
    assert ratio_of(700.0) is None
    assert ratio_of(100.0, 100.0) is None  # too short a block to make wheels believed
