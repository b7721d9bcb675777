"""What supervision takes of a localizer's row."""

from __future__ import annotations

from math import inf, nan

import pytest

from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_onboard.localizer.protected_interval import protected_interval

ROW = {
    "status": 2.0,
    "front_m": 1000.0,
    "low_m": 990.0,
    "high_m": 1016.0,
    "speed_mps": 20.0,
    "speed_low_mps": 19.0,
    "speed_high_mps": 21.5,
    "fastest_mps": 22.0,
}


def row(**changes: float) -> list[float]:
    """Return a row of a localizer."""
    values = dict.fromkeys(LOCALIZER_STATE.columns, 0.0) | ROW | changes
    return list(values.values())


def test_wheels_that_are_not_doubted_are_the_speed() -> None:
    here = protected_interval(row())
    assert here is not None
    assert (here.low_m, here.high_m, here.half_m) == (990.0, 1016.0, 13.0)
    assert here.speeds(-20.5) == (20.5, 20.5)


def test_wheels_that_are_doubted_are_not() -> None:
    here = protected_interval(row(wheels_doubted=1.0, speed_mps=-20.0))
    assert here is not None
    assert here.speeds(12.0) == (20.0, 22.0)
    assert here.braking_m(22.0, 0.7, 1.0) == 0.0


def test_what_a_train_may_be_faster_costs_way_until_it_stands() -> None:
    here = protected_interval(row())
    assert here is not None
    stops_m = [v * 1.5 + v**2 / (2.0 * 0.8) for v in (20.0, 22.0)]
    assert here.braking_m(20.0, 0.8, 1.5) == pytest.approx(stops_m[1] - stops_m[0])
    assert here.braking_m(22.5, 0.8, 1.5) == 0.0


def test_the_way_grows_with_the_travel() -> None:
    here = protected_interval(row())
    assert here is not None
    assert here.travelled(1) == (990.0, 1016.0)
    assert here.travelled(-1) == (-1016.0, -990.0)


@pytest.mark.parametrize("bound", ["low_m", "high_m"])
@pytest.mark.parametrize("value", [nan, inf, -inf])
def test_an_interval_without_ends_is_none(bound: str, value: float) -> None:
    assert protected_interval(row(**{bound: value})) is None


@pytest.mark.parametrize("bound", ["speed_mps", "fastest_mps", "wheels_doubted"])
@pytest.mark.parametrize("value", [nan, inf])
def test_a_speed_that_is_not_known_is_none(bound: str, value: float) -> None:
    assert protected_interval(row(**{bound: value})) is None


def test_of_nothing_there_is_nothing() -> None:
    assert protected_interval(None) is None
