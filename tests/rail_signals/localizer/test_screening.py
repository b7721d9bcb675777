"""Which readings are evidence: each reason at both sides, alone and through the localizer."""

from __future__ import annotations

from math import inf, isfinite, nan, nextafter
from typing import Any

import numpy as np
import pytest

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Localization
from rail_signals.localizer.readings import (
    BlockEntry,
    DopplerFix,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)
from rail_signals.localizer.screening import MOST_M, MOST_MPS, SAME_TIME_S, ReadingScreen, Rejection
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, Sensor

SETTINGS = LocalizerSettings()
OLDEST_S = SETTINGS.claim.oldest_s
MOST_ALIKE = SETTINGS.claim.most_alike
NOW_S = 100.0
GOOD: dict[str, Any] = {
    "range": RangeFix(1000.0, 0.04, 0.0),
    "doppler": DopplerFix(1000.0, 20.0, 4.0, 0.1, 1.0, 0.0),
    "block": BlockEntry(1000.0, 0.0),
    "odometer": WheelSpeed(20.0, 0.0),
}
SENSOR_OF = dict(zip(GOOD, Sensor, strict=True))
#: Sensor, field, a value on the wrong side, one on the right side, and the reason.
LIMITS = [
    ("range", "chainage_m", nan, 0.0, Rejection.NOT_FINITE),
    ("range", "chainage_m", -inf, -5.0, Rejection.NOT_FINITE),
    ("range", "variance_m2", inf, 1e4, Rejection.NOT_FINITE),
    ("range", "variance_m2", nan, 0.04, Rejection.NOT_FINITE),
    ("range", "age_s", nan, 0.0, Rejection.NOT_FINITE),
    ("range", "station", nan, 3.0, Rejection.NOT_FINITE),
    ("range", "chainage_m", 1.001 * MOST_M, 0.999 * MOST_M, Rejection.IMPLAUSIBLE),
    ("range", "chainage_m", -1.001 * MOST_M, -0.999 * MOST_M, Rejection.IMPLAUSIBLE),
    ("range", "variance_m2", 1.001 * MOST_M**2, 0.999 * MOST_M**2, Rejection.IMPLAUSIBLE),
    ("range", "variance_m2", -0.04, 0.04, Rejection.BAD_VARIANCE),
    ("range", "variance_m2", 0.0, 1e-12, Rejection.BAD_VARIANCE),
    ("range", "age_s", -2.0 * SAME_TIME_S, -0.5 * SAME_TIME_S, Rejection.FUTURE),
    ("range", "age_s", nextafter(OLDEST_S, inf), OLDEST_S, Rejection.TOO_OLD),
    ("doppler", "chainage_m", nan, 0.0, Rejection.NOT_FINITE),
    ("doppler", "speed_mps", nan, 0.0, Rejection.NOT_FINITE),
    ("doppler", "speed_mps", -1.001 * MOST_MPS, -0.999 * MOST_MPS, Rejection.IMPLAUSIBLE),
    ("doppler", "covariance_m2ps", nan, 0.0, Rejection.NOT_FINITE),
    # Of 4 m^2 and 1 m^2/s^2: the correlation is 1 at 2 m^2/s.
    ("doppler", "covariance_m2ps", 2.0, 1.999, Rejection.BAD_VARIANCE),
    ("doppler", "covariance_m2ps", -2.0, -1.999, Rejection.BAD_VARIANCE),
    ("doppler", "speed_variance_m2ps2", 0.0, 0.01, Rejection.BAD_VARIANCE),
    ("doppler", "variance_m2", -4.0, 4.0, Rejection.BAD_VARIANCE),
    ("doppler", "age_s", 1.01 * OLDEST_S, OLDEST_S, Rejection.TOO_OLD),
    ("block", "joint_m", inf, 0.0, Rejection.NOT_FINITE),
    ("block", "joint_m", 1.001 * MOST_M, 0.999 * MOST_M, Rejection.IMPLAUSIBLE),
    ("block", "age_s", 1.01 * OLDEST_S, OLDEST_S, Rejection.TOO_OLD),
    ("odometer", "speed_mps", nan, 0.0, Rejection.NOT_FINITE),
    ("odometer", "speed_mps", inf, 30.0, Rejection.NOT_FINITE),
    ("odometer", "speed_mps", 1.001 * MOST_MPS, 0.999 * MOST_MPS, Rejection.IMPLAUSIBLE),
    ("odometer", "age_s", 3600.0, OLDEST_S, Rejection.TOO_OLD),
]


