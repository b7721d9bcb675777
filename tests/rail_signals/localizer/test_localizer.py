"""The localizer of one train: what it claims, what it ignores, and faults one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf, isnan, nan

import numpy as np
import pytest

from rail_signals.localizer.localizer import (
    BlockEntry,
    DopplerFix,
    Ignored,
    Localization,
    Localizer,
    RangeFix,
    WheelSpeed,
)
from rail_signals.localizer.protection_level import Reason, Status
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, OdometerModel, Sensor

DEFAULT = LocalizerSettings()
TICK_S = 0.1


@dataclass
class Trip:
    """A train at a constant speed, its sensors and its localizer."""

    settings: LocalizerSettings = DEFAULT
    speed_mps: float = 20.0
    sensors: frozenset[Sensor] = frozenset(Sensor)
    seed: int = 1
    tick_s: float = TICK_S
    tick: int = 0
    way_m: float = 1000.0
    history: list[Localization] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)
        self.localizer = Localizer(self.settings)

    @property
    def chainage_m(self) -> float:
        return self.settings.direction * self.way_m

    @property
    def velocity_mps(self) -> float:
        return self.settings.direction * self.speed_mps

    def place(self) -> Trip:
        self.localizer.place(self.chainage_m, 1.0, speed_mps=self.velocity_mps, sigma_mps=0.1)
        return self

    def run(self, seconds: float, falsify: Callable[[dict], None] | None = None) -> Localization:
        """Let time pass; `falsify` may change what the sensors tell."""
        for _ in range(round(seconds / self.tick_s)):
            before_m = self.way_m
            self.tick += 1
            self.way_m += self.speed_mps * self.tick_s
            now_s = self.tick * self.tick_s
            noise = [float(n) for n in self.rng.standard_normal(4)]
            s, v = self.chainage_m, self.velocity_mps
            told: dict = {}
            if Sensor.RANGE in self.sensors:
                told["ranging"] = RangeFix(now_s, s + 0.2 * noise[0], 0.04)
            if Sensor.DOPPLER in self.sensors and self.speed_mps > 0.0:
                told["doppler"] = DopplerFix(
                    now_s, s + 2.0 * noise[1], v + 0.2 * noise[2], 4.0, 0.0, 0.04
                )
            if Sensor.ODOMETER in self.sensors:
                wheel_mps = 1.005 * self.speed_mps + 0.03 * noise[3] * (self.speed_mps > 0.0)
                told["wheels"] = WheelSpeed(now_s, wheel_mps)
            joint = np.floor(self.way_m / 500.0)
            if Sensor.BLOCK in self.sensors and joint > np.floor(before_m / 500.0):
                joint_m = self.settings.direction * 500.0 * joint
                told["block"] = BlockEntry(now_s, joint_m)
            if falsify is not None:
                falsify(told)
            self.history.append(self.localizer.tick(now_s, **told))
        return self.history[-1]

    def holds(self, here: Localization) -> bool:
        return here.low_m <= self.chainage_m <= here.high_m


def shifted(sensor: str, by: Callable[[], float] | float) -> Callable[[dict], None]:
    """Return what moves the chainage that a sensor tells."""
    key = "joint_m" if sensor == "block" else "chainage_m"

    def falsify(told: dict) -> None:
        if sensor in told:
            amount = by() if callable(by) else by
            told[sensor] = replace(told[sensor], **{key: getattr(told[sensor], key) + amount})

    return falsify


def test_before_the_first_fix_there_is_no_position() -> None:
    trip = Trip(sensors=frozenset({Sensor.ODOMETER}))
    here = trip.run(5.0)
    assert (here.status, here.reason) == (Status.UNAVAILABLE, Reason.NO_FIX)
    assert isnan(here.position_m)
    assert isnan(here.speed_mps)
    assert (here.low_m, here.high_m, here.protection_m) == (-inf, inf, inf)


def test_with_one_position_sensor_the_claim_says_what_it_does_not_survive() -> None:
    trip = Trip(sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER}))
    here = trip.run(10.0)
    assert (here.status, here.reason) == (Status.UNMONITORED, Reason.TOO_FEW_SENSORS)
    assert here.uncovered == {Sensor.RANGE}
    assert here.protection_m < 3.0
    assert trip.holds(here)


@pytest.mark.parametrize("direction", [1, -1])
def test_with_all_sensors_it_is_protected(direction: int) -> None:
    trip = Trip(replace(DEFAULT, direction=direction)).place()
    here = trip.run(30.0)
    assert (here.status, here.reason) == (Status.PROTECTED, Reason.NONE)
    assert not here.found
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.5)
    assert here.speed_mps == pytest.approx(trip.velocity_mps, abs=0.5)
    assert here.speed_low_mps < trip.velocity_mps < here.speed_high_mps
    assert all(h.status is Status.PROTECTED for h in trip.history)
    # Wide enough for the second-best sensor, and for nothing worse.
    assert 3.0 < here.protection_m < 20.0


def test_towards_smaller_chainages_everything_is_mirrored() -> None:
    there, back = (Trip(replace(DEFAULT, direction=d)).place() for d in (1, -1))

    # Noise adds to chainages, so it is turned round as well.
    def turn(told: dict) -> None:
        s, v = back.chainage_m, back.velocity_mps
        if fix := told.get("ranging"):
            told["ranging"] = replace(fix, chainage_m=2.0 * s - fix.chainage_m)
        if fix := told.get("doppler"):
            told["doppler"] = replace(
                fix, chainage_m=2.0 * s - fix.chainage_m, speed_mps=2.0 * v - fix.speed_mps
            )

    one, other = there.run(15.0), back.run(15.0, turn)
    assert other.position_m == pytest.approx(-one.position_m, abs=1e-9)
    assert (other.low_m, other.high_m) == pytest.approx((-one.high_m, -one.low_m), abs=1e-9)


def test_by_wheels_alone_the_interval_grows_with_the_way_until_it_is_too_wide() -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(unmonitored_s=inf))
    trip = Trip(settings, sensors=frozenset({Sensor.ODOMETER}), tick_s=0.5).place()
    widths = []
    for _ in range(4):
        here = trip.run(20.0)
        assert (here.status, here.uncovered) == (Status.UNMONITORED, {Sensor.ODOMETER})
        assert trip.holds(here)
        widths.append(here.protection_m)
    # K sigma of the scale over 400 m each time, and the scale told by the speed it was placed with.
    steps = np.diff(widths)
    assert (steps > 0.0).all()
    assert steps[-1] == pytest.approx(settings.claim.sigmas * 0.005 * 400.0, rel=0.5)
    trip.speed_mps = 80.0
    trip.run(100.0)
    assert Reason.TOO_WIDE in {h.reason for h in trip.history}
    assert trip.history[-1].status is Status.UNAVAILABLE


def test_an_unmonitored_position_is_given_for_a_stated_time() -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(unmonitored_s=30.0))
    trip = Trip(settings, sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER}))
    assert trip.run(29.0).status is Status.UNMONITORED
    assert trip.run(2.0).reason is Reason.UNMONITORED_TOO_LONG
    trip.sensors = frozenset(Sensor)
    assert trip.run(30.0).status is Status.PROTECTED


def test_a_train_may_stand_for_an_hour() -> None:
    trip = Trip(speed_mps=0.0, tick_s=5.0).place()
    start = trip.run(60.0)
    here = trip.run(3540.0)
    assert here.status is Status.PROTECTED
    assert not any(h.found for h in trip.history)
    assert all(h.low_m <= 1000.0 <= h.high_m for h in trip.history)
    # Thousands of ranges with the same bias are worth one, and wheels that stand hardly drift.
    assert here.sigma_m == pytest.approx(DEFAULT.ranging.bias_m, rel=0.25)
    # Without the range there are only wheels, whose noise adds up: it is wide, and is given still.
    assert start.protection_m < here.protection_m < DEFAULT.claim.widest_m


def test_a_late_range_is_brought_to_now() -> None:
    trip = Trip(speed_mps=30.0).place()

    def late(told: dict) -> None:
        fix = told["ranging"]
        then_m = fix.chainage_m - 0.3 * trip.velocity_mps
        told["ranging"] = replace(fix, stamp_s=fix.stamp_s - 0.3, chainage_m=then_m)

    here = trip.run(20.0, late)
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.0)
    assert not any(h.found for h in trip.history)


def test_slipping_wheels_are_believed_less_and_no_fault() -> None:
    trip = Trip(speed_mps=25.0).place()
    trip.run(20.0)
    spin = iter([*np.linspace(0.0, 5.0, 8), *[5.0] * 25, *np.linspace(5.0, 0.0, 8)])

    def slip(told: dict) -> None:
        wheels = told["wheels"]
        told["wheels"] = replace(wheels, speed_mps=wheels.speed_mps + float(next(spin)))

    trip.run(4.1, slip)
    assert not any(h.found for h in trip.history)
    here = trip.run(20.0)
    assert trip.holds(here)
    assert not here.found
    assert here.speed_mps == pytest.approx(25.0, abs=0.5)


FAULTS = {
    "range jumps": (Sensor.RANGE, shifted("ranging", 30.0), 0.5),
    "range from the wrong station": (Sensor.RANGE, shifted("ranging", -1500.0), 0.5),
    "doppler jumps": (Sensor.DOPPLER, shifted("doppler", 60.0), 1.0),
    "wrong joint": (Sensor.BLOCK, shifted("block", 500.0), 26.0),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_sudden_fault_is_found_and_its_sensor_excluded(name: str) -> None:
    sensor, falsify, within_s = FAULTS[name]
    trip = Trip().place()
    assert not trip.run(20.0).found
    here = trip.run(within_s, falsify)
    assert here.found
    assert here.excluded == {sensor}
    here = trip.run(10.0, falsify)
    assert here.status is Status.PROTECTED
    assert trip.holds(here)


def test_a_frozen_range_is_found_when_the_train_moves() -> None:
    trip = Trip(speed_mps=0.0).place()
    trip.run(20.0)

    def freeze(told: dict) -> None:
        told["ranging"] = replace(
            told["ranging"], chainage_m=1000.0 + 0.2 * float(trip.rng.standard_normal())
        )

    assert not trip.run(20.0, freeze).found
    for speed_mps in np.linspace(0.0, 10.0, 100):
        trip.speed_mps = float(speed_mps)
        assert trip.holds(trip.run(TICK_S, freeze))
    here = trip.run(5.0, freeze)
    assert here.excluded == {Sensor.RANGE}
    assert trip.holds(here)


def test_a_range_that_creeps_away_is_found_by_comparison() -> None:
    """No innovation is ever large: the gates do not see it."""
    trip = Trip().place()
    before_m = trip.run(20.0).protection_m
    off = iter(np.arange(0.0, 200.0, 0.05))
    falsify = shifted("ranging", lambda: float(next(off)))
    found_m = nan
    while not trip.history[-1].excluded:
        here = trip.run(TICK_S, falsify)
        assert here.status is Status.UNAVAILABLE or trip.holds(here)
        if here.found and isnan(found_m):
            found_m = 0.05 * (trip.tick - 200)
    assert trip.history[-1].excluded == {Sensor.RANGE}
    # Found before the error became as large as the protection level had been.
    assert found_m < before_m


def test_a_worn_wheel_is_estimated_and_a_wrong_one_is_found() -> None:
    trip = Trip().place()
    trip.run(20.0)
    wheels = {"factor": 1.0}

    def scaled(told: dict) -> None:
        wheels["factor"] = min(wheels["factor"] + 1e-3, goal)
        told["wheels"] = replace(
            told["wheels"], speed_mps=told["wheels"].speed_mps * wheels["factor"]
        )

    goal = 1.02
    assert not trip.run(20.0, scaled).found
    goal = 1.25
    here = trip.run(60.0, scaled)
    assert here.excluded == {Sensor.ODOMETER}
    assert all(h.excluded <= {Sensor.ODOMETER} for h in trip.history)
    assert trip.holds(here)


def test_with_two_sensors_a_fault_is_found_but_not_whose() -> None:
    trip = Trip(sensors=frozenset({Sensor.RANGE, Sensor.ODOMETER})).place()
    trip.run(20.0)
    off = iter(np.arange(0.0, 2000.0, 0.2))
    here = trip.run(10.0, shifted("ranging", lambda: float(next(off))))
    assert here.found
    assert not here.excluded
    # Either may be wrong, and the interval holds what each of them tells.
    assert here.protection_m > 5.0
    assert trip.holds(here)
    # A block decides it.
    trip.sensors |= {Sensor.BLOCK}
    here = trip.run(25.0, shifted("ranging", lambda: float(next(off))))
    assert here.excluded == {Sensor.RANGE}
    assert trip.holds(here)


def test_two_faulty_sensors_make_it_unavailable_and_it_begins_anew() -> None:
    settings = replace(DEFAULT, claim=IntegrityClaim(restart_s=15.0))
    trip = Trip(settings).place()
    trip.run(20.0)

    def both(told: dict) -> None:
        shifted("ranging", 150.0)(told)
        shifted("doppler", -300.0)(told)
        shifted("block", 90.0)(told)

    trip.run(30.0, both)
    reasons = [h.reason for h in trip.history[200:]]
    assert Reason.CONTRADICTION in reasons
    assert trip.history[-1].status is not Status.PROTECTED
    here = trip.run(60.0)
    assert here.status is not Status.UNAVAILABLE
    assert trip.holds(here)


def test_an_excluded_sensor_returns_after_it_has_agreed_for_a_time() -> None:
    trip = Trip().place()
    trip.run(20.0)
    assert trip.run(5.0, shifted("ranging", 40.0)).excluded == {Sensor.RANGE}
    return_s = DEFAULT.claim.return_s
    assert trip.run(return_s - 1.0).excluded == {Sensor.RANGE}
    here = trip.run(10.0)
    assert not here.excluded
    assert here.status is Status.PROTECTED
    assert here.sigma_m < 0.5
    assert trip.holds(here)


def test_a_single_outlier_is_left_out_and_no_more() -> None:
    trip = Trip().place()
    trip.run(30.0)
    before = trip.history[-1]
    here = trip.run(0.2, shifted("ranging", 400.0))
    assert not here.found
    here = trip.run(1.0)
    assert not here.found
    assert here.position_m == pytest.approx(trip.chainage_m, abs=1.5)
    assert here.protection_m == pytest.approx(before.protection_m, abs=5.0)


NOW_S = 100.0
GOOD = {
    "ranging": RangeFix(NOW_S, 1000.0, 0.04),
    "doppler": DopplerFix(NOW_S, 1000.0, 20.0, 4.0, 0.1, 0.04),
    "block": BlockEntry(NOW_S, 1000.0),
    "wheels": WheelSpeed(NOW_S, 20.0),
}
BAD = [
    ("ranging", {"chainage_m": nan}, Ignored.NOT_FINITE),
    ("ranging", {"chainage_m": -inf}, Ignored.NOT_FINITE),
    ("ranging", {"variance_m2": inf}, Ignored.NOT_FINITE),
    ("ranging", {"variance_m2": -0.04}, Ignored.BAD_VARIANCE),
    ("ranging", {"variance_m2": 0.0}, Ignored.BAD_VARIANCE),
    ("ranging", {"chainage_m": 1e300}, Ignored.IMPLAUSIBLE),
    ("ranging", {"stamp_s": NOW_S + 0.1}, Ignored.FUTURE),
    ("ranging", {"stamp_s": NOW_S - 1.5}, Ignored.TOO_OLD),
    ("ranging", {"stamp_s": nan}, Ignored.NOT_FINITE),
    ("doppler", {"speed_mps": nan}, Ignored.NOT_FINITE),
    ("doppler", {"speed_mps": 1e9}, Ignored.IMPLAUSIBLE),
    ("doppler", {"covariance_m2ps": 0.5}, Ignored.BAD_VARIANCE),
    ("doppler", {"covariance_m2ps": nan}, Ignored.NOT_FINITE),
    ("doppler", {"speed_variance_m2ps2": 0.0}, Ignored.BAD_VARIANCE),
    ("block", {"joint_m": inf}, Ignored.NOT_FINITE),
    ("block", {"stamp_s": -inf}, Ignored.NOT_FINITE),
    ("wheels", {"speed_mps": inf}, Ignored.NOT_FINITE),
    ("wheels", {"stamp_s": NOW_S - 3600.0}, Ignored.TOO_OLD),
]
SENSOR_OF = dict(zip(GOOD, Sensor, strict=True))


@pytest.mark.parametrize(("name", "changes", "why"), BAD)
def test_what_cannot_be_used_is_ignored_and_counted(
    name: str, changes: dict[str, float], why: Ignored
) -> None:
    localizer, untouched = Localizer(DEFAULT), Localizer(DEFAULT)
    for one in (localizer, untouched):
        one.place(998.0, 5.0, speed_mps=20.0)
        one.tick(NOW_S - 0.1)
    told = {name: replace(GOOD[name], **changes)}
    assert localizer.tick(NOW_S, **told) == untouched.tick(NOW_S)
    assert localizer.ignored == {(SENSOR_OF[name], why): 1}


@pytest.mark.parametrize("name", GOOD)
def test_the_good_ones_among_them_are_used(name: str) -> None:
    localizer, untouched = Localizer(DEFAULT), Localizer(DEFAULT)
    for one in (localizer, untouched):
        one.place(998.0, 5.0, speed_mps=20.0)
        one.tick(NOW_S - 0.1)
    assert localizer.tick(NOW_S, **{name: GOOD[name]}) != untouched.tick(NOW_S)
    assert not localizer.ignored


def test_stamps_that_go_back_and_readings_told_twice_are_ignored() -> None:
    localizer = Localizer(DEFAULT)
    localizer.tick(10.0, ranging=RangeFix(10.0, 500.0, 0.04), block=BlockEntry(9.9, 500.0))
    localizer.tick(10.1, ranging=RangeFix(9.9, 501.0, 0.04), block=BlockEntry(9.9, 500.0))
    localizer.tick(10.2, ranging=RangeFix(10.2, 500.0, 0.04), wheels=WheelSpeed(10.2, 0.0))
    localizer.tick(10.3, wheels=WheelSpeed(10.3, 0.0))
    assert localizer.ignored == {
        (Sensor.RANGE, Ignored.BACKWARDS): 1,
        (Sensor.BLOCK, Ignored.REPEATED): 1,
        (Sensor.RANGE, Ignored.REPEATED): 1,
    }


@pytest.mark.parametrize("time_s", [5.0, 4.9, nan, inf])
def test_time_goes_forwards(time_s: float) -> None:
    localizer = Localizer(DEFAULT)
    localizer.tick(5.0)
    with pytest.raises(ValueError, match="time_s"):
        localizer.tick(time_s)


def test_after_a_long_silence_there_is_no_position() -> None:
    trip = Trip().place()
    trip.run(30.0)
    here = trip.localizer.tick(trip.tick * TICK_S + 3600.0)
    assert here.status is Status.UNAVAILABLE
    trip.tick += 36000
    here = trip.run(30.0)
    assert here.status is not Status.UNAVAILABLE
    assert trip.holds(here)


def test_the_same_readings_give_the_same_bits() -> None:
    one, other = Trip().place(), Trip().place()
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
