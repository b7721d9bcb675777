"""The claims of the patent: the position functions of two stations."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

from rail_signals.doppler.patent_functions import CircularSection, MixedSection, StraightSection

SHIFT_HZ = 722.7  # 2.6 GHz, 300 km/h
MOST_HZ = 730.0
STRAIGHT = StraightSection(500.0, (50.0, -30.0), -480.0, 480.0)
ARC = CircularSection(
    600.0, ((620.0 * cos(-0.6), 620.0 * sin(-0.6)), (575.0 * cos(0.7), 575.0 * sin(0.7))), -0.6, 0.7
)


def shifts(section: StraightSection | CircularSection, place: float, speed: float = 1.0):
    one, two = section.cosines(place)
    return speed * SHIFT_HZ * float(one), speed * SHIFT_HZ * float(two)


@pytest.mark.parametrize("x_m", [-450.0, -100.0, 0.0, 3.0, 250.0, 470.0])
@pytest.mark.parametrize("speed", [1.0, 0.05])
def test_the_straight_function_is_least_where_the_train_is(x_m: float, speed: float) -> None:
    """Claims 4 and 11, whatever the speed."""
    place, value = STRAIGHT.position(shifts(STRAIGHT, x_m, speed), MOST_HZ)
    assert place == pytest.approx(x_m, abs=1e-3)
    assert value < 1e-6


def test_abeam_of_the_second_station_nothing_is_divided() -> None:
    section = StraightSection(500.0, (50.0, 50.0), -700.0, 700.0)
    one, two = shifts(section, 500.0)
    assert two == 0.0
    assert section.position((one, two))[0] == pytest.approx(500.0, abs=1e-3)


@pytest.mark.parametrize("theta", [-0.3, -0.1, 0.0, 0.31, 0.5])
def test_the_circular_function_is_least_where_the_train_is(theta: float) -> None:
    """Claims 5 and 12."""
    place, value = ARC.position(shifts(ARC, theta), MOST_HZ)
    assert place == pytest.approx(theta, abs=1e-6)
    assert value < 1e-6


def test_two_places_may_have_the_same_ratio() -> None:
    """What two stations leave open, and `doppler_position` says: ambiguous."""
    both = shifts(ARC, 0.65)
    place, value = ARC.position(both, MOST_HZ)
    assert value < 1e-6 and float(ARC.function(0.65, both)) < 1e-6
    assert abs(place - 0.65) > 0.1


def test_the_law_of_cosines_gives_the_rate_of_the_distance() -> None:
    for theta in np.linspace(-1.5, 1.5, 13):
        for number, (x, y) in enumerate(ARC.stations_m):
            near, far = (
                np.hypot(600.0 * cos(theta + d) - x, 600.0 * sin(theta + d) - y)
                for d in (-1e-6, 1e-6)
            )
            rate = (far - near) / (2e-6 * 600.0)
            assert cos(ARC.angle_to(number, theta)) == pytest.approx(-rate, abs=1e-4)


def mixed() -> MixedSection:
    """A straight of 1000 m, then an arc to the left of 600 m; stations 200 m to each side."""
    stations = ((-200.0, 40.0), (200.0, -20.0))  # from the joint, x along the straight
    straight = StraightSection(200.0, (40.0, -20.0), -1000.0, 0.0)
    # The centre is 600 m to the left of the joint; the train there is at -90 degrees.
    first, second = ((x, y - 600.0) for x, y in stations)
    return MixedSection(straight, CircularSection(600.0, (first, second), -pi / 2, -pi / 2 + 0.8))


def test_the_right_section_of_a_mixed_one_is_chosen() -> None:
    """Claims 6 and 13."""
    section = mixed()
    for x_m in (-600.0, -150.0, -40.0):
        chosen = section.position(shifts(section.straight, x_m), MOST_HZ)
        assert chosen is not None and chosen[0] == "straight"
        assert chosen[1] == pytest.approx(x_m, abs=0.01)
    for theta in (-pi / 2 + 0.05, -pi / 2 + 0.2, -pi / 2 + 0.5):
        chosen = section.position(shifts(section.arc, theta), MOST_HZ)
        assert chosen is not None and chosen[0] == "arc"
        assert chosen[1] == pytest.approx(theta, abs=1e-4)


def test_nothing_fits_is_said() -> None:
    assert StraightSection(500.0, (50.0, 50.0), -100.0, 100.0).position((700.0, 700.0))[1] > 1.0
    section = MixedSection(
        StraightSection(500.0, (50.0, 50.0), 100.0, 200.0),
        CircularSection(600.0, ARC.stations_m, 0.5, 0.6),
    )
    assert section.position((SHIFT_HZ, SHIFT_HZ)) is None