def screened(name: str, reading: Any, screen: ReadingScreen | None = None) -> Any:
    """Return what a screen leaves of one reading."""
    screen = ReadingScreen(OLDEST_S, MOST_ALIKE) if screen is None else screen
    return getattr(screen.screen(NOW_S, TickMeasurements(**{name: reading})), name)


def located(localizer: Localizer, time_s: float, **readings: Any) -> Localization:
    """Return what a localizer says of a tick."""
    return Localization.of(localizer.tick(time_s, TickMeasurements(**readings)))


def running() -> Localizer:
    """Return a localizer that knows where it is at `NOW_S`."""
    localizer = Localizer(SETTINGS)
    localizer.place(998.0, 5.0, speed_mps=20.0)
    located(localizer, NOW_S - 0.1)
    return localizer


@pytest.mark.parametrize(("name", "field", "wrong", "right", "why"), LIMITS)
def test_each_limit_has_two_sides(
    name: str, field: str, wrong: float, right: float, why: Rejection
) -> None:
    screen = ReadingScreen(OLDEST_S, MOST_ALIKE)
    bad, good = (GOOD[name]._replace(**{field: value}) for value in (wrong, right))
    assert screened(name, bad, screen) is None
    assert screen.rejected == [(SENSOR_OF[name], why, True)]
    assert screen.counts == {(SENSOR_OF[name], why): 1}
    # What was rejected leaves no trace: the next reading is judged as if it were the first.
    assert screened(name, good, screen) is good
    assert screen.rejected == []


@pytest.mark.parametrize(("name", "field", "wrong", "right", "why"), LIMITS)
def test_to_the_localizer_it_is_as_if_there_were_no_reading(
    name: str, field: str, wrong: float, right: float, why: Rejection
) -> None:
    localizer, untouched = running(), running()
    here = located(localizer, NOW_S, **{name: GOOD[name]._replace(**{field: wrong})})
    assert here == located(untouched, NOW_S)
    assert isfinite(here.low_m) and isfinite(here.high_m)
    assert localizer.rejections == {(SENSOR_OF[name], why): 1}


def test_variances_that_are_both_negative_are_not_positive_for_their_product() -> None:
    screen = ReadingScreen(OLDEST_S, MOST_ALIKE)
    fix = GOOD["doppler"]._replace(variance_m2=-4.0, speed_variance_m2ps2=-1.0)
    assert screened("doppler", fix, screen) is None
    assert screen.counts == {(Sensor.DOPPLER, Rejection.BAD_VARIANCE): 1}


@pytest.mark.parametrize("name", GOOD)
def test_a_good_reading_is_used(name: str) -> None:
    localizer, untouched = running(), running()
    assert located(localizer, NOW_S, **{name: GOOD[name]}) != located(untouched, NOW_S)
    assert not localizer.rejections


@pytest.mark.parametrize("name", GOOD)
def test_time_stamps_only_go_forwards(name: str) -> None:
    screen = ReadingScreen(10.0, MOST_ALIKE)
    used = []
    for tick, stamp_s in enumerate([0.0, 0.2, 0.1, 0.2, 0.2 + 3e-6, 0.2 + 3e-6]):
        time_s = 0.5 + 0.5 * tick
        reading = GOOD[name]._replace(age_s=time_s - stamp_s)
        used.append(getattr(screen.screen(time_s, TickMeasurements(**{name: reading})), name))
    assert [reading is not None for reading in used] == [True, True, False, False, True, False]
    sensor = SENSOR_OF[name]
    assert screen.counts == {(sensor, Rejection.BACKWARDS): 1, (sensor, Rejection.REPEATED): 2}


def run_of(name: str, readings: list[Any]) -> tuple[list[bool], ReadingScreen]:
    """Return which of the readings of consecutive ticks are evidence."""
    screen = ReadingScreen(OLDEST_S, MOST_ALIKE)
    return [
        getattr(screen.screen(0.1 * tick, TickMeasurements(**{name: reading})), name) is not None
        for tick, reading in enumerate(readings)
    ], screen


@pytest.mark.parametrize("name", ["range", "doppler"])
def test_the_same_values_so_many_times_in_a_row_are_a_frozen_sensor(name: str) -> None:
    other = GOOD[name]._replace(chainage_m=1000.01)
    alike = [GOOD[name]] * (MOST_ALIKE - 1)
    # One less than that is chance, and any other value shows that it measures.
    used, screen = run_of(name, [*alike, other, *alike, other])
    assert all(used) and not screen.counts
    used, screen = run_of(name, [*alike, *[GOOD[name]] * 20, other, GOOD[name]])
    assert used == [True] * (MOST_ALIKE - 1) + [False] * 20 + [True, True]
    assert screen.counts == {(SENSOR_OF[name], Rejection.FROZEN): 20}


