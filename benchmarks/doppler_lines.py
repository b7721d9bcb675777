"""Positions by Doppler shifts over the whole of two real lines, in both directions.

The world, the medium and the positioner are those of the corridor (scenario
`real_line_sensors`), driven tick by tick without a graph: a train runs the line with its stops,
hears the tones of the stations beside it, and its positioner is put into service to 50 m. From
there on it has nothing but the blocks. The bound is the Cramér-Rao bound of the same blocks, the
offset carried on as the positioner does. Most of the error is that of the stations' oscillators,
drawn once a run: runs with several seeds are counted together.

Songjiazhuang-Yizhuang comes without curvatures: a straight line of that length, the worst case.

    python benchmarks/doppler_lines.py [FOLDER] [--spacing 600] [--offset 20] [--every 1]
                                       [--seeds 4] [--json FILE]

FOLDER holds the TTOBench files, ../shared/data beside the project unless given.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rail_corridor.equipment.doppler.placement import references_of
from rail_signals.arrays import FloatArray

# Before NumPy is loaded; harmless, and without effect, where it is loaded already.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from rail_corridor.equipment.doppler.nodes import positioning_nodes
from rail_corridor.equipment.doppler.reference_coverage import ReferencedTrack
from rail_corridor.equipment.doppler.world import reference_description
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE
from rail_onboard.doppler.positioner import DopplerPositioner
from rail_onboard.doppler.positioner_node import DopplerPositionerParameters, positioner_of
from rail_signals.doppler.signal import reference_tone
from rail_signals.doppler.solver import NoFixReason
from rail_world.doppler.medium import ReferenceMedium
from rail_world.trains.traffic import Traffic

FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data"
LINES = ("CN_Songjiazhuang_Yizhuang", "CH_StGallen_Wil")
MOVING_MPS = 20.0 / 3.6


def positioner_in(scenario: Scenario) -> DopplerPositioner:
    """The positioner of the only train, as the corridor configures it."""
    nodes = positioning_nodes(scenario, world_file="", timeout_s=30.0)
    (mine,) = (node for node in nodes if node.kind == "doppler_positioner")
    known = DopplerPositionerParameters.__dataclass_fields__
    return positioner_of(
        DopplerPositionerParameters(**{k: v for k, v in mine.parameters.items() if k in known})
    )


class Run(NamedTuple):
    """What was found along a line, arrays over the blocks; NaN and infinite where nothing."""

    chainage_m: FloatArray
    speed_mps: FloatArray
    found_m: FloatArray
    sigma_m: FloatArray
    bound_m: FloatArray
    reasons: collections.Counter[str]
    off_track: int
    cpu_s: float


def follow(scenario: Scenario, every: int) -> Run:
    """Position the train of a scenario all along its line."""
    described, plan = reference_description(scenario), scenario.references
    assert described is not None and plan is not None
    medium = ReferenceMedium(described, scenario.network, scenario.seed)
    traffic = Traffic(scenario.trains, scenario.network, scenario.tick_s)
    positioner = positioner_in(scenario)
    level = 10.0 ** (plan.power_dbm / 20.0)
    tones = [level * reference_tone(plan.tones, slot) for slot in range(plan.slots)]
    sent = {index: tones[s.slot] for index, s in enumerate(references_of(scenario))}
    rows = []
    reasons: collections.Counter[str] = collections.Counter()
    cpu_s, last_s = 0.0, 0.0
    for tick in range(0, scenario.ticks):
        if tick:
            traffic.step()
        if tick % every:
            continue
        time_s = tick * scenario.tick_s
        state = traffic.state()
        block = medium.receive(tick, time_s, state, sent).get(0)
        begin = time.process_time()
        answer = positioner.locate(block, time_s - last_s)
        cpu_s += time.process_time() - begin
        last_s = time_s
        fix = answer.fix if answer.reason is NoFixReason.NONE else None
        found = (np.nan, np.nan) if fix is None else (fix.chainage_m, fix.sigma_m)
        rows.append(
            (state[0, STATE.index["chainage_m"]], state[0, STATE.index["speed_mps"]], *found)
        )
        if fix is None and abs(rows[-1][1]) >= MOVING_MPS:
            reasons[answer.reason.name.lower()] += 1
        if traffic.all_arrived:
            break
    chainage_m, speed_mps, found_m, sigma_m = np.array(rows).T
    given = np.isfinite(found_m)
    track = ReferencedTrack.of(scenario, scenario.trains[0].route[0])
    bound_m = track.run_bound_m(chainage_m, speed_mps, given, every * scenario.tick_s)
    off_track = (found_m < track.line.start_m) | (found_m > track.line.end_m)
    return Run(
        chainage_m, speed_mps, found_m, sigma_m, bound_m, reasons, int(off_track.sum()), cpu_s
    )


def figures(runs: Sequence[Run]) -> dict[str, Any]:
    """Figures of all runs over one line together."""
    columns = [np.concatenate(values) for values in zip(*(run[:5] for run in runs), strict=True)]
    chainage_m, speed_mps, found_m, sigma_m, bound_m = columns
    given, moving = np.isfinite(found_m), np.abs(speed_mps) >= MOVING_MPS
    error_m = np.abs(found_m - chainage_m)[given]
    each = [run.found_m - run.chainage_m for run in runs]
    shares = [
        rms(error[np.isfinite(error)] / run.bound_m[np.isfinite(error)])
        for error, run in zip(each, runs, strict=True)
    ]
    return {
        "blocks": chainage_m.size,
        "km": abs(runs[0].chainage_m[-1] - runs[0].chainage_m[0]) / 1000.0,
        "available": float(given.mean()),
        "available_moving": float(given[moving].mean()),
        "rmse_m": rms(error_m),
        "bound_m": rms(bound_m[given]),
        "ratio": rms(error_m / bound_m[given]),
        "ratios": shares,
        "p95_m": float(np.quantile(error_m, 0.95)),
        "max_m": float(error_m.max()),
        "stated": rms(error_m / sigma_m[given]),
        "beyond_5_sigma": int(np.count_nonzero(error_m > 5.0 * sigma_m[given])),
        "off_track": sum(run.off_track for run in runs),
        "us": 1e6 * sum(run.cpu_s for run in runs) / chainage_m.size,
        "moving_without": dict(sum((run.reasons for run in runs), collections.Counter())),
    }


def rms(values: FloatArray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def main() -> None:
    """Run every line in both directions and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--spacing", type=float, default=600.0, help="between stations [m]")
    parser.add_argument("--offset", type=float, default=20.0, help="off the track [m]")
    parser.add_argument("--every", type=int, default=1, help="use one block of so many")
    parser.add_argument("--seeds", type=int, default=4, help="runs with other oscillators")
    parser.add_argument("--json", type=Path, help="file to write")
    options = parser.parse_args()
    found = []
    print(
        "line                          km blocks  known moving   RMSE  bound  ratio    p95    max"
    )
    for name in LINES:
        for reverse in (False, True):
            runs = []
            for seed in range(1, options.seeds + 1):
                overrides = Overrides(
                    seed=seed,
                    track=options.folder / f"{name}.json",
                    sections={"--spacing": options.spacing, "--offset": options.offset},
                    reverse=reverse,
                )
                scenario = load_scenario("real_line_sensors", overrides=overrides)
                runs.append(follow(scenario, options.every))
            row = figures(runs)
            print(
                f"{name:26} {'-' if reverse else '+'} {row['km']:6.2f} {row['blocks']:6d}"
                f" {row['available']:6.1%} {row['available_moving']:6.1%} {row['rmse_m']:6.3f}"
                f" {row['bound_m']:6.3f} {row['ratio']:6.3f} {row['p95_m']:6.3f}"
                f" {row['max_m']:6.2f}"
            )
            print(
                f"    error over stated {row['stated']:.3f}, beyond five sigma"
                f" {row['beyond_5_sigma']}, off the track {row['off_track']},"
                f" {row['us']:.0f} us a block; moving without: {row['moving_without']};"
                f" ratios of the runs {min(row['ratios']):.2f} to {max(row['ratios']):.2f}",
                flush=True,
            )
            found.append({"line": name, "direction": -1 if reverse else 1, **row})
    if options.json:
        options.json.write_text(json.dumps(found, indent=2) + "\n")


if __name__ == "__main__":
    main()
