"""The handover campaign: many trains over many stations, every change of channel counted.

Each run is a generated scenario with a seed of its own and goes through the same node graph, in
a process of its own, as ``rail run`` does. A campaign passes when no handover is missed, none
goes to a wrong channel, and no position that is claimed to be known is false.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from rail_corridor.run.child_run import RunFailedError, faultless_report_of

from .handover_scenarios import MOST_TRAINS, Situation, scenario_data

_RUN_TIMEOUT_S = 1800.0


@dataclass
class HandoverRow:
    """Counts of one situation over all of its runs.

    ``misleading_ticks`` counts positions claimed to be known that are off by more than six
    sigma and one metre, or on the wrong track; ``furthest_m`` is the longest distance from the
    station at which a channel changed.
    """

    situation: Situation
    runs: int = 0
    trains: int = 0
    ticks: int = 0
    crossings: int = 0
    made: int = 0
    missed: int = 0
    wrong: int = 0
    wrong_track_ticks: int = 0
    misleading_ticks: int = 0
    furthest_m: float = 0.0
    availability: float = 1.0
    bad_seeds: list[int] = field(default_factory=list)

    def add(self, report: dict[str, Any]) -> None:
        """Add the report of one run."""
        violations = self.violations
        self.runs += 1
        for train in report["trains"].values():
            changes, ranging = train["handovers"], train["phase_ranging"]
            self.trains += 1
            self.crossings += changes["expected"]
            self.made += changes["made"]
            self.missed += changes["missed"]
            self.wrong += changes["wrong"]
            self.wrong_track_ticks += ranging["wrong_track_ticks"]
            self.misleading_ticks += ranging["misleading_ticks"]
            self.furthest_m = max(self.furthest_m, changes["furthest_m"] or 0.0)
            self.availability = min(self.availability, ranging["availability"] or 0.0)
        self.ticks += report["ticks"]
        if self.violations > violations:
            self.bad_seeds.append(report["seed"])

    @property
    def violations(self) -> int:
        """Everything that must not happen."""
        return self.missed + self.wrong + self.wrong_track_ticks + self.misleading_ticks


def run_campaign(
    situations: Iterable[Situation], crossings: int, seed: int, console: Console
) -> Iterator[HandoverRow]:
    """Run every situation until it has made so many crossings; yield its counts.

    Raises
    ------
    RunFailedError
        If a run did not come to its report.
    """
    for situation in situations:
        row = HandoverRow(situation)
        while row.crossings < crossings:
            trains = MOST_TRAINS[situation.manoeuvre]
            if row.trains:
                still_needed = (crossings - row.crossings) * row.trains / max(1, row.crossings)
                trains = min(trains, int(still_needed) + 1)
            else:
                trains = min(trains, crossings // 15 + 1)
            made = row.crossings
            data = scenario_data(situation, trains, seed + row.runs)
            label = f"{data['name']}, seed {data['seed']}"
            row.add(faultless_report_of(data, label, timeout_s=_RUN_TIMEOUT_S))
            console.print(
                f"{situation.name}: {row.crossings} crossings in {row.runs} runs, "
                f"{row.violations} violations",
                style="dim",
            )
            if row.crossings == made:
                raise RunFailedError(f"{situation.name}: no train crossed a station")
        yield row


def print_rows(rows: Iterable[HandoverRow], console: Console) -> None:
    """Show the campaign as a table."""
    table = Table(title="Handover campaign", title_justify="left", title_style="bold")
    table.add_column("situation")
    for heading in ("speed\nkm/h", "trains", "cross-\nings", "made", "missed", "wrong"):
        table.add_column(heading, justify="right")
    for heading in ("wrong\ntrack", "false\nplace", "change\nwithin"):
        table.add_column(heading, justify="right")
    for row in rows:
        situation = row.situation
        counts = (row.trains, row.crossings, row.made, row.missed, row.wrong)
        table.add_row(
            f"{situation.corridor}, {situation.manoeuvre}",
            f"{situation.speed_kmh:.0f}",
            *(str(count) for count in (*counts, row.wrong_track_ticks, row.misleading_ticks)),
            f"{row.furthest_m:.1f} m",
        )
        if row.bad_seeds:
            table.caption = f"look at seeds {', '.join(map(str, row.bad_seeds))}"
    console.print(table)


def write_rows(rows: Iterable[HandoverRow], path: Path) -> None:
    """Write the campaign as a list of objects, one per situation."""
    path.write_text(json.dumps([asdict(row) for row in rows], indent=2) + "\n")
