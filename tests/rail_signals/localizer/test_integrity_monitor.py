"""Hypotheses, tests and claims, with filters set by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from rail_signals.localizer.filter_bank import (
    DOPPLER_BIAS,
    FILTERS,
    RANGE_BIAS,
    SCALE,
    A,
    FilterBank,
    S,
    V,
)
from rail_signals.localizer.integrity_monitor import IntegrityMonitor
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import (
    Estimate,
    ProtectionLevels,
    ProtectionReason,
    Status,
)
from rail_signals.localizer.readings import TickMeasurements
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, Sensor
from rail_signals.localizer.study.simulation import SimulatedLine, SimulatedMotion, SimulatedSensors

SETTINGS = LocalizerSettings()
CLAIM = SETTINGS.claim
K = CLAIM.sigmas
#: Of a train that stands at 0: each filter's sigma, the more the fewer sensors it has.
SIGMAS_M = (1.0, 2.0, 1.0, 1.0, 1.5)


def bank_at(chainages_m: dict[frozenset[Sensor], float] | None = None) -> FilterBank:
    """Return a bank whose filters are at 0 but for some."""
    bank = FilterBank(SETTINGS)
    bank.place(np.array(True), 0.0, 1.0, 0.0, 0.1)
    for index, left_out in enumerate(FILTERS):
        bank.x[S, index] = (chainages_m or {}).get(left_out, 0.0)
        sigma_m = SIGMAS_M[index] if index < 5 else 1.5 + max(SIGMAS_M[1 + s] for s in left_out)
        bank.variances[S, index] = sigma_m**2
    bank.lose()
    return bank


def without(*sensors: Sensor) -> frozenset[Sensor]:
    return frozenset(sensors)


def judged(bank: FilterBank, monitor: IntegrityMonitor | None = None) -> Estimate:
    monitor = IntegrityMonitor(CLAIM) if monitor is None else monitor
    monitor.test(bank, 0.1)
    return ProtectionLevels(CLAIM).estimate(bank, monitor, 0.1)


@pytest.mark.parametrize("risk", [1e-3, 1e-5, 1e-9])
def test_the_interval_is_that_of_the_normal_law(risk: float) -> None:
    assert 2.0 * norm.sf(IntegrityClaim(risk=risk).sigmas) == pytest.approx(risk)


def test_the_threshold_shares_the_alarms_out_to_the_tests() -> None:
    claim = IntegrityClaim(false_alarms_per_hour=0.36, tick_s=0.1)
    assert 7 * 2.0 * norm.sf(claim.threshold(7)) == pytest.approx(1e-5)


def test_the_claim_is_the_hull_of_all_hypotheses() -> None:
    here = judged(bank_at({without(Sensor.RANGE): 3.0, without(Sensor.ODOMETER): -2.0}))
    assert here.status == Status.PROTECTED
    assert here.position_m == 0.0
    assert here.high_m == pytest.approx(3.0 + 2.0 * K)
    assert here.low_m == pytest.approx(-2.0 - 1.5 * K)
    assert here.protection_m == pytest.approx(3.0 + 2.0 * K)
    assert here.sigma_m == 1.0


def test_a_filter_of_no_use_leaves_its_sensor_uncovered() -> None:
    bank = bank_at()
    bank.variances[S, 1 + Sensor.RANGE] = 500.0**2
    here = judged(bank)
    assert (here.status, here.reason) == (Status.UNMONITORED, ProtectionReason.TOO_FEW_SENSORS)
    assert np.flatnonzero(here.uncovered).tolist() == [Sensor.RANGE]
    assert here.protection_m == pytest.approx(1.5 * K)


def test_hypotheses_wide_apart_are_too_wide_together() -> None:
    bank = bank_at()
    for index in (0, 1, 2, 3, 4):
        bank.variances[S, index] = 40.0**2
    bank.x[S, 1] = 60.0
    bank.variances[S, 5:] = 45.0**2
    here = judged(bank)
    assert (here.status, here.reason) == (Status.UNAVAILABLE, ProtectionReason.TOO_WIDE)
    assert np.isinf(here.protection_m)
    assert np.isnan(here.position_m)


def test_a_separation_is_held_against_the_variance_gained() -> None:
    threshold = CLAIM.threshold(16)
    gained_m = np.sqrt(2.0**2 - 1.0**2)
    for factor, found in ((0.99, False), (1.01, True)):
        bank = bank_at({without(Sensor.RANGE): factor * threshold * gained_m})
        for index, left_out in enumerate(FILTERS):
            if Sensor.RANGE in left_out:
                bank.x[S, index] = factor * threshold * gained_m
        assert bool(judged(bank).detected) is found


def test_the_only_hypothesis_left_names_the_sensor() -> None:
    """All filters that know the range are 40 m off, those that do not agree."""
    off = {left_out: 40.0 for left_out in FILTERS if Sensor.RANGE not in left_out}
    bank, monitor = bank_at(off), IntegrityMonitor(CLAIM)
    here = judged(bank, monitor)
    assert here.detected
    assert np.flatnonzero(here.excluded).tolist() == [Sensor.RANGE]
    assert here.position_m == 0.0
    assert here.protection_m == pytest.approx(2.0 * K)
    # Nothing is left of what the range told.
    assert not bank.x[S].any()
    kept = [FILTERS[index] for index in np.flatnonzero(bank.known)]
    assert kept == [without(), *(without(s) for s in Sensor)] + [
        left_out for left_out in FILTERS[5:] if Sensor.RANGE in left_out
    ]
    assert not monitor.use(Sensor.RANGE, True).any()
    assert monitor.use(Sensor.DOPPLER, True).any()


def test_two_hypotheses_left_are_both_held() -> None:
    """Range and wheels against each other, and no third to say who is right."""
    bank = bank_at()
    for index, left_out in enumerate(FILTERS):
        bank.x[S, index] = 0.0 if Sensor.RANGE not in left_out else 40.0
        # Without range and wheels, or one of them and a third, there is nothing.
        if len(left_out) == 2:
            bank.known[index] = False
    bank.lose()
    monitor = IntegrityMonitor(CLAIM)
    here = judged(bank, monitor)
    assert here.detected
    assert not here.excluded.any()
    assert here.low_m == pytest.approx(-1.5 * K)
    assert here.high_m == pytest.approx(40.0 + 2.0 * K)
    assert here.position_m == pytest.approx(0.5 * (here.low_m + here.high_m))
    # Once one of the two is of no use nothing can be said.
    bank.variances[S, 1 + Sensor.RANGE] = 100.0**2
    here = judged(bank, monitor)
    assert (here.status, here.reason) == (Status.UNAVAILABLE, ProtectionReason.AMBIGUOUS)


def test_an_impossible_scale_of_the_wheels_is_their_fault() -> None:
    bank = bank_at()
    bank.x[SCALE, [Sensor.ODOMETER not in out for out in FILTERS]] = 0.2
    here = judged(bank)
    assert np.flatnonzero(here.excluded).tolist() == [Sensor.ODOMETER]


def test_speeds_are_claimed_in_the_same_way() -> None:
    bank = bank_at()
    wheelless = [Sensor.ODOMETER in out for out in FILTERS]
    bank.x[V, wheelless] = 0.3
    bank.variances[V, wheelless] = 0.5**2
    here = judged(bank)
    assert here.speed_high_mps == pytest.approx(0.3 + 0.5 * K)
    assert here.speed_low_mps == pytest.approx(0.3 - 0.5 * K)


def test_an_estimate_stays_as_it_was() -> None:
    localizer = Localizer(SETTINGS, (2,))
    localizer.place(np.zeros((2, 1)), 1.0, speed_mps=10.0)
    estimate = localizer.tick(0.0, TickMeasurements())
    before = estimate.position_m.copy()
    localizer.tick(1.0, TickMeasurements())
    np.testing.assert_array_equal(estimate.position_m, before)


@pytest.mark.parametrize("sensor", [Sensor.RANGE, Sensor.DOPPLER, Sensor.ODOMETER])
def test_a_filter_knows_nothing_of_the_sensor_it_leaves_out(sensor: Sensor) -> None:
    """To the last bit, whatever that sensor tells: what the protection level rests on."""
    line, runs = SimulatedLine(), 3
    name = sensor.name.lower()
    left_out = [sensor in out for out in FILTERS]
    # Nothing is ever refuted, so that nothing is excluded.
    settings = replace(SETTINGS, claim=IntegrityClaim(strikes=(10**6,) * 4))
    found = []
    for wrong in (False, True):
        rng = np.random.default_rng(7)
        motion = SimulatedMotion(runs, 1, line.tick_s, rng)
        sensors = SimulatedSensors(line, runs, 1, rng)
        localizer = Localizer(settings, (runs,))
        localizer.monitor._threshold2 = np.inf
        for tick in range(80):
            readings = sensors.read(motion.step())._replace(block=None)
            if wrong and tick > 20:
                reading = getattr(readings, name)
                changed = {
                    key: value + (5.0 if key in ("chainage_m", "speed_mps") else 0.0)
                    for key, value in reading._asdict().items()
                    if key != "present"
                }
                readings = readings._replace(**{name: reading._replace(**changed)})
            localizer.tick(tick * line.tick_s, readings)
        # How much wheels slip is no matter to filters that do not look at them.
        states = [S, V, A, RANGE_BIAS, DOPPLER_BIAS]
        found.append((localizer.bank.x[states], localizer.bank.p[np.ix_(states, states)]))
    for healthy, faulty in zip(*found, strict=True):
        np.testing.assert_array_equal(healthy[..., left_out], faulty[..., left_out])
        assert not np.array_equal(healthy[..., 0], faulty[..., 0])
