"""A reflectogram of one car's bus cable with a bad splice in it, as a file for the workshop.

Run:  python examples/bus_trace.py bad_splice.csv && rail tdr bad_splice.csv --profile CM2
See:  a table of length, impedance and attenuation, the splice of 20 ohm at 23 m, and "fail".
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from rail_signals.train_bus.consist import Deviations
from rail_signals.train_bus.faults import BadSplice
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.tdr.reflectometer import Reflectometer, measure_consist
from rail_signals.train_bus.train import cable_consist

TRACES = 4


def main() -> None:
    """Measure a cable as it might have been made, and write the traces."""
    rng = np.random.default_rng(7)
    instrument = Reflectometer(load_bus_profile("CM2").termination_ohm)
    built = Deviations.draw(1, rng)
    seen = measure_consist(
        cable_consist("CM2"), built, instrument, rng, TRACES, BadSplice(23.0, 20.0)
    )
    names = ["time_ns", "reflection", *(f"reflection_{k}" for k in range(2, TRACES + 1))]
    rows = np.column_stack((1e9 * seen.time_s, seen.reflection.T))
    lines = [",".join(names)]
    lines += [f"{time:.2f}," + ",".join(f"{x:.5f}" for x in row) for time, *row in rows]
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "bad_splice.csv")
    path.write_text("# car CM2, from its head, terminated\n" + "\n".join(lines) + "\n")
    print(f"{path}: {TRACES} traces of {len(rows)} samples")


if __name__ == "__main__":
    main()
