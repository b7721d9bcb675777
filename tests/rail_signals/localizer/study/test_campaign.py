"""Integrity over simulated runs, and what the simulation itself is made of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import ProtectionReason
from rail_signals.localizer.readings import TickMeasurements
from rail_signals.localizer.settings import IntegrityClaim, LocalizerSettings, Sensor
from rail_signals.localizer.study.campaign import Tally, stated_s, tally
from rail_signals.localizer.study.faults import CASES, EFFECT, FaultKind, SensorFault
from rail_signals.localizer.study.simulation import (
    Drifting,
    SimulatedLine,
    SimulatedMotion,
    SimulatedSensors,
    Truth,
)

LINE = SimulatedLine()
DEFAULT = LocalizerSettings()


def cell(
    sensor: Sensor | None,
    kind: FaultKind | None,
    settings: LocalizerSettings = DEFAULT,
    *,
    runs: int = 60,
    ticks: int = 400,
    seed: int = 1,
) -> Tally:
    """Return the count of a small cell."""
    rng = np.random.default_rng(seed)
    return tally(
        settings, LINE, sensor, kind, runs=runs, ticks=ticks, rng=rng, begins_s=(5.0, 10.0)
    )


@pytest.fixture(scope="module")
def healthy() -> Tally:
    return cell(None, None, runs=100)


def test_without_a_fault_the_protection_level_holds_and_nothing_is_found(healthy: Tally) -> None:
    assert healthy.positions == 40_000
    assert healthy.misleading == healthy.misleading_speeds == 0
    assert healthy.false_alarms == healthy.wrong_exclusions == 0
    assert healthy.claimed > 0.99 * healthy.positions
    assert sum(healthy.reasons) == healthy.positions
    assert healthy.reasons[ProtectionReason.NONE] == healthy.protected
    # As wide as the second-best sensor makes it, and far narrower than what is ever given.
    assert 4.0 < healthy.protection_m.mean() < 40.0
    assert np.sqrt(np.mean(healthy.error_m**2)) < 0.5


@pytest.mark.parametrize(
    ("sensor", "kind"),
    [
        (Sensor.RANGE, FaultKind.BIAS),
        (Sensor.RANGE, FaultKind.WRONG_STATION),
        (Sensor.DOPPLER, FaultKind.JUMP),
        (Sensor.ODOMETER, FaultKind.FREEZE),
    ],
)
def test_with_a_faulty_sensor_it_holds_too_and_the_fault_is_found(
    sensor: Sensor, kind: FaultKind
) -> None:
    counted = cell(sensor, kind, runs=25)
    assert counted.positions > 7_000
    assert counted.misleading <= 1e-4 * counted.claimed
    assert counted.misleading_speeds <= 1e-4 * counted.claimed
    assert counted.wrong_exclusions == counted.false_alarms == 0
    assert counted.claimed > 0.9 * counted.positions
    assert counted.due > 0
    assert counted.late == 0
    assert (counted.delays_s <= stated_s(sensor, kind)).all()


def test_a_larger_risk_gives_narrower_levels_and_is_kept() -> None:
    """Where there is something to count: a range that jumps, and one position in twenty."""
    risky = replace(DEFAULT, claim=replace(DEFAULT.claim, risk=0.05))
    counted = cell(Sensor.RANGE, FaultKind.JUMP, risky, runs=40)
    assert 0.0 < counted.misleading <= 0.05 * counted.claimed
    usual = cell(Sensor.RANGE, FaultKind.JUMP, runs=20, ticks=200)
    assert counted.protection_m.mean() < 0.8 * usual.protection_m.mean()


def test_false_alarms_are_no_more_than_stated() -> None:
    """With thresholds so low that there are some: a hundredth of all ticks."""
    claim = IntegrityClaim(false_alarms_per_hour=360.0, hold_s=0.1)
    assert claim.false_alarms_per_tick == pytest.approx(0.01)
    runs, ticks, rng = 60, 200, np.random.default_rng(4)
    motion = SimulatedMotion(runs, 1, LINE.tick_s, rng)
    sensors = SimulatedSensors(LINE, runs, 1, rng)
    localizer = Localizer(replace(DEFAULT, claim=claim), (runs,))
    alarms = positions = 0
    before = np.zeros(runs, np.bool_)
    for tick in range(ticks):
        truth = motion.step()
        readings = sensors.read(truth)
        if tick == 0:
            localizer.place(truth.chainage_m[:, None], 2.0, sigma_mps=30.0)
        estimate = localizer.tick(tick * LINE.tick_s, readings)
        alarms += int((estimate.detected & ~before).sum())
        positions += int((~estimate.detected | ~before).sum())
        before = estimate.detected
    assert 0 < alarms <= 0.01 * positions


def one_run(readings: TickMeasurements, run: int) -> TickMeasurements:
    """Return the readings of one of many runs as a single train has them."""
    parts = []
    for reading in readings:
        values = {
            key: value[run, 0].item() if isinstance(value, np.ndarray) else value
            for key, value in reading._asdict().items()
        }
        present = bool(reading.present[run, 0])
        values["present"] = True
        parts.append(reading._replace(**values) if present else None)
    return TickMeasurements(*parts)


def test_many_runs_at_once_are_as_one_by_one() -> None:
    runs, rng = 4, np.random.default_rng(9)
    motion = SimulatedMotion(runs, -1, LINE.tick_s, rng)
    sensors = SimulatedSensors(LINE, runs, -1, rng)
    fault = SensorFault(Sensor.RANGE, FaultKind.JUMP, np.array([5.0, 6.0, 7.0, 1e9]), LINE, rng)
    settings = LocalizerSettings(direction=-1)
    together = Localizer(settings, (runs,))
    alone = [Localizer(settings) for _ in range(runs)]
    for tick in range(100):
        truth = motion.step()
        readings, _, _ = fault.apply(sensors.read(truth), tick * LINE.tick_s)
        if tick == 0:
            together.place(truth.chainage_m[:, None], 2.0, sigma_mps=30.0)
            for run, localizer in enumerate(alone):
                localizer.place(float(truth.chainage_m[run]), 2.0, sigma_mps=30.0)
        estimate = together.tick(tick * LINE.tick_s, readings)
        for run, localizer in enumerate(alone):
            single = localizer.tick(tick * LINE.tick_s, one_run(readings, run))
            for name, value in single._asdict().items():
                batched = getattr(estimate, name)[run]
                np.testing.assert_allclose(batched, value, rtol=1e-9, atol=1e-9, err_msg=name)
    assert estimate.excluded[:3, Sensor.RANGE].all()
    assert not estimate.excluded[3].any()


def test_the_same_seed_gives_the_same_counts() -> None:
    one, other = (cell(Sensor.DOPPLER, FaultKind.BIAS, runs=5, ticks=150) for _ in range(2))
    np.testing.assert_array_equal(one.protection_m, other.protection_m)
    assert one.reasons == other.reasons


@pytest.mark.parametrize("direction", [1, -1])
def test_block_entries_are_told_late_by_a_uniform_time(direction: int) -> None:
    rng = np.random.default_rng(6)
    line = replace(LINE, block_m=200.0, outages_per_s=0.0)
    runs, speed_mps = 50, 30.0
    sensors = SimulatedSensors(line, runs, direction, rng)
    late_s: list[float] = []
    for tick in range(400):
        at_m = direction * (10e3 + tick * line.tick_s * speed_mps + np.zeros(runs))
        truth = Truth(at_m, np.full(runs, direction * speed_mps), np.zeros(runs))
        estimate = sensors.read(truth).block
        assert estimate is not None
        present = estimate.present[:, 0]
        noticed_m = at_m - direction * speed_mps * estimate.age_s[:, 0]
        late_s += (direction * (noticed_m - estimate.joint_m[:, 0])[present] / speed_mps).tolist()
    assert len(late_s) > 200
    assert min(late_s) >= -1e-9
    assert max(late_s) <= line.detection_s + 1e-9
    assert np.mean(late_s) == pytest.approx(0.5 * line.detection_s, abs=0.03)


def test_a_drifting_error_keeps_its_variance_and_forgets_with_the_way() -> None:
    rng = np.random.default_rng(8)
    drifting = Drifting(20_000, 100.0, rng)
    before = drifting.value.copy()
    for _ in range(10):
        after = drifting.step(np.full(20_000, 5.0))
    assert np.var(after) == pytest.approx(1.0, abs=0.05)
    assert np.mean(before * after) == pytest.approx(np.exp(-0.5), abs=0.03)


def test_every_fault_of_the_table_can_be_applied() -> None:
    assert len(CASES) == 22
    runs, rng = 20, np.random.default_rng(3)
    for sensor, kind in CASES:
        motion = SimulatedMotion(runs, 1, LINE.tick_s, rng)
        line = replace(LINE, outages_per_s=0.0, block_m=50.0)
        sensors = SimulatedSensors(line, runs, 1, rng)
        fault = SensorFault(sensor, kind, np.full(runs, 1.0), line, rng)
        worst = np.zeros(runs)
        for tick in range(150):
            _, off, large = fault.apply(sensors.read(motion.step()), tick * LINE.tick_s)
            assert tick * LINE.tick_s > 0.999 or not off.any()
            assert (large >= EFFECT[sensor]).all()
            worst = np.maximum(worst, off)
        assert np.median(worst) > 0.0, (sensor, kind)


def test_a_fault_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="odometer has no fault 'wrong station'"):
        SensorFault(
            Sensor.ODOMETER, FaultKind.WRONG_STATION, np.zeros(1), LINE, np.random.default_rng(1)
        )
