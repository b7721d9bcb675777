"""Readings that are not finite, or the same again and again, as faults of whole trips."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import isfinite, nan
from typing import Any

import numpy as np
import pytest

from rail_signals.localizer.protection_level import ProtectionReason, Status
from rail_signals.localizer.screening import Rejection
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, Sensor

DEFAULT = LocalizerSettings()
RANGE_AND_WHEELS = frozenset({Sensor.RANGE, Sensor.ODOMETER})
#: In which filters that know neither a position nor the wheels' speed are lost.
LOST_WITHIN_S = 15.0


def frozen(name: str, **values: float) -> Callable[[dict[str, Any]], None]:
    """Return what holds the first reading of a sensor, less its time, with some other values."""
    held: dict[str, Any] = {}

    def falsify(readings: dict[str, Any]) -> None:
        if name in readings:
            readings[name] = held.setdefault(name, readings[name]._replace(**values))

    return falsify


def test_a_range_frozen_at_a_stand_is_no_evidence(new_trip: Any) -> None:
    """3 m off: the position may be true or not, but nothing monitors the wheels any longer."""
    trip = new_trip(speed_mps=0.0, sensors=RANGE_AND_WHEELS).place()
    freeze = frozen("range", chainage_m=1003.0)
    trip.run(LOST_WITHIN_S, freeze)
    assert all(trip.holds(here) for here in trip.history)
    here = trip.run(60.0, freeze)
    later = trip.history[-600:]
    assert all(h.status is Status.UNMONITORED for h in later)
    assert all(h.uncovered == {Sensor.ODOMETER} for h in later)
    assert here.reason is ProtectionReason.TOO_FEW_SENSORS
    # All but the first few, which might have been chance.
    rejected = round((LOST_WITHIN_S + 60.0) / trip.tick_s) - (DEFAULT.claim.most_alike - 1)
    assert trip.localizer.rejections == {(Sensor.RANGE, Rejection.FROZEN): rejected}


def test_a_healthy_range_at_a_stand_is(new_trip: Any) -> None:
    """Noise is drawn anew for each reading; wheels that stand report zero all the time."""
    trip = new_trip(speed_mps=0.0, sensors=RANGE_AND_WHEELS).place()
    here = trip.run(120.0)
    assert all(h.status is Status.PROTECTED for h in trip.history)
    assert not trip.localizer.rejections
    assert here.position_m == pytest.approx(1000.0, abs=3.0 * DEFAULT.ranging.bias_m)


def test_a_range_that_was_frozen_is_evidence_again_at_once(new_trip: Any) -> None:
    trip = new_trip(speed_mps=0.0, sensors=RANGE_AND_WHEELS).place()
    trip.run(60.0, frozen("range"))
    assert trip.history[-1].status is Status.UNMONITORED
    here = trip.run(1.0)
    assert here.status is Status.PROTECTED
    assert trip.holds(here)


def test_a_range_frozen_before_the_train_starts_does_not_hold_it_back(new_trip: Any) -> None:
    trip = new_trip(speed_mps=0.0).place()
    freeze = frozen("range")
    trip.run(10.0, freeze)
    for speed_mps in np.linspace(0.0, 10.0, 100).tolist():
        trip.speed_mps = speed_mps
        assert trip.holds(trip.run(trip.tick_s, freeze))
    here = trip.run(20.0, freeze)
    assert trip.holds(here)
    assert here.status is Status.PROTECTED
    assert here.position_m == pytest.approx(trip.chainage_m, abs=4.0 * here.sigma_m)


def test_a_frozen_doppler_fix_is_no_evidence(new_trip: Any) -> None:
    """Without a range, Doppler fixes and wheels check each other; a frozen fix checks nothing."""
    trip = new_trip(sensors=frozenset({Sensor.DOPPLER, Sensor.ODOMETER})).place()
    assert trip.run(20.0).status is Status.PROTECTED
    freeze = frozen("doppler")
    for _ in range(150):
        assert trip.holds(trip.run(0.1, freeze))
    here = trip.run(20.0, freeze)
    assert (here.status, here.uncovered) == (Status.UNMONITORED, {Sensor.ODOMETER})
    assert trip.holds(here)
    assert {why for _, why in trip.localizer.rejections} == {Rejection.FROZEN}


def test_wheels_frozen_at_zero_are_found_when_the_train_starts(new_trip: Any) -> None:
    """At a stand zero is what they report; rolling, range and Doppler fixes say otherwise."""
    trip = new_trip(speed_mps=0.0).place()
    freeze = frozen("odometer", speed_mps=0.0)
    assert not trip.run(60.0, freeze).detected
    assert all(h.status is Status.PROTECTED for h in trip.history)
    for speed_mps in np.linspace(0.0, 15.0, 200).tolist():
        trip.speed_mps = speed_mps
        assert trip.holds(trip.run(trip.tick_s, freeze))
    here = trip.run(5.0, freeze)
    assert here.excluded == {Sensor.ODOMETER}
    assert trip.holds(here)
    assert not trip.localizer.rejections


def test_wheels_frozen_at_a_speed_are_found_when_the_train_brakes(new_trip: Any) -> None:
    trip = new_trip(speed_mps=20.0).place()
    trip.run(20.0)
    freeze = frozen("odometer", speed_mps=20.1)
    assert not trip.run(20.0, freeze).detected
    for speed_mps in np.linspace(20.0, 8.0, 150).tolist():
        trip.speed_mps = speed_mps
        assert trip.holds(trip.run(trip.tick_s, freeze))
    here = trip.run(10.0, freeze)
    assert here.excluded == {Sensor.ODOMETER}
    assert trip.holds(here)


@pytest.mark.parametrize(
    ("name", "field"),
    [
        ("range", "chainage_m"),
        ("range", "variance_m2"),
        ("doppler", "chainage_m"),
        ("doppler", "speed_mps"),
        ("doppler", "covariance_m2ps"),
        ("odometer", "speed_mps"),
        ("block", "joint_m"),
    ],
)
def test_what_is_not_a_number_is_as_if_there_were_nothing(
    new_trip: Any, name: str, field: str
) -> None:
    broken, silent = new_trip().place(), new_trip().place()
    broken.run(20.0)
    silent.run(20.0)

    def destroy(readings: dict[str, Any]) -> None:
        if name in readings:
            readings[name] = readings[name]._replace(**{field: nan})

    for _ in range(300):
        here = broken.run(0.1, destroy)
        assert here == silent.run(0.1, lambda readings: readings.pop(name, None))
        assert here.status is Status.UNAVAILABLE or isfinite(here.high_m - here.low_m)
    here = broken.run(5.0)
    assert here.status is Status.PROTECTED
    assert broken.holds(here)


@pytest.mark.parametrize("most_alike", [3, 8])
def test_how_many_are_too_many_is_a_setting(new_trip: Any, most_alike: int) -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(most_alike=most_alike))
    trip = new_trip(settings, speed_mps=0.0).place()
    trip.run(0.1 * (most_alike - 1), freeze := frozen("range"))
    assert not trip.localizer.rejections
    trip.run(0.1, freeze)
    assert trip.localizer.rejections == {(Sensor.RANGE, Rejection.FROZEN): 1}