def test_a_frozen_chainage_is_frozen_whatever_variance_is_stated_with_it() -> None:
    readings = [RangeFix(1000.0, 0.04 + 0.001 * tick, 0.0) for tick in range(20)]
    assert run_of("range", readings)[0] == [True] * (MOST_ALIKE - 1) + [False] * 16


def test_a_frozen_sensor_that_drops_out_is_frozen_still() -> None:
    nothing = GOOD["range"]._replace(chainage_m=nan)
    readings = [GOOD["range"]] * 10 + [nothing] * 3 + [GOOD["range"]] * 3
    assert run_of("range", readings)[0] == [True] * (MOST_ALIKE - 1) + [False] * 12


@pytest.mark.parametrize("name", ["block", "odometer"])
def test_wheels_and_joints_may_repeat_themselves(name: str) -> None:
    used, screen = run_of(name, [GOOD[name]] * 50)
    assert all(used) and not screen.counts


def test_noise_drawn_anew_is_never_frozen_though_it_is_sent_in_centimetres() -> None:
    """Four repetitions in a row have a probability of (q / (2 sigma sqrt(pi)))^4, once in 1.6e6."""
    rng = np.random.default_rng(4)
    count, sigma_m, step_m = 36_000, SETTINGS.ranging.least_sigma_m, 0.01
    chainages_m = step_m * np.round((1000.0 + sigma_m * rng.standard_normal(count)) / step_m)
    _, screen = run_of("range", [RangeFix(x, 0.04, 0.0) for x in chainages_m.tolist()])
    assert not screen.counts
    repeated = np.mean(chainages_m[1:] == chainages_m[:-1])
    assert repeated == pytest.approx(step_m / (2.0 * sigma_m * np.sqrt(np.pi)), rel=0.1)


def test_many_runs_are_screened_as_one_by_one() -> None:
    """Whatever is wrong in some of the runs; what is left out is finite, as filters need it."""
    rng, runs, ticks = np.random.default_rng(8), 40, 60
    together = ReadingScreen(OLDEST_S, MOST_ALIKE)
    alone = [ReadingScreen(OLDEST_S, MOST_ALIKE) for _ in range(runs)]
    for tick in range(ticks):
        time_s = 0.1 * tick
        fields = {
            name: {
                field: np.full((runs, 1), value) * rng.choice([1.0, 1.0, 1.0, 0.999], (runs, 1))
                for field, value in reading._asdict().items()
                if field != "present"
            }
            for name, reading in GOOD.items()
        }
        for values in fields.values():
            for column in values.values():
                odd = rng.uniform(size=(runs, 1)) < 0.03
                column[odd] = rng.choice([nan, inf, -inf, -1.0, 0.0, 1e300], int(odd.sum()))
            values["age_s"] += rng.choice([0.0, 0.0, 0.1, 2.0], (runs, 1))
        present = rng.uniform(size=(runs, 1)) < 0.9
        readings = {
            name: type(GOOD[name])(**values, present=present) for name, values in fields.items()
        }
        left = together.screen(time_s, TickMeasurements(**readings))
        for run, screen in enumerate(alone):
            single = {
                name: type(GOOD[name])(**{key: float(v[run, 0]) for key, v in values.items()})
                for name, values in fields.items()
            }
            one = screen.screen(
                time_s, TickMeasurements(**single) if present[run, 0] else TickMeasurements()
            )
            for name in GOOD:
                kept = getattr(left, name)
                assert bool(kept.present[run, 0]) == (getattr(one, name) is not None)
        for reading in left:
            columns = reading._asdict()
            assert not (columns.pop("present") & ~present).any()
            assert all(np.isfinite(column[present]).all() for column in columns.values())
    totals = sum((screen.counts for screen in alone), start=together.counts.__class__())
    assert together.counts == totals
    assert {why for _, why in together.counts} == set(Rejection)


@pytest.mark.parametrize("most_alike", [1, 0, -3])
def test_a_single_reading_is_not_frozen(most_alike: int) -> None:
    with pytest.raises(ValueError, match="most_alike"):
        IntegrityClaim(most_alike=most_alike)
