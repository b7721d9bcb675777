"""The localizer of one train: what it claims, and faults one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, isnan, nan
from typing import Any, TypeAlias

import numpy as np
import pytest

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Localization, ProtectionReason, Status
from rail_signals.localizer.readings import (
    TickMeasurements,
)
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, OdometerModel, Sensor

DEFAULT = LocalizerSettings()
TICK_S = 0.1
#: Of a tick, by the names of `TickMeasurements`.
Readings: TypeAlias = dict[str, Any]


def located(localizer: Localizer, time_s: float, **readings: Any) -> Localization:
    """Return what a localizer says of a tick."""
    return Localization.of(localizer.tick(time_s, TickMeasurements(**readings)))


def shifted(sensor: str, by: Callable[[], float] | float) -> Callable[[Readings], None]:
    """Return what moves the chainage that a sensor tells."""
    key = "joint_m" if sensor == "block" else "chainage_m"

    def falsify(readings: Readings) -> None:
        if sensor in readings:
            amount = by() if callable(by) else by
            reading = readings[sensor]
            readings[sensor] = reading._replace(**{key: getattr(reading, key) + amount})

    return falsify


def test_before_the_first_fix_there_is_no_position(new_trip: Any) -> None:
    trip = new_trip(sensors=frozenset({Sensor.ODOMETER}))
    here = trip.run(5.0)
    assert (here.status, here.reason) == (Status.UNAVAILABLE, ProtectionReason.NO_FIX)
    assert isnan(here.position_m)
    assert isnan(here.speed_mps)
    assert (here.low_m, here.high_m, here.protection_m) == (-inf, inf, inf)


def test_with_one_position_sensor_the_claim_says_what_it_does_not_survive(new_trip: Any) -> None:
    trip = new_trip(sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER}))
    here = trip.run(10.0)
    assert (here.status, here.reason) == (Status.UNMONITORED, ProtectionReason.TOO_FEW_SENSORS)
    assert here.uncovered == {Sensor.RANGE}
    assert here.protection_m < 3.0
    assert trip.holds(here)


@pytest.mark.parametrize("direction", [1, -1])
def test_with_all_sensors_it_is_protected(new_trip: Any, direction: int) -> None:
    trip = new_trip(replace(DEFAULT, direction=direction)).place()
    here = trip.run(30.0)
    assert (here.status, here.reason) == (Status.PROTECTED, ProtectionReason.NONE)
    assert not here.detected
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.5)
    assert here.speed_mps == pytest.approx(trip.velocity_mps, abs=0.5)
    assert here.speed_low_mps < trip.velocity_mps < here.speed_high_mps
    assert all(h.status is Status.PROTECTED for h in trip.history)
    # Wide enough for the second-best sensor, and for nothing worse.
    assert 3.0 < here.protection_m < 20.0


def test_towards_smaller_chainages_everything_is_mirrored(new_trip: Any) -> None:
    there, back = (new_trip(replace(DEFAULT, direction=d)).place() for d in (1, -1))

    # Noise adds to chainages, so it is turned round as well.
    def turn(readings: Readings) -> None:
        s, v = back.chainage_m, back.velocity_mps
        if fix := readings.get("range"):
            readings["range"] = fix._replace(chainage_m=2.0 * s - fix.chainage_m)
        if fix := readings.get("doppler"):
            readings["doppler"] = fix._replace(
                chainage_m=2.0 * s - fix.chainage_m, speed_mps=2.0 * v - fix.speed_mps
            )

    one, other = there.run(15.0), back.run(15.0, turn)
    assert other.position_m == pytest.approx(-one.position_m, abs=1e-9)
    assert (other.low_m, other.high_m) == pytest.approx((-one.high_m, -one.low_m), abs=1e-9)


def test_by_wheels_alone_the_interval_grows_with_the_distance_to_too_wide(
    new_trip: Any,
) -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(unmonitored_s=inf))
    trip = new_trip(settings, sensors=frozenset({Sensor.ODOMETER}), tick_s=0.5).place()
    widths = []
    for _ in range(4):
        here = trip.run(20.0)
        assert (here.status, here.uncovered) == (Status.UNMONITORED, {Sensor.ODOMETER})
        assert trip.holds(here)
        widths.append(here.protection_m)
    # K sigma of the scale over 400 m each time; the scale is known from the speed at the place.
    steps = np.diff(widths)
    assert (steps > 0.0).all()
    assert steps[-1] == pytest.approx(settings.claim.sigmas * 0.005 * 400.0, rel=0.5)
    trip.speed_mps = 80.0
    trip.run(100.0)
    assert ProtectionReason.TOO_WIDE in {h.reason for h in trip.history}
    assert trip.history[-1].status is Status.UNAVAILABLE


def test_an_unmonitored_position_is_given_for_a_stated_time(new_trip: Any) -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(unmonitored_s=30.0))
    trip = new_trip(settings, sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER}))
    assert trip.run(29.0).status is Status.UNMONITORED
    assert trip.run(2.0).reason is ProtectionReason.UNMONITORED_TOO_LONG
    trip.sensors = frozenset(Sensor)
    assert trip.run(30.0).status is Status.PROTECTED


def test_a_train_may_stand_for_an_hour(new_trip: Any) -> None:
    trip = new_trip(speed_mps=0.0, tick_s=5.0).place()
    start = trip.run(60.0)
    here = trip.run(3540.0)
    assert here.status is Status.PROTECTED
    assert not any(h.detected for h in trip.history)
    assert all(h.low_m <= 1000.0 <= h.high_m for h in trip.history)
    # Thousands of ranges with the same bias are worth one, and wheels that stand hardly drift.
    assert here.sigma_m == pytest.approx(DEFAULT.ranging.bias_m, rel=0.25)
    # Without the range there are only wheels, whose noise adds up: it is wide, and is given still.
    assert start.protection_m < here.protection_m < DEFAULT.claim.widest_m


def test_a_late_range_is_brought_to_now(new_trip: Any) -> None:
    trip = new_trip(speed_mps=30.0).place()

    def late(readings: Readings) -> None:
        fix = readings["range"]
        then_m = fix.chainage_m - 0.3 * trip.velocity_mps
        readings["range"] = fix._replace(age_s=0.3, chainage_m=then_m)

    here = trip.run(20.0, late)
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.0)
    assert not any(h.detected for h in trip.history)


def test_slipping_wheels_are_believed_less_and_no_fault(new_trip: Any) -> None:
    trip = new_trip(speed_mps=25.0).place()
    trip.run(20.0)
    spin = iter([*np.linspace(0.0, 5.0, 8), *[5.0] * 25, *np.linspace(5.0, 0.0, 8)])

    def slip(readings: Readings) -> None:
        wheels = readings["odometer"]
        readings["odometer"] = wheels._replace(speed_mps=wheels.speed_mps + float(next(spin)))

    trip.run(4.1, slip)
    assert not any(h.detected for h in trip.history)
    here = trip.run(20.0)
    assert trip.holds(here)
    assert not here.detected
    assert here.speed_mps == pytest.approx(25.0, abs=0.5)


FAULTS = {
    "range jumps": (Sensor.RANGE, shifted("range", 30.0), 0.5),
    "range from the wrong station": (Sensor.RANGE, shifted("range", -1500.0), 0.5),
    "doppler jumps": (Sensor.DOPPLER, shifted("doppler", 60.0), 1.0),
    "wrong joint": (Sensor.BLOCK, shifted("block", 500.0), 26.0),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_sudden_fault_is_found_and_its_sensor_excluded(new_trip: Any, name: str) -> None:
    sensor, falsify, within_s = FAULTS[name]
    trip = new_trip().place()
    assert not trip.run(20.0).detected
    here = trip.run(within_s, falsify)
    assert here.detected
    assert here.excluded == {sensor}
    here = trip.run(10.0, falsify)
    assert here.status is Status.PROTECTED
    assert trip.holds(here)


def test_a_frozen_range_is_found_when_the_train_moves(new_trip: Any) -> None:
    trip = new_trip(speed_mps=0.0).place()
    trip.run(20.0)

    def freeze(readings: Readings) -> None:
        readings["range"] = readings["range"]._replace(
            chainage_m=1000.0 + 0.2 * float(trip.rng.standard_normal())
        )

    assert not trip.run(20.0, freeze).detected
    for speed_mps in np.linspace(0.0, 10.0, 100):
        trip.speed_mps = float(speed_mps)
        assert trip.holds(trip.run(TICK_S, freeze))
    here = trip.run(5.0, freeze)
    assert here.excluded == {Sensor.RANGE}
    assert trip.holds(here)


def test_a_range_that_creeps_away_is_found_by_comparison(new_trip: Any) -> None:
    """No innovation is ever large: the gates do not see it."""
    trip = new_trip().place()
    before_m = trip.run(20.0).protection_m
    off = iter(np.arange(0.0, 200.0, 0.05))
    falsify = shifted("range", lambda: float(next(off)))
    found_m = nan
    while not trip.history[-1].excluded:
        here = trip.run(TICK_S, falsify)
        assert here.status is Status.UNAVAILABLE or trip.holds(here)
        if here.detected and isnan(found_m):
            found_m = 0.05 * (trip.tick - 200)
    assert trip.history[-1].excluded == {Sensor.RANGE}
    # Found before the error became as large as the protection level had been.
    assert found_m < before_m


def test_a_worn_wheel_is_estimated_and_a_wrong_one_is_found(new_trip: Any) -> None:
    trip = new_trip().place()
    trip.run(20.0)
    wheels = {"factor": 1.0}

    def scaled(readings: Readings) -> None:
        wheels["factor"] = min(wheels["factor"] + 1e-3, goal)
        readings["odometer"] = readings["odometer"]._replace(
            speed_mps=readings["odometer"].speed_mps * wheels["factor"]
        )

    goal = 1.02
    assert not trip.run(20.0, scaled).detected
    goal = 1.25
    here = trip.run(60.0, scaled)
    assert here.excluded == {Sensor.ODOMETER}
    assert all(h.excluded <= {Sensor.ODOMETER} for h in trip.history)
    assert trip.holds(here)


def test_with_two_sensors_a_fault_is_found_but_not_whose(new_trip: Any) -> None:
    trip = new_trip(sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER})).place()
    trip.run(20.0)
    off = iter(np.arange(0.0, 2000.0, 0.2))
    here = trip.run(10.0, shifted("range", lambda: float(next(off))))
    assert here.detected
    assert not here.excluded
    # Either may be wrong, and the interval holds what each of them says.
    assert here.protection_m > 5.0
    assert trip.holds(here)
    # A block decides it.
    trip.sensors |= {Sensor.BLOCK}
    here = trip.run(25.0, shifted("range", lambda: float(next(off))))
    assert here.excluded == {Sensor.RANGE}
    assert trip.holds(here)


def test_two_faulty_sensors_make_it_unavailable_and_it_begins_anew(new_trip: Any) -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(restart_s=15.0))
    trip = new_trip(settings).place()
    trip.run(20.0)

    def both(readings: Readings) -> None:
        shifted("range", 150.0)(readings)
        shifted("doppler", -300.0)(readings)
        shifted("block", 90.0)(readings)

    trip.run(30.0, both)
    reasons = [h.reason for h in trip.history[200:]]
    assert ProtectionReason.CONTRADICTION in reasons
    assert trip.history[-1].status is not Status.PROTECTED
    here = trip.run(60.0)
    assert here.status is not Status.UNAVAILABLE
    assert trip.holds(here)


def test_an_excluded_sensor_returns_after_it_has_agreed_for_a_time(new_trip: Any) -> None:
    trip = new_trip().place()
    trip.run(20.0)
    assert trip.run(5.0, shifted("range", 40.0)).excluded == {Sensor.RANGE}
    return_s = DEFAULT.claim.return_s
    assert trip.run(return_s - 1.0).excluded == {Sensor.RANGE}
    here = trip.run(10.0)
    assert not here.excluded
    assert here.status is Status.PROTECTED
    assert here.sigma_m < 0.5
    assert trip.holds(here)


def test_a_single_outlier_is_left_out_and_no_more(new_trip: Any) -> None:
    trip = new_trip().place()
    trip.run(30.0)
    before = trip.history[-1]
    here = trip.run(0.2, shifted("range", 400.0))
    assert not here.detected
    here = trip.run(1.0)
    assert not here.detected
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.5)
    assert here.protection_m == pytest.approx(before.protection_m, abs=5.0)


@pytest.mark.parametrize("time_s", [5.0, 4.9, nan, inf])
def test_time_goes_forwards(time_s: float) -> None:
    localizer = Localizer(DEFAULT)
    located(localizer, 5.0)
    with pytest.raises(ValueError, match="time_s"):
        located(localizer, time_s)


def test_after_a_long_silence_there_is_no_position(new_trip: Any) -> None:
    trip = new_trip().place()
    trip.run(30.0)
    here = located(trip.localizer, trip.tick * TICK_S + 3600.0)
    assert here.status is Status.UNAVAILABLE
    trip.tick += 36000
    here = trip.run(30.0)
    assert here.status is not Status.UNAVAILABLE
    assert trip.holds(here)


def test_the_same_readings_give_the_same_bits(new_trip: Any) -> None:
    one, other = new_trip().place(), new_trip().place()
    one.run(20.0)
    other.run(20.0)
    assert one.history == other.history


@pytest.mark.parametrize(
    ("model", "name", "value"),
    [
        (IntegrityClaim, "risk", 0.0),
        (IntegrityClaim, "risk", 0.9),
        (IntegrityClaim, "widest_m", inf),
        (IntegrityClaim, "strikes", (3, 3, 1)),
        (IntegrityClaim, "strikes", (3, 3, 0, 3)),
        (OdometerModel, "scale", 0.5),
        (OdometerModel, "noise_mps", nan),
        (OdometerModel, "noise_mps", 0.0),
        (LocalizerSettings, "direction", 0),
    ],
)
def test_settings_are_checked_and_the_bad_one_is_named(
    model: type, name: str, value: object
) -> None:
    with pytest.raises(ValueError, match=name):
        model(**{name: value})


@pytest.mark.parametrize(("sigma_m", "chainage_m"), [(0.0, 0.0), (1.0, nan), (inf, 0.0)])
def test_a_place_must_mean_something(sigma_m: float, chainage_m: float) -> None:
    with pytest.raises(ValueError, match=r"sigma_m|chainage_m"):
        Localizer(DEFAULT).place(chainage_m, sigma_m)
