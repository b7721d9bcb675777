"""Integrity of the localizer: levels misleading, faults found, and what a tick costs.

    python benchmarks/localizer_integrity.py [--runs N] [--ticks N] [--seed N] [--json FILE]
        [--only TEXT] [--mismatch] [--cost]

Trains run on a simulated line (`study.simulation`), each with one fault of one sensor
(`study.faults`) that begins after 5 to 40 s and lasts, and without any. Counted are, of the
positions that are claimed to survive a fault of that sensor, those that were misleading: the train
was outside of the protection level; and how long the sensor went on with readings that are off by
much until a fault was found, against the stated time. Positions of one run are not independent: the
runs that were misled are counted as well.

--mismatch  worlds that are not as the filters believe: biases that change faster or more slowly,
            worse wheels, more slips, more outages. No fault, and a range that drifts.
--cost      time of a tick for one train, in microseconds and in additions of two small arrays.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.readings import (
    DopplerFix,
    RangeFix,
    TickMeasurements,
    WheelSpeed,
)
from rail_signals.localizer.settings import LocalizerSettings, Sensor
from rail_signals.localizer.study.campaign import Tally, stated_s, tally
from rail_signals.localizer.study.faults import CASES, FaultKind
from rail_signals.localizer.study.simulation import SimulatedLine

MISMATCHES = {
    "as believed": {},
    "range bias over 50 m": {"range_bias_length_m": 50.0},
    "range bias over 5 km": {"range_bias_length_m": 5000.0},
    "Doppler bias over 50 m": {"doppler_bias_length_m": 50.0},
    "Doppler bias over 3 km": {"doppler_bias_length_m": 3000.0},
    "wheels of 2 %": {"wheel_scale": 0.02},
    "slips three times": {"slips_per_s": 0.15},
    "outages four times": {"outages_per_s": 1.0 / 30.0},
    "no noise, biases only": {"range_sigma_m": (1e-3, 2e-3), "wheel_noise_mps": 0.0},
}


@dataclass(frozen=True)
class Row:
    """One line of the table."""

    sensor: str
    fault: str
    positions: int
    claimed: float
    protected: float
    misleading: int
    misleading_runs: int
    misleading_speeds: int
    false_alarms: int
    wrong_exclusions: int
    healthy_h: float
    due: int
    late: int
    excluded: int
    delay_p50_s: float
    delay_p95_s: float
    delay_max_s: float
    stated_s: float
    protection_mean_m: float
    protection_p95_m: float
    rmse_m: float

    @classmethod
    def of(cls, counted: Tally) -> Row:
        """Values of a count."""
        delays = np.sort(counted.delays_s)
        places = [math.ceil(q * delays.size) - 1 for q in (0.5, 0.95, 1.0)]
        p50, p95, most = (float(delays[at]) if delays.size else math.nan for at in places)
        sensor, kind = counted.sensor, counted.kind
        faulty = sensor is not None and kind is not None
        return cls(
            sensor.name.lower() if sensor is not None else "none",
            kind.value if kind is not None else "",
            counted.positions,
            counted.claimed / counted.positions,
            counted.protected / counted.positions,
            counted.misleading,
            counted.misleading_runs,
            counted.misleading_speeds,
            counted.false_alarms,
            counted.wrong_exclusions,
            counted.healthy_s / 3600.0,
            counted.due,
            counted.late,
            counted.excluded,
            p50,
            p95,
            most,
            stated_s(sensor, kind) if faulty else math.nan,  # type: ignore[arg-type]
            float(counted.protection_m.mean()),
            float(np.percentile(counted.protection_m, 95)),
            float(np.sqrt(np.mean(counted.error_m**2))),
        )

    def __str__(self) -> str:
        return (
            f"{self.sensor:9} {self.fault:14} {self.positions:8d} {100 * self.claimed:6.2f}"
            f" {100 * self.protected:6.2f} {self.misleading:5d} /{self.misleading_runs:3d}"
            f" {self.misleading_speeds:5d}  {self.due:4d} {self.late:4d} {self.excluded:4d}"
            f" {self.delay_p50_s:6.1f} {self.delay_p95_s:6.1f} {self.delay_max_s:6.1f}"
            f" {self.stated_s:6.1f}  {self.protection_mean_m:6.1f} {self.protection_p95_m:6.1f}"
            f" {self.rmse_m:6.2f}"
        )


HEAD = (
    f"{'sensor':9} {'fault':14} {'posit.':>8} {'claim%':>6} {'prot.%':>6} {'misleading':>10}"
    f" {'speed':>5}  {'due':>4} {'late':>4} {'out':>4} {'p50 s':>6} {'p95 s':>6} {'max s':>6}"
    f" {'stated':>6}  {'PL m':>6} {'p95 m':>6} {'rmse':>6}"
)


def campaign(
    line: SimulatedLine, runs: int, ticks: int, seed: int, only: str = ""
) -> Iterator[Row]:
    """All cells, one after the other."""
    cases: list[tuple[Sensor | None, FaultKind | None]] = [(None, None), *CASES]
    for number, (sensor, kind) in enumerate(cases):
        name = "none" if sensor is None or kind is None else f"{sensor.name.lower()} {kind.value}"
        if only in name:
            rng = np.random.default_rng([seed, number])
            settings = LocalizerSettings(direction=1 - 2 * (number % 2))
            yield Row.of(tally(settings, line, sensor, kind, runs=runs, ticks=ticks, rng=rng))


def summary(rows: list[Row]) -> dict[str, float]:
    """Totals of a table."""
    claimed = sum(row.claimed * row.positions for row in rows)
    return {
        "positions": sum(row.positions for row in rows),
        "claimed": claimed,
        "misleading": sum(row.misleading for row in rows),
        "rate": sum(row.misleading for row in rows) / claimed,
        "worst_cell_rate": max(row.misleading / (row.claimed * row.positions) for row in rows),
        "false_alarms": sum(row.false_alarms for row in rows),
        "wrong_exclusions": sum(row.wrong_exclusions for row in rows),
        "healthy_h": sum(row.healthy_h for row in rows),
        "due": sum(row.due for row in rows),
        "late": sum(row.late for row in rows),
    }


def table(runs: int, ticks: int, seed: int, only: str) -> list[Row]:
    """Print the table as it grows."""
    print(HEAD)
    rows = []
    for row in campaign(SimulatedLine(), runs, ticks, seed, only):
        rows.append(row)
        print(row, flush=True)
    for name, value in summary(rows).items():
        print(f"{name}: {value:.6g}")
    return rows


def mismatch(runs: int, ticks: int, seed: int) -> dict[str, list[Row]]:
    """The fault-free cell and one with a drifting range in worlds of another make."""
    print(f"{'world':24} {HEAD}")
    found: dict[str, list[Row]] = {}
    for name, changes in MISMATCHES.items():
        line = replace(SimulatedLine(), **changes)
        for only in ("none", "range drift"):
            for row in campaign(line, runs, ticks, seed, only):
                found.setdefault(name, []).append(row)
                print(f"{name:24} {row}", flush=True)
    return found


def cost(ticks: int = 3000) -> dict[str, float]:
    """Quantiles of the time of a tick [us], and of an addition of two arrays of 7 x 11."""
    rng = np.random.default_rng(1)
    speed_mps = 20.0
    times_us: dict[str, float] = {}
    for name, with_doppler in (("range, wheels", False), ("range, Doppler, wheels", True)):
        localizer = Localizer(LocalizerSettings())
        localizer.place(0.0, 1.0, speed_mps=speed_mps)
        times, additions = np.zeros((2, ticks))
        one, two = rng.standard_normal((2, 7, 11))
        for tick, noise in enumerate(rng.standard_normal((ticks, 4)).tolist()):
            s = speed_mps * 0.1 * tick
            readings = TickMeasurements(
                RangeFix(s + 0.2 * noise[0], 0.04, 0.0, s // 1500.0),
                DopplerFix(s + 3.0 * noise[1], speed_mps + 0.3 * noise[2], 9.0, 0.5, 0.09, 0.0)
                if with_doppler
                else None,
                None,
                WheelSpeed(1.005 * speed_mps + 0.03 * noise[3], 0.0),
            )
            start = time.perf_counter()
            localizer.tick(0.1 * tick, readings)
            middle = time.perf_counter()
            for _ in range(8):
                one + two
            additions[tick] = (time.perf_counter() - middle) / 8
            times[tick] = middle - start
        quick, median = np.percentile(times * 1e6, [5, 50])
        unit = float(np.percentile(additions * 1e6, 5))
        times_us |= {f"{name}, p5": quick, f"{name}, p50": median, f"{name}, addition p5": unit}
        print(
            f"{name}: p5 {quick:.0f} us, p50 {median:.0f} us a tick;"
            f" an addition p5 {unit:.2f} us: {quick / unit:.0f} of them"
        )
    return times_us


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--ticks", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="", help="cells whose name holds this text")
    parser.add_argument("--mismatch", action="store_true", help="only: worlds of another make")
    parser.add_argument("--cost", action="store_true", help="only: the cost of a tick")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    start = time.process_time()
    result: object
    if options.cost:
        result = cost()
    elif options.mismatch:
        worlds = mismatch(options.runs, options.ticks, options.seed)
        result = {name: [asdict(row) for row in rows] for name, rows in worlds.items()}
    else:
        rows = table(options.runs, options.ticks, options.seed, options.only)
        result = {"summary": summary(rows), "cells": [asdict(row) for row in rows]}
    print(f"{time.process_time() - start:.0f} CPU-seconds")
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + "\n")


if __name__ == "__main__":
    main()
