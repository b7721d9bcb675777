"""Running the sweep: many runs, two at a time, then the table and the figure."""

from __future__ import annotations

import os
import subprocess
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from queue import Queue
from typing import Any, Final

from rich.console import Console

from rail_corridor.loading.schema import parse_scenario
from rail_corridor.run.child_run import RunFailedError, faultless_report_of

from .figure import draw_link_margin
from .points import LOSSES_DB, SCHEMES, LinkMarginRow, Point, aggregate, points, scenario_data
from .table import print_rows, write_rows
from .theory import predict

_WORKERS: Final = 2
_RUN_TIMEOUT_S: Final = 900.0


def run_link_margin(
    out_dir: Path, quick: bool, console: Console, seeds: int = 1
) -> list[LinkMarginRow]:
    """Run the sweep; write ``link_margin.json`` and ``link_margin.png``, show the table.

    Each point is run with so many seeds. Runs go two at a time in the ROS domain of this process
    and the next one.

    Raises
    ------
    RunFailedError
        If runs did not come to their reports; what the others gave is written before.
    """
    out_dir.mkdir(parents=True, exist_ok=True)
    losses = {name: (each[1], *each[3:]) if quick else each for name, each in LOSSES_DB.items()}
    first = int(os.environ.get("ROS_DOMAIN_ID") or "0")
    domains: Queue[int] = Queue()
    for worker in range(_WORKERS):
        domains.put(first + worker)

    failed: list[str] = []

    def run(point: Point) -> dict[str, Any] | None:
        domain = domains.get()
        try:
            data = scenario_data(point)
            report = faultless_report_of(
                data, data["name"], timeout_s=_RUN_TIMEOUT_S, domain=domain
            )
        except (RunFailedError, subprocess.TimeoutExpired) as error:
            failed.append(str(error))
            return None
        finally:
            domains.put(domain)
        console.print(f"{point.name}, seed {point.seed}: done", style="dim")
        return report

    every = points(SCHEMES, losses, quick=quick)
    each = [replace(point, seed=point.seed + n) for point in every for n in range(seeds)]
    with ThreadPoolExecutor(_WORKERS) as pool:
        found = list(pool.map(run, each))
    rows = []
    for index, point in enumerate(every):
        reports = [r for r in found[index * seeds : (index + 1) * seeds] if r is not None]
        if reports:
            prediction = predict(parse_scenario(scenario_data(point)))
            rows.append(aggregate(point, reports, prediction))
    rows.sort(key=lambda row: (SCHEMES.index(row.scheme), row.es_n0_db))
    write_rows(rows, out_dir / "link_margin.json")
    draw_link_margin(rows, out_dir / "link_margin.png")
    print_rows(rows, console)
    if failed:
        raise RunFailedError("; ".join(failed))
    return rows
