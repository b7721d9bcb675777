"""What the integrity campaign counts: a localizer that errs by the script, judged by `tally`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from rail_signals.localizer.protection_level import Estimate, ProtectionReason, Status
from rail_signals.localizer.settings import SENSORS, LocalizerSettings, Sensor
from rail_signals.localizer.study import campaign
from rail_signals.localizer.study.campaign import Tally, stated_s, tally
from rail_signals.localizer.study.faults import FaultKind
from rail_signals.localizer.study.simulation import SimulatedLine, SimulatedMotion, Truth

RUNS, TICKS = 3, 40
LINE = SimulatedLine()
TICK_S = LINE.tick_s
#: The fault begins with this tick.
BEGINS = 10
#: Position and speed are claimed within these.
HALF_M, HALF_MPS = 5.0, 1.0

#: Changes an estimate of a tick; gets the number of the tick.
Script = Callable[[int, dict[str, Any]], None]


class Watched(SimulatedMotion):
    """Lets the scripted localizer know the truth."""

    truth: Truth

    def step(self) -> Truth:
        Watched.truth = super().step()
        return Watched.truth


class AlwaysLarge:
    """A fault of which every reading is off by far."""

    def __init__(self, sensor: Sensor, *_: Any) -> None:
        self.sensor = sensor

    def apply(self, readings: Any, _: float) -> tuple[Any, Any, Any]:
        return readings, np.full(RUNS, 100.0), np.full(RUNS, 20.0)


def scripted(script: Script) -> type:
    """A localizer that knows the truth and claims it, but for what a script changes."""

    class Scripted:
        rejected = ()

        def __init__(self, *_: Any) -> None:
            self._tick = -1

        def place(self, *_: Any, **__: Any) -> None:
            pass

        def tick(self, *_: Any) -> Estimate:
            self._tick += 1
            s, v = Watched.truth.chainage_m, Watched.truth.speed_mps
            told: dict[str, Any] = {
                "position_m": s.copy(),
                "low_m": s - HALF_M,
                "high_m": s + HALF_M,
                "speed_mps": v.copy(),
                "speed_low_mps": v - HALF_MPS,
                "speed_high_mps": v + HALF_MPS,
                "fastest_mps": np.abs(v) + HALF_MPS,
                "sigma_m": np.ones(RUNS),
                "status": np.full(RUNS, int(Status.PROTECTED)),
                "reason": np.full(RUNS, int(ProtectionReason.NONE)),
                "detected": np.zeros(RUNS, np.bool_),
                "wheels_doubted": np.zeros(RUNS, np.bool_),
                "excluded": np.zeros((RUNS, SENSORS), np.bool_),
                "uncovered": np.zeros((RUNS, SENSORS), np.bool_),
            }
            script(self._tick, told)
            return Estimate(**told)

    return Scripted


@pytest.fixture
def count(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Tally]:
    """Return what counts the runs of a script, with a range that is off by far or without fault."""

    def of(script: Script, *, faulty: bool = True, ticks: int = TICKS) -> Tally:
        monkeypatch.setattr(campaign, "SimulatedMotion", Watched)
        monkeypatch.setattr(campaign, "SensorFault", AlwaysLarge)
        monkeypatch.setattr(campaign, "Localizer", scripted(script))
        fault = (Sensor.RANGE, FaultKind.JUMP) if faulty else (None, None)
        return tally(
            LocalizerSettings(),
            replace(LINE, outages_per_s=0.0),
            *fault,
            runs=RUNS,
            ticks=ticks,
            rng=np.random.default_rng(1),
            begins_s=(BEGINS * TICK_S, BEGINS * TICK_S),
        )

    return of


def truthful(_: int, __: dict[str, Any]) -> None:
    pass


def test_who_claims_the_truth_is_blamed_for_nothing_but_silence(count: Any) -> None:
    counted = count(truthful)
    assert counted.positions == counted.claimed == counted.protected == RUNS * (TICKS - BEGINS)
    assert counted.misleading == counted.misleading_speeds == counted.misleading_runs == 0
    assert counted.false_alarms == counted.wrong_exclusions == 0
    assert counted.healthy_s == pytest.approx(RUNS * BEGINS * TICK_S)


@pytest.mark.parametrize(
    ("name", "shift_m", "exceeded"),
    [
        ("low_m", HALF_M - 1e-6, 0),
        ("low_m", HALF_M + 1e-6, 5),
        ("high_m", -HALF_M + 1e-6, 0),
        ("high_m", -HALF_M - 1e-6, 5),
        ("low_m", np.nan, 5),
        ("high_m", np.nan, 5),
    ],
)
def test_levels_exceeded_are_counted_and_the_runs_too(
    count: Any, name: str, shift_m: float, exceeded: int
) -> None:
    def script(tick: int, told: dict[str, Any]) -> None:
        if tick in (4, 11, 12, 13):  # before the fault it does not count
            told[name][0] += shift_m
        if tick in (20, 39):
            told[name][2] += shift_m

    counted = count(script)
    assert counted.misleading == exceeded
    assert counted.misleading_runs == (2 if exceeded else 0)
    assert counted.misleading_speeds == 0


@pytest.mark.parametrize(
    ("name", "shift_mps", "exceeded"),
    [
        ("speed_low_mps", HALF_MPS - 1e-6, 0),
        ("speed_low_mps", HALF_MPS + 1e-6, 3),
        ("speed_high_mps", -HALF_MPS + 1e-6, 0),
        ("speed_high_mps", -HALF_MPS - 1e-6, 3),
        ("speed_high_mps", np.nan, 3),
    ],
)
def test_speeds_exceeded_are_counted(
    count: Any, name: str, shift_mps: float, exceeded: int
) -> None:
    def script(tick: int, told: dict[str, Any]) -> None:
        if tick in (10, 30, 31):
            told[name][1] += shift_mps

    counted = count(script)
    assert (counted.misleading_speeds, counted.misleading) == (exceeded, 0)


def test_what_is_not_claimed_is_not_exceeded(count: Any) -> None:
    def script(tick: int, told: dict[str, Any]) -> None:
        told["low_m"] += 100.0
        told["status"][0] = int(Status.UNAVAILABLE)
        told["uncovered"][1, Sensor.RANGE] = True
        # It is claimed to survive the fault of the range, and does not.
        told["uncovered"][2, Sensor.DOPPLER] = True

    counted = count(script)
    assert counted.claimed == counted.misleading == TICKS - BEGINS
    assert counted.misleading_runs == 1


def test_a_fault_that_is_found_before_there_is_one_is_a_false_alarm(count: Any) -> None:
    def script(tick: int, told: dict[str, Any]) -> None:
        told["detected"][0] = tick in (3, 4)
        told["detected"][1] = tick == BEGINS - 1
        told["detected"][2] = tick == BEGINS

    assert count(script).false_alarms == 2
    assert count(script, faulty=False).false_alarms == 3
    assert count(truthful, faulty=False).false_alarms == 0


def test_the_exclusion_of_a_healthy_sensor_is_wrong(count: Any) -> None:
    def script(tick: int, told: dict[str, Any]) -> None:
        if tick in (20, 21):
            told["excluded"][0, Sensor.RANGE] = True  # it is the faulty one
            told["excluded"][1, Sensor.DOPPLER] = True

    assert count(script).wrong_exclusions == 1
    assert count(script, faulty=False).wrong_exclusions == 2


@pytest.mark.parametrize(("waits", "late"), [(50, 0), (51, RUNS)])
def test_a_fault_is_found_late_after_the_stated_time(count: Any, waits: int, late: int) -> None:
    # 5 s of readings from the first that is off by much, which is that of the first tick.
    assert stated_s(Sensor.RANGE, FaultKind.JUMP) == 5.0

    def script(tick: int, told: dict[str, Any]) -> None:
        told["detected"][:] = tick >= BEGINS + waits

    counted = count(script, ticks=BEGINS + 60)
    assert (counted.due, counted.late) == (RUNS, late)
    assert counted.delays_s == pytest.approx(np.full(RUNS, waits * TICK_S))


def test_a_fault_that_is_never_found_is_late_once_it_was_due(count: Any) -> None:
    # 49 readings after the first are too few to say so.
    for ticks, due in ((BEGINS + 50, 0), (BEGINS + 51, RUNS)):
        counted = count(truthful, ticks=ticks)
        assert (counted.due, counted.late) == (due, due)
        assert np.isinf(counted.delays_s).all()
