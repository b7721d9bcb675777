"""Every threshold that decides what is claimed, at each side of it; the normal law as oracle."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from rail_signals.localizer.filter_bank import (
    DOPPLER_BIAS,
    FILTERS,
    LOST_M,
    RANGE_BIAS,
    SCALE,
    FilterBank,
    S,
    UpdateResult,
    V,
)
from rail_signals.localizer.integrity_monitor import HYPOTHESES, IntegrityMonitor
from rail_signals.localizer.protection_level import (
    Estimate,
    ProtectionLevels,
    ProtectionReason,
    Status,
)
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, Sensor

SETTINGS = LocalizerSettings()
CLAIM = SETTINGS.claim
ALL = np.ones(len(FILTERS), dtype=np.bool_)
#: Ticks of 0.1 s in an hour, in which there may be a thousandth of a false alarm.
ALARMS_PER_TICK = 1e-3 / 36_000.0
#: Separations of s and v from four filters, five readings, estimates of k, b and d.
TESTS = 2 * 4 + 5 + 3
SIGMAS_OF_A_TEST = float(norm.isf(0.5 * ALARMS_PER_TICK / TESTS))
SIGMAS_OF_THE_GATE = float(norm.isf(0.5 * ALARMS_PER_TICK))
SIGMAS_OF_THE_LEVEL = float(norm.isf(0.5 * 1e-5))
NEAR, FAR = 0.999, 1.001
GIVEN = pytest.mark.parametrize(
    ("factor", "status"), [(NEAR, Status.PROTECTED), (FAR, Status.UNAVAILABLE)]
)
SIDES = pytest.mark.parametrize(("factor", "found"), [(NEAR, False), (FAR, True)])


def bank_of(sigma_m: float = 1.0, *, fewer_m: float | None = None) -> FilterBank:
    """Return a bank that stands at 0; `fewer_m` is the sigma of filters without two sensors."""
    bank = FilterBank(SETTINGS)
    bank.place(np.array(True), 0.0, sigma_m, 0.0, 0.1)
    if fewer_m is not None:
        bank.variances[S, HYPOTHESES:] = fewer_m**2
    bank.lose()
    return bank


def estimate_of(bank: FilterBank, monitor: IntegrityMonitor | None = None) -> Estimate:
    monitor = IntegrityMonitor(CLAIM) if monitor is None else monitor
    monitor.test(bank, 0.1)
    return ProtectionLevels(CLAIM).estimate(bank, monitor, 0.1)


def test_the_thresholds_are_those_of_the_normal_law() -> None:
    assert CLAIM.sigmas == pytest.approx(SIGMAS_OF_THE_LEVEL)
    assert CLAIM.threshold(1) == pytest.approx(SIGMAS_OF_THE_GATE)
    assert CLAIM.threshold(TESTS) == pytest.approx(SIGMAS_OF_A_TEST)
    assert pytest.approx(6.0, abs=0.05) == SIGMAS_OF_A_TEST


@pytest.mark.parametrize("sigma_m", [0.3, 1.0, 30.0])
def test_the_level_is_so_many_sigmas_no_more_and_no_less(sigma_m: float) -> None:
    """The two ways to it, everything well and something lost, agree."""
    here = estimate_of(bank_of(sigma_m))
    assert here.protection_m == pytest.approx(SIGMAS_OF_THE_LEVEL * sigma_m)
    assert here.speed_high_mps == pytest.approx(SIGMAS_OF_THE_LEVEL * 0.1)
    assert here.speed_low_mps == pytest.approx(-SIGMAS_OF_THE_LEVEL * 0.1)
    bank = bank_of(sigma_m)
    bank.known[1 + Sensor.BLOCK] = False
    there = estimate_of(bank)
    assert there.status == Status.UNMONITORED
    assert there.protection_m == pytest.approx(SIGMAS_OF_THE_LEVEL * sigma_m)
    assert there.speed_high_mps == pytest.approx(SIGMAS_OF_THE_LEVEL * 0.1)


@SIDES
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_gate_of_a_reading(sign: float, factor: float, found: bool) -> None:
    bank, noise_m = bank_of(3.0), 4.0
    reading_m = sign * factor * SIGMAS_OF_THE_GATE * 5.0
    outcome = bank.take([(S, None)], reading_m, noise_m**2, ALL)
    assert (outcome.refused is not None) is found
    assert bank.x[S, 0] == pytest.approx(0.0 if found else reading_m * 9.0 / 25.0)


@SIDES
@pytest.mark.parametrize(("state", "sigma"), [(S, 2.0), (V, 0.5)])
def test_separations_of_position_and_of_speed(
    state: int, sigma: float, factor: float, found: bool
) -> None:
    bank = bank_of(1.0)
    bank.variances[V] = 0.3**2
    without_range = [Sensor.RANGE in left_out for left_out in FILTERS]
    gained = np.sqrt(sigma**2 - bank.variances[state, 0])
    bank.variances[state, without_range] = sigma**2
    bank.x[state, without_range] = factor * SIGMAS_OF_A_TEST * gained
    assert bool(estimate_of(bank).detected) is found


@SIDES
@pytest.mark.parametrize(("state", "least"), [(S, 0.05), (V, 0.02)])
def test_filters_that_know_the_same_may_differ_by_this(
    state: int, least: float, factor: float, found: bool
) -> None:
    bank = bank_of(1.0)
    bank.x[state, 1 + Sensor.DOPPLER] = factor * SIGMAS_OF_A_TEST * least
    assert bool(estimate_of(bank).detected) is found


@SIDES
@pytest.mark.parametrize(
    ("state", "sigma"),
    [
        (SCALE, SETTINGS.odometer.scale),
        (RANGE_BIAS, SETTINGS.ranging.bias_m),
        (DOPPLER_BIAS, SETTINGS.doppler.correlated),
    ],
)
def test_estimates_of_scale_and_biases(
    state: int, sigma: float, factor: float, found: bool
) -> None:
    bank = bank_of(1.0)
    bank.x[state] = -factor * SIGMAS_OF_A_TEST * sigma
    assert bool(estimate_of(bank).detected) is found


@pytest.mark.parametrize(
    ("factor", "status"), [(NEAR, Status.PROTECTED), (FAR, Status.UNAVAILABLE)]
)
def test_the_widest_level_that_is_given(factor: float, status: Status) -> None:
    bank = bank_of(factor * CLAIM.widest_m / SIGMAS_OF_THE_LEVEL, fewer_m=60.0)
    here = estimate_of(bank)
    assert here.status == status
    if status is Status.UNAVAILABLE:
        assert here.reason == ProtectionReason.TOO_WIDE


@pytest.mark.parametrize(
    ("factor", "status"), [(NEAR, Status.PROTECTED), (FAR, Status.UNMONITORED)]
)
def test_the_widest_hull_of_intervals_that_are_each_narrow_enough(
    factor: float, status: Status
) -> None:
    """Beyond it the position is that of all sensors, and says whose fault it does not survive."""
    sigma_m = 35.0
    bank = bank_of(10.0, fewer_m=40.0)
    bank.variances[S, 1 + Sensor.RANGE] = sigma_m**2
    bank.x[S, 1 + Sensor.RANGE] = factor * CLAIM.widest_m - sigma_m * SIGMAS_OF_THE_LEVEL
    here = estimate_of(bank)
    assert not here.detected
    assert here.status == status
    assert here.uncovered[Sensor.RANGE] == (status is Status.UNMONITORED)
    if status is Status.UNMONITORED:
        assert here.protection_m <= 40.0 * SIGMAS_OF_THE_LEVEL


@pytest.mark.parametrize("factor", [NEAR, FAR])
def test_a_filter_is_lost_at_a_kilometre(factor: float) -> None:
    bank = bank_of()
    bank.variances[S, 3] = (factor * LOST_M) ** 2
    bank.lose()
    assert bool(bank.known[3]) is (factor < 1.0)
    assert bank.known.sum() == len(FILTERS) - (factor > 1.0)


def test_what_is_not_a_number_is_never_claimed() -> None:
    """Readings that could bring it are kept out; if it comes all the same, nothing is known."""
    for index in range(HYPOTHESES):
        bank = bank_of()
        bank.x[S, index] = np.nan
        here = estimate_of(bank)
        assert here.status == Status.UNAVAILABLE
        assert (here.low_m, here.high_m) == (-np.inf, np.inf)


def separated() -> FilterBank:
    """Return a bank of which the filters without range differ from the others by far."""
    bank = bank_of(1.0)
    without_range = [Sensor.RANGE in left_out for left_out in FILTERS]
    bank.x[S, without_range] = 100.0
    # No filter says which is right.
    bank.known[HYPOTHESES:] = False
    bank.lose()
    return bank


@pytest.mark.parametrize(("seconds", "found"), [(CLAIM.hold_s - 0.1, True), (CLAIM.hold_s, False)])
def test_how_long_a_refuted_hypothesis_stays_so(seconds: float, found: bool) -> None:
    monitor = IntegrityMonitor(CLAIM)
    assert estimate_of(separated(), monitor).detected
    monitor.test(bank_of(), seconds)
    here = ProtectionLevels(CLAIM).estimate(bank_of(), monitor, seconds)
    assert bool(here.detected) is found


@pytest.mark.parametrize("sensor", Sensor)
def test_so_many_readings_in_a_row_outside_of_the_gate(sensor: Sensor) -> None:
    bank, monitor = bank_of(), IntegrityMonitor(CLAIM)
    strikes = CLAIM.strikes[sensor]
    assert strikes == (1 if sensor is Sensor.BLOCK else 3)

    def note(*, refused: bool) -> bool:
        zeros = np.zeros(len(FILTERS))
        refusals = monitor.use(sensor, True).copy() if refused else None
        monitor.note(sensor, bank, True, (UpdateResult(refusals, zeros, zeros + 1.0),))
        return bool(estimate_of(bank, monitor).detected)

    # One less than that, and one that passes, any number of times.
    for _ in range(3):
        assert not any(note(refused=True) for _ in range(strikes - 1))
        assert not note(refused=False)
    assert [note(refused=True) for _ in range(strikes)] == [False] * (strikes - 1) + [True]


def without(sensor: Sensor) -> tuple[FilterBank, IntegrityMonitor]:
    """Return a bank and a monitor that has excluded a sensor."""
    bank, monitor = bank_of(), IntegrityMonitor(CLAIM)
    bank.x[S, [sensor not in left_out for left_out in FILTERS]] = 100.0
    monitor.test(bank, 0.1)
    assert np.flatnonzero(monitor.excluded).tolist() == [sensor]
    return bank, monitor


def returns_after(
    sensor: Sensor, seconds: float, readings: int, sigmas: float = 0.0, breach_at: int = -1
) -> bool:
    """Whether an excluded sensor is used again after so many readings, evenly in a time."""
    bank, monitor = without(sensor)
    for reading in range(readings):
        off = 100.0 if reading == breach_at else sigmas
        innovation = np.full(len(FILTERS), off * 3.0)
        outcome = UpdateResult(None, innovation, np.full(len(FILTERS), 9.0))
        monitor.note(sensor, bank, True, (outcome,))
        monitor.test(bank, seconds / (readings - 1))
    return not monitor.excluded[sensor]


@pytest.mark.parametrize("sensor", Sensor)
def test_an_excluded_sensor_returns_after_a_time_and_a_number_of_readings(sensor: Sensor) -> None:
    count, time_s = CLAIM.return_readings[sensor], CLAIM.return_s
    assert returns_after(sensor, FAR * time_s, count)
    assert not returns_after(sensor, NEAR * time_s, count)
    assert not returns_after(sensor, 2.0 * time_s, count - 1) if count > 2 else True
    # Agreement that was broken begins anew.
    assert not returns_after(sensor, FAR * time_s, count, breach_at=count // 2)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_excluded_sensor_agrees_within_so_many_sigmas(sign: float) -> None:
    sigmas = sign * CLAIM.agreement
    assert returns_after(Sensor.RANGE, 30.0, 60, NEAR * sigmas)
    assert not returns_after(Sensor.RANGE, 30.0, 60, FAR * sigmas)


def test_how_long_an_unmonitored_position_is_given() -> None:
    levels, monitor, bank = ProtectionLevels(CLAIM), IntegrityMonitor(CLAIM), bank_of()
    bank.known[1 + Sensor.RANGE] = False
    here = levels.estimate(bank, monitor, CLAIM.unmonitored_s)
    assert (here.status, here.reason) == (Status.UNMONITORED, ProtectionReason.TOO_FEW_SENSORS)
    here = levels.estimate(bank, monitor, 0.1)
    assert (here.status, here.reason) == (Status.UNAVAILABLE, ProtectionReason.UNMONITORED_TOO_LONG)
    # Monitored again, the time begins anew.
    levels.estimate(bank_of(), monitor, 0.1)
    assert levels.estimate(bank, monitor, CLAIM.unmonitored_s).status == Status.UNMONITORED


def test_how_long_a_contradiction_lasts_before_it_begins_anew() -> None:
    bank, monitor = bank_of(), IntegrityMonitor(CLAIM)
    monitor.excluded[[Sensor.RANGE, Sensor.DOPPLER]] = True
    monitor._any_excluded = True
    monitor.test(bank, CLAIM.restart_s - 0.1)
    assert (
        ProtectionLevels(CLAIM).estimate(bank, monitor, 0.1).reason
        == ProtectionReason.CONTRADICTION
    )
    assert monitor.excluded.sum() == 2
    monitor.test(bank, 0.1)
    assert not monitor.excluded.any()
    assert not bank.known.any()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("risk", 1e-5),
        ("false_alarms_per_hour", 1e-3),
        ("widest_m", 200.0),
        ("hold_s", 5.0),
        ("return_s", 20.0),
        ("agreement", 4.0),
        ("return_readings", (50, 20, 2, 50)),
        ("strikes", (3, 3, 1, 3)),
        ("unmonitored_s", 600.0),
        ("restart_s", 60.0),
        ("oldest_s", 1.0),
        ("most_alike", 5),
    ],
)
def test_the_values_are_those_that_the_document_states(name: str, value: Any) -> None:
    """What was measured was measured with these: to change one is to measure again."""
    assert getattr(CLAIM, name) == value
    assert getattr(replace(IntegrityClaim(), **{name: value}), name) == value
