"""Bit error rate against Eb/N0 of four diversity schemes, counted and in closed form.

BPSK through Rayleigh fading, a channel per code block of two symbols, known to the receiver:
Fig 3 of An, Kim and Jeong with two more schemes. Eb/N0 is that of each receiver at a fixed
total transmitted power. Wherever the closed form is above 1e-6, at least 400 errors are
counted; elsewhere what 2e7 bits hold. Then the floors that a moving train leaves when the
combiner takes the first symbol's channel for both (eq 3): 2.4 GHz, no noise, 10 and 66.7 us
from symbol to symbol. Intervals are of 99.9 %; one in a thousand may miss.

Usage::

    python benchmarks/cbtc_ber_curve.py [--step 1] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from rail_signals.train_radio.ber.closed_form import SCHEMES, error_rate
from rail_signals.train_radio.ber.link import DiversityLink
from rail_signals.train_radio.ber.monte_carlo import until
from rail_signals.train_radio.ber.stale_channel import jakes_correlation, stale_error_rate
from rail_signals.train_radio.space_time_block import Scheme

CONFIDENCE = 0.999
ERRORS = 400
COUNTED_ABOVE = 1e-6
CARRIER_HZ = 2.4e9
SPEEDS_KMH = (300.0, 500.0)
INTERVALS_S = (10e-6, 66.7e-6)


@dataclass(frozen=True)
class Point:
    """One line of the table; `eb_n0_db` is None for a floor, `speed_kmh` for a curve."""

    scheme: str
    eb_n0_db: float | None
    speed_kmh: float | None
    interval_s: float | None
    closed_form: float
    errors: int
    bits: int
    low: float
    high: float
    inside: bool

    def __str__(self) -> str:
        if self.interval_s is None:
            case = f"{self.eb_n0_db:5.1f} dB"
        else:
            case = f"{self.speed_kmh:.0f} km/h, {self.interval_s * 1e6:.1f} us"
        rate = f"{self.errors / self.bits:.3e}" if self.errors else "0"
        return (
            f"{self.scheme:13} {case:17} {self.closed_form:.3e}  {rate:9}"
            f"  [{self.low:.3e}, {self.high:.3e}]  {self.errors:6d} / {self.bits:.1e}"
            f"  {'yes' if self.inside else 'NO'}"
        )


def curve_point(scheme: Scheme, eb_n0_db: float, generator: np.random.BitGenerator) -> Point:
    """Count at one level."""
    eb_n0 = 10 ** (eb_n0_db / 10)
    link = DiversityLink(scheme, eb_n0, bits_per_symbol=1)
    expected = float(error_rate(scheme, eb_n0, bits_per_symbol=1))
    return _count(link, expected, generator, eb_n0_db, None, None)


def floor_point(
    scheme: Scheme, speed_kmh: float, interval_s: float, generator: np.random.BitGenerator
) -> Point:
    """Count the floor at one speed."""
    rho = jakes_correlation(speed_kmh / 3.6, CARRIER_HZ, interval_s)
    link = DiversityLink(scheme, math.inf, bits_per_symbol=1, correlation=rho)
    expected = float(stale_error_rate(scheme, math.inf, rho, bits_per_symbol=1))
    return _count(link, expected, generator, None, speed_kmh, interval_s)


def _count(
    link: DiversityLink,
    expected: float,
    generator: np.random.BitGenerator,
    eb_n0_db: float | None,
    speed_kmh: float | None,
    interval_s: float | None,
) -> Point:
    most = 10 * ERRORS / expected if expected > COUNTED_ABOVE else 2e7
    found = until(
        link,
        generator,
        half_width=0.2,
        confidence=CONFIDENCE,
        min_errors=ERRORS,
        max_bits=most,
    )
    return Point(
        link.scheme.name,
        eb_n0_db,
        speed_kmh,
        interval_s,
        expected,
        found.errors,
        found.bits,
        *found.interval,
        found.holds(expected),
    )


def measure(step_db: float, seed: int) -> list[Point]:
    """All points, printed as they come."""
    generator = np.random.SFC64(seed)
    print(
        f"{'scheme':13} {'case':17} {'theory':9}  {'counted':9}"
        f"  {'99.9 % interval':22}  {'errors / bits':16}  inside"
    )
    points = []
    for scheme in SCHEMES.values():
        for eb_n0_db in np.arange(0.0, 20.0 + step_db / 2, step_db).tolist():
            points.append(curve_point(scheme, eb_n0_db, generator))
            print(points[-1], flush=True)
    for scheme in SCHEMES.values():
        for interval_s in INTERVALS_S:
            for speed_kmh in SPEEDS_KMH:
                points.append(floor_point(scheme, speed_kmh, interval_s, generator))
                print(points[-1], flush=True)
    return points


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--step", type=float, default=5.0, help="between levels [dB]")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    start = time.process_time()
    points = measure(options.step, options.seed)
    cpu_s = time.process_time() - start
    inside = sum(p.inside for p in points)
    few = [p for p in points if p.closed_form > COUNTED_ABOVE and p.errors < ERRORS]
    print(f"{inside} of {len(points)} inside, {len(few)} with fewer errors than {ERRORS},", end=" ")
    print(f"{sum(p.bits for p in points):.2e} bits, {cpu_s:.1f} CPU-seconds")
    if options.json:
        table = {"cpu_s": cpu_s, "seed": options.seed, "points": [asdict(p) for p in points]}
        options.json.write_text(json.dumps(table, indent=2) + "\n")


if __name__ == "__main__":
    main()
