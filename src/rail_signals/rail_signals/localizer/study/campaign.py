"""How often a protection level is misleading, and how soon a fault is found: counted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from rail_signals.localizer.filter_bank import FloatArray
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import ProtectionReason, Status
from rail_signals.localizer.screening import Rejection
from rail_signals.localizer.settings import LocalizerSettings, Sensor

from .faults import FaultKind, SensorFault
from .simulation import SimulatedLine, SimulatedMotion, SimulatedSensors

PLACED_M: Final = 2.0
"""Sigma with which trains are placed at the start."""

_SUDDEN: Final = (FaultKind.FREEZE, FaultKind.JUMP, FaultKind.COME_AND_GO, FaultKind.WRONG_STATION)


def stated_s(sensor: Sensor, kind: FaultKind) -> float:
    """Time in which a fault is to be found, of readings of the faulty sensor [s].

    What jumps is refused by the gates, three readings in a row, at the first by a block. What
    creeps in is found by comparison with what other sensors report, which are silent at times.
    Wheels are believed to slip, or to pull, before they are believed to be wrong.
    """
    if sensor is Sensor.BLOCK:
        return 0.1
    return 5.0 if kind in _SUDDEN and sensor is not Sensor.ODOMETER else 120.0


@dataclass(frozen=True)
class Tally:
    """What was counted in one cell of a campaign.

    Parameters
    ----------
    sensor, kind : Sensor, FaultKind
        The fault; None = none.
    positions : int
        Ticks of runs, from the beginning of the fault on where there is one.
    claimed : int
        Those with a position that is claimed to survive this fault.
    misleading, misleading_speeds : int
        Those of the claimed where the train, or its speed, was outside of the interval.
    misleading_runs : int
        Runs in which the position was.
    protected : int
        Positions that survive any fault.
    false_alarms : int
        Runs in which a fault was found before there was one.
    wrong_exclusions : int
        Runs in which a healthy sensor was excluded.
    healthy_s : float
        Time of all runs before there was a fault.
    due, late, excluded : int
        Runs in which the fault became large early enough to be found in the stated time; those
        where it was not; those where its sensor was excluded.
    delays_s : float64 [due]
        Time of readings from the first that was off by much until the fault was found, 0 if it
        had been found before; infinite if it was not.
    protection_m, error_m : float64 [...]
        Every tenth protection level and error of the claimed.
    reasons : tuple of int
        Positions by `ProtectionReason`.
    """

    sensor: Sensor | None
    kind: FaultKind | None
    positions: int
    claimed: int
    misleading: int
    misleading_speeds: int
    misleading_runs: int
    protected: int
    false_alarms: int
    wrong_exclusions: int
    healthy_s: float
    due: int
    late: int
    excluded: int
    delays_s: FloatArray
    protection_m: FloatArray
    error_m: FloatArray
    reasons: tuple[int, ...]


class _Delays:
    """Counts readings of the faulty sensor from when its error is large until it is found."""

    def __init__(self, runs: int) -> None:
        self._due, self._detected, self._excluded = np.zeros((3, runs), np.bool_)
        self._readings = np.zeros(runs, dtype=np.int64)

    def tick(
        self, large: np.ndarray, read: np.ndarray, detected: np.ndarray, excluded: np.ndarray
    ) -> None:
        # The reading that is the first to be off by much does not count: found in its own tick is
        # found at once.
        self._readings += self._due & read & ~self._detected
        self._due |= large
        self._detected |= detected
        self._excluded |= excluded

    def results(self, tick_s: float, most_s: float) -> tuple[FloatArray, int, int]:
        """Delays of the runs that count, how many of them are late, how many led to exclusion."""
        waited_s = self._readings * tick_s
        counts = self._due & (self._detected | (waited_s >= most_s))
        delays_s = np.where(self._detected, waited_s, np.inf)[counts]
        return delays_s, int((delays_s > most_s).sum()), int((counts & self._excluded).sum())


def tally(
    settings: LocalizerSettings,
    line: SimulatedLine,
    sensor: Sensor | None,
    kind: FaultKind | None,
    *,
    runs: int,
    ticks: int,
    rng: np.random.Generator,
    begins_s: tuple[float, float] = (5.0, 40.0),
) -> Tally:
    """Simulate runs, each with the fault beginning at a time in `begins_s`, and count."""
    tick_s, counted_from_s = line.tick_s, np.zeros(runs)
    motion = SimulatedMotion(runs, settings.direction, tick_s, rng)
    sensors = SimulatedSensors(line, runs, settings.direction, rng)
    fault = None
    if sensor is not None and kind is not None:
        counted_from_s = rng.uniform(*begins_s, runs)
        fault = SensorFault(sensor, kind, counted_from_s, line, rng)
    localizer, delays = Localizer(settings, (runs,)), _Delays(runs)
    names = ("positions", "claimed", "misleading", "misleading_speeds", "protected")
    counts = dict.fromkeys(names, 0)
    misled, alarmed, wrong = np.zeros((3, runs), np.bool_)
    levels, errors, reasons = [], [], np.zeros(len(ProtectionReason), dtype=np.int64)
    healthy_ticks = 0
    for tick in range(ticks):
        time_s = tick * tick_s
        truth = motion.step()
        readings = sensors.read(truth)
        if tick == 0:
            start_m = truth.chainage_m + PLACED_M * rng.standard_normal(runs)
            localizer.place(start_m[:, None], PLACED_M, sigma_mps=30.0)
        begun = time_s >= counted_from_s
        healthy_ticks += runs if fault is None else int((~begun).sum())
        if fault is not None:
            readings, falsified, large = fault.apply(readings, time_s)
        estimate = localizer.tick(time_s, readings)
        detected = estimate.detected.copy()
        for _, why, which in localizer.rejected:
            if why is Rejection.FROZEN:
                detected |= np.asarray(which)[:, 0]

        claimed = begun & (estimate.status > Status.UNAVAILABLE)
        healthy = ~estimate.excluded
        if fault is not None:
            claimed = claimed & ~estimate.uncovered[:, fault.sensor]
            healthy = np.delete(healthy, fault.sensor, axis=1)
            out = estimate.excluded[:, fault.sensor]
            delays.tick(begun & (falsified > large), falsified > 0.0, begun & detected, begun & out)
        wrong |= ~healthy.all(axis=1)
        alarmed |= detected if fault is None else detected & ~begun
        s, v = truth.chainage_m, truth.speed_mps
        # What is not a number holds nothing.
        outside = claimed & ~((estimate.low_m <= s) & (s <= estimate.high_m))
        inside_mps = (estimate.speed_low_mps <= v) & (v <= estimate.speed_high_mps)
        too_fast = claimed & ~inside_mps
        misled |= outside
        protected = begun & (estimate.status == Status.PROTECTED)
        for name, which in zip(names, (begun, claimed, outside, too_fast, protected), strict=True):
            counts[name] += int(which.sum())
        reasons += np.bincount(estimate.reason[begun], minlength=len(ProtectionReason))
        if tick % 10 == 0:
            levels.append(estimate.protection_m[claimed])
            errors.append((estimate.position_m - s)[claimed])
    most_s = 0.0 if sensor is None or kind is None else stated_s(sensor, kind)
    delays_s, late, excluded = delays.results(tick_s, most_s)
    return Tally(
        sensor,
        kind,
        **counts,
        misleading_runs=int(misled.sum()),
        false_alarms=int(alarmed.sum()),
        wrong_exclusions=int(wrong.sum()),
        healthy_s=healthy_ticks * tick_s,
        due=delays_s.size,
        late=late,
        excluded=excluded,
        delays_s=delays_s,
        protection_m=np.concatenate(levels),
        error_m=np.concatenate(errors),
        reasons=tuple(reasons.tolist()),
    )
