"""Wheel sensors and axles against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from axle_counter.signals.axle_detector import AxleDetector, Passages
from axle_counter.signals.axles import PIVOT_RATIO, Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from scipy.optimize import brentq
from scipy.stats import norm

SENSOR = WheelSensor()
ONE_FORWARD = Passages(1, 0, 0, busy=False, valid=True)
ONE_BACKWARD = Passages(0, 1, 0, busy=False, valid=True)
NOTHING = Passages(0, 0, 0, busy=False, valid=True)


def amplitudes(wheel_m: np.ndarray, sensor: WheelSensor = SENSOR) -> np.ndarray:
    """Return what the coils show of one wheel [coil, sample]."""
    return sensor.rest_v - sensor.dip_v(wheel_m - np.array(sensor.coils_m)[:, None])


def run(*paths: np.ndarray, sensor: WheelSensor = SENSOR) -> list[Passages]:
    """Return what is seen of a wheel after a first block without one."""
    detector = AxleDetector(sensor)
    assert detector.feed(amplitudes(np.full(8, 9.0), sensor)) == NOTHING
    return [detector.feed(amplitudes(path, sensor)) for path in paths]


def total(seen: list[Passages]) -> tuple[int, int, int]:
    return tuple(
        sum(getattr(each, name) for each in seen) for name in ("forward", "backward", "unclear")
    )


def test_a_dip_has_its_depth_its_travel_and_its_area() -> None:
    u_m = np.linspace(-0.3, 0.3, 6001)
    dip = SENSOR.dip_v(u_m)
    assert dip.max() == pytest.approx(SENSOR.depth_v) == SENSOR.dip_v(0.0)
    assert not dip[np.abs(u_m) >= 0.15].any()
    # The integral of depth (1 + cos) / 2 over one period is half of depth times period.
    assert np.trapezoid(dip, u_m) == pytest.approx(0.5 * SENSOR.depth_v * SENSOR.pulse_m, rel=1e-6)
    assert SENSOR.dip_v(0.5, half_length_m=0.5) == pytest.approx(SENSOR.depth_v)
    assert SENSOR.dip_v(0.65, half_length_m=0.5) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("fraction", [0.05, 0.2, 0.3, 0.5, 0.9])
def test_the_width_of_a_dip_is_where_it_has_that_depth(fraction: float) -> None:
    found = brentq(lambda u: float(SENSOR.dip_v(u)) - fraction * SENSOR.depth_v, 0.0, 0.1499)
    assert SENSOR.half_width_m(fraction) == pytest.approx(found, abs=1e-9)


def test_the_least_sample_rate_is_where_the_closest_events_are_a_sample_apart() -> None:
    fine = np.linspace(-0.4, 0.4, 800_001)
    on = [fine[np.argmax(SENSOR.dip_v(fine - c) > 0.3 * 0.5)] for c in SENSOR.coils_m]
    off = [fine[np.nonzero(SENSOR.dip_v(fine - c) >= 0.2 * 0.5)[0][-1]] for c in SENSOR.coils_m]
    events = [on[0], on[1], off[0], off[1]]
    assert min(np.diff(events)) == pytest.approx(SENSOR.shortest_m, abs=2e-6)
    assert -events[0] == pytest.approx(SENSOR.approach_m, abs=2e-6)
    assert events[-1] == pytest.approx(SENSOR.clear_m, abs=2e-6)
    speed_mps = 300.0 / 3.6
    rate_hz = SENSOR.least_sample_rate_hz(speed_mps)
    assert rate_hz == pytest.approx(speed_mps / min(np.diff(events)), rel=1e-4)
    assert SENSOR.top_speed_mps(rate_hz) == pytest.approx(speed_mps)


def test_below_the_top_speed_every_phase_is_seen_and_above_it_some_are_not() -> None:
    rate_hz = 8000.0
    top_mps = SENSOR.top_speed_mps(rate_hz)
    unclear = {0.99: 0, 1.3: 0}
    for factor in unclear:
        step_m = factor * top_mps / rate_hz
        for offset in np.linspace(0.0, 1.0, 50, endpoint=False):
            path = np.arange(-20, 20) * step_m + offset * step_m
            found = total(run(path, np.full(4, 9.0)))
            assert found in ((1, 0, 0), (0, 0, 1))
            unclear[factor] += found[2]
    assert unclear[0.99] == 0
    assert unclear[1.3] > 0  # and never the wrong way


def test_close_axles_bound_the_top_speed_as_well() -> None:
    close_m = SENSOR.least_axle_distance_m
    assert SENSOR.top_speed_mps(8000.0, close_m) == 0.0
    assert SENSOR.top_speed_mps(8000.0, close_m + 0.01) == pytest.approx(80.0)
    assert SENSOR.top_speed_mps(8000.0, 2.5) == SENSOR.top_speed_mps(8000.0)


def test_false_alarms_come_as_often_as_the_tail_of_the_noise_says() -> None:
    noise_v = SENSOR.threshold * SENSOR.depth_v / 2.5
    samples = 400_000
    noise = np.random.default_rng(5).normal(SENSOR.rest_v, noise_v, samples)
    below = np.count_nonzero(noise < SENSOR.rest_v - SENSOR.threshold * SENSOR.depth_v)
    expected = SENSOR.false_alarm_rate_hz(noise_v, 8000.0) * samples / 8000.0
    assert expected == pytest.approx(samples * norm.sf(2.5))
    assert below == pytest.approx(expected, abs=4.0 * math.sqrt(expected))
    assert SENSOR.false_alarm_rate_hz(0.0, 8000.0) == 0.0
    # With the noise assumed, the thresholds are 30 sigma away: never.
    assert SENSOR.false_alarm_rate_hz(0.005, 8000.0) < 1e-100


@pytest.mark.parametrize("speed_kmh", [5.0, 80.0, 300.0])
@pytest.mark.parametrize("way", [1, -1])
def test_an_axle_is_counted_once_in_its_direction(speed_kmh: float, way: int) -> None:
    count = round(8000.0 / (speed_kmh / 3.6))
    path = way * np.linspace(-0.5, 0.5, count)
    expected = (1, 0, 0) if way > 0 else (0, 1, 0)
    assert total(run(path)) == expected
    # And cut into blocks anywhere, as the ticks cut it.
    for parts in (2, 7, 50):
        assert total(run(*np.array_split(path, parts))) == expected


def test_a_wheel_that_stands_is_seen_as_long_as_it_stands_and_counted_once() -> None:
    generator = np.random.default_rng(6)
    for place_m in np.linspace(-0.2, 0.2, 41):
        come, go = np.linspace(-0.5, place_m, 500), np.linspace(place_m, 0.5, 500)
        detector = AxleDetector(SENSOR)
        seen = []
        for path in (np.full(8, 9.0), come, *np.full((20, 800), place_m), go):
            noise = generator.normal(0.0, 0.005, (2, path.size))
            seen.append(detector.feed(amplitudes(path) + noise))
        assert total(seen) == (1, 0, 0), place_m
        inside = abs(place_m) < SENSOR.approach_m - 0.03
        assert all(each.busy for each in seen[2:-1]) or not inside


@pytest.mark.parametrize("turn_m", [-0.16, -0.05, 0.0, 0.05, 0.16])
def test_a_wheel_that_turns_back_on_the_sensor_is_not_counted(turn_m: float) -> None:
    there = np.linspace(-0.5, turn_m, 400)
    assert total(run(there, there[::-1])) == (0, 0, 0)
    assert total(run(-there, -there[::-1])) == (0, 0, 0)
    # To and fro, and then across.
    to_and_fro = np.concatenate([there, there[::-1], there, np.linspace(turn_m, 0.5, 400)])
    assert total(run(to_and_fro)) == (1, 0, 0)


def test_what_stands_on_the_sensor_at_power_up_has_no_direction() -> None:
    detector = AxleDetector(SENSOR)
    first = detector.feed(amplitudes(np.zeros(100)))
    assert first == Passages(0, 0, 0, busy=True, valid=True)
    assert detector.feed(amplitudes(np.linspace(0.0, 0.5, 400))).unclear == 1
    assert detector.feed(amplitudes(np.linspace(-0.5, 0.5, 400))) == ONE_FORWARD


@pytest.mark.parametrize("wrong_v", [0.0, 0.1, 1.6, math.nan, math.inf])
def test_a_coil_that_has_failed_is_told_and_what_passed_meanwhile_is_unclear(
    wrong_v: float,
) -> None:
    detector = AxleDetector(SENSOR)
    rest = np.ones((2, 50))
    assert detector.feed(rest) == NOTHING
    broken = rest.copy()
    broken[1, 20] = wrong_v
    assert not detector.feed(broken).valid
    assert detector.feed(rest) == Passages(0, 0, 1, busy=False, valid=True)
    assert detector.feed(rest) == NOTHING


def test_the_axles_of_a_train() -> None:
    cars = Cars(26.4, 4, 2.5)
    assert cars.bogies_m(26.4) == pytest.approx([3.7, 22.7])  # 19 m apart
    axles_m = cars.axles_m(2 * 26.4)
    assert len(axles_m) == 8
    assert np.diff(axles_m)[[0, 2, 4, 6]] == pytest.approx(2.5)
    assert np.diff(axles_m)[1] == pytest.approx(PIVOT_RATIO * 26.4 - 2.5)
    assert axles_m == pytest.approx(52.8 - axles_m[::-1])  # the same from either end
    assert len(Cars(20.0, 6, 3.0).axles_m(118.0)) == 36
    assert Cars(20.0, 6, 3.0).axle_distance_m == 1.5
    assert len(Cars(20.0, 2, 3.0).axles_m(20.0)) == 2
    assert len(Cars().axles_m(1.0)) == 4  # a train is one car at least


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"release": 0.3}, "release"),
        ({"threshold": 0.1}, "release"),
        ({"depth_v": 1.0}, "depth_v"),
        ({"coil_spacing_m": 0.21}, "coil_spacing_m"),
    ],
)
def test_a_sensor_that_cannot_work_is_refused(wrong: dict[str, float], line: str) -> None:
    with pytest.raises(ValueError, match=line):
        WheelSensor(**wrong)
    assert WheelSensor(coil_spacing_m=0.2).overlap_m == pytest.approx(
        SENSOR.overlap_m - 0.05
    )  # just possible
