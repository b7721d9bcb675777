"""What the engine of studies costs, and what a second worker gains, on many runs of one scenario.

engine       runs through the engine and one worker; the peer is a bare loop over the same runs in a
             process of its own. Both have made a first tick before.
two_workers  the study as a whole, from the start of its workers to its files; the peer is the same
             with one worker.
"""

from __future__ import annotations

import hashlib
import io
import json
import multiprocessing
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

from rich.console import Console

from rail_corridor.loading.loader import builtin_scenarios
from rail_corridor.study.cells import Case, case_of, cells_of
from rail_corridor.study.cluster import client_of
from rail_corridor.study.engine import Engine
from rail_corridor.study.figures import Figure
from rail_corridor.study.model import Study
from rail_corridor.study.run_study import Where, run_study
from rail_corridor.study.sources import ScenarioSource
from rail_corridor.study.version import code_version
from rail_corridor.yaml_file import load_yaml

RUNS = 40
#: All are measured in turns, and the least times are compared.
ROUNDS = 3
SCENARIO = "demo"
STUDY = Study(
    name="speed",
    scenario=SCENARIO,
    runs=RUNS,
    figures={"rmse_m": Figure(of="trains.*.phase_ranging.rmse_m", take="max")},
)


def source() -> ScenarioSource:
    """Where the runs come from."""
    path = builtin_scenarios()[SCENARIO]
    return ScenarioSource(load_yaml(path), path.parent)


def cases() -> list[Case]:
    """The runs of the study."""
    return [case_of(STUDY, cells_of(STUDY), 0, run) for run in range(RUNS)]


def bare_loop() -> float:
    """Make the runs one after the other; wall time [s]."""
    where, (first, *_) = source(), cases()
    where.try_out(first.values, first.seed, STUDY.figures)
    begun_s = time.perf_counter()
    for case in cases():
        where.run(case.values, case.seed, STUDY.figures)
    return time.perf_counter() - begun_s


def bare_s() -> float:
    """Wall time of the bare loop in a process of its own [s]."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        return pool.submit(bare_loop).result()


def engine_s() -> float:
    """Wall time of the runs through the engine and one worker [s]."""
    waiting = cases()

    def more(count: int) -> list[Case]:
        return [waiting.pop(0) for _ in range(min(count, len(waiting)))]

    with client_of(None, 1) as client:
        engine = Engine(client, source(), STUDY.figures, STUDY.timeout_s, code_version())
        engine.try_out(waiting[0])
        begun_s = time.perf_counter()
        made = list(engine.results(more))
        wall_s = time.perf_counter() - begun_s
    if any(entry.failure for entry in made):
        raise RuntimeError("a run has failed")
    return wall_s


def study_s(workers: int) -> tuple[float, str]:
    """Wall time of the study [s], and a digest of its rows."""
    quiet = Console(file=io.StringIO())
    with tempfile.TemporaryDirectory() as folder:
        begun_s = time.perf_counter()
        run_study(STUDY, source(), Path(folder), quiet, "", where=Where(workers=workers))
        wall_s = time.perf_counter() - begun_s
        rows = (Path(folder) / "rows.csv").read_bytes()
    return wall_s, hashlib.sha256(rows).hexdigest()


def rows() -> Iterator[dict[str, Any]]:
    """Measure, and yield one row per figure."""
    times_s, digests = [], set()
    for _ in range(ROUNDS):
        (one, of_one), (two, of_two) = study_s(1), study_s(2)
        times_s.append((bare_s(), engine_s(), one, two))
        digests |= {of_one, of_two}
    if len(digests) > 1:
        raise RuntimeError("two workers made other rows than one")
    bare, engine, one, two = map(min, zip(*times_s, strict=True))
    for name, ours, peer_name, peer, bound in (
        ("study.engine", engine, "bare loop", bare, 1.0),
        ("study.two_workers", two, "one worker", one, 2.0),
    ):
        yield {
            "name": name,
            "unit": "runs/s",
            "ours": RUNS / ours,
            "peer_name": peer_name,
            "peer": RUNS / peer,
            "ratio": peer / ours,
            "bound": bound,
        }


if __name__ == "__main__":
    for row in rows():
        print(json.dumps(row))
        sys.stdout.flush()
