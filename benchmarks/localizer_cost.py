"""What a tick of the localizer costs, beside additions of two small arrays.

    python benchmarks/localizer_cost.py [--ticks N] [--json FILE]

One train with ranges and wheels, and one with Doppler fixes as well: time of a tick in
microseconds, and in additions of two arrays of 7 x 11, which the same process makes between the
ticks.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.readings import DopplerFix, RangeFix, TickMeasurements, WheelSpeed
from rail_signals.localizer.settings import LocalizerSettings


def cost(ticks: int) -> dict[str, float]:
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
    parser.add_argument("--ticks", type=int, default=3000)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    times_us = cost(options.ticks)
    if options.json:
        options.json.write_text(json.dumps(times_us, indent=2) + "\n")


if __name__ == "__main__":
    main()
