"""The kill campaign: any single piece of equipment dies at any time, and no train is in danger.

Each run is a scenario drawn from a seed of its own and goes through the same node graph, in a
process of its own, as ``rail run ... --kill NODE@SECONDS`` does. A campaign passes when no train
passes its end of authority, runs too fast or comes within a touch of another, and nobody believes
a wrong place or an authority that nobody gave. What stops the trains is counted, not judged.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from rail_corridor.run.child_run import RunFailedError, report_of

from .kill_scenarios import DURATION_S, TICK_S, KillCase, draw_case

#: Wall time after which a silent node is given up [s], a fraction of it for each: long, as on a
#: busy host living nodes would be given up too, and the run be no longer one of a single failure.
_SILENCE_S = 40.0
_RUN_TIMEOUT_S = 600.0


@dataclass(frozen=True)
class KillRow:
    """One run: what died and when [s], and what came of it.

    Parameters
    ----------
    seed : int
        Repeats the run.
    kind, node : str
    killed_s, loss_db : float
        Time of the kill [s], and loss on every link of the train radio [dB].
    train_stop : bool
        Whether a train stopped unexpectedly too.
    complete : bool
        Whether the corridor went on to the end of the run.
    given_up : tuple of str
        Nodes that the corridor did not wait for any longer, the dead one among them.
    braked, emergencies : int
        How often protection braked moving trains, and how often by the emergency brake.
    furthest_m, shortest_m : float
        Way of the trains that went furthest and least far [m].
    passed_authority : int
        Ticks in which a moving train was past its end of authority.
    least_gap_m : float
        Least distance to the rear of a train ahead [m].
    overspeed_s : float
        Time above a limit [s].
    forged_accepted, mislocated : int
        Authorities in force that nobody gave; ticks outside the interval that a train believed.
    """

    seed: int
    kind: str
    node: str
    killed_s: float
    loss_db: float
    train_stop: bool
    complete: bool
    given_up: tuple[str, ...]
    braked: int
    emergencies: int
    furthest_m: float
    shortest_m: float
    passed_authority: int
    least_gap_m: float
    overspeed_s: float
    forged_accepted: int
    mislocated: int

    @property
    def touched(self) -> bool:
        """Whether a train touched another."""
        return not self.least_gap_m > 0.0

    @property
    def violations(self) -> tuple[str, ...]:
        """Everything that must not happen; empty in a good run."""
        happenings = {
            "passed its end of authority": self.passed_authority,
            "touched another train": self.touched,
            "overspeed": self.overspeed_s,
            "authority that nobody gave": self.forged_accepted,
            "wrong place believed": self.mislocated,
            "did not go on": not self.complete,
            "the dead node was not missed": self.node not in self.given_up,
        }
        return tuple(name for name, happened in happenings.items() if happened)


def row_of(case: KillCase, report: dict[str, Any]) -> KillRow:
    """Row of a case and its report."""
    trains = report["trains"].values()
    gaps_m = [train["atp"]["margin_min_m"] for train in trains]
    ways_m = [train["distance_m"] for train in trains]

    def total(section: str, name: str) -> Any:
        return sum(train[section][name] for train in trains)

    return KillRow(
        seed=case.seed,
        kind=case.kind,
        node=case.kill.node,
        killed_s=case.kill.time_s,
        loss_db=case.data["cbtc"]["extra_loss_db"],
        train_stop="faults" in case.data,
        complete=report["complete"] and report["ticks"] == round(DURATION_S / TICK_S),
        given_up=tuple(failed["node"] for failed in report["failures"]),
        braked=total("atp", "interventions"),
        emergencies=total("atp", "emergency_brakes"),
        furthest_m=max(ways_m),
        shortest_m=min(ways_m),
        passed_authority=total("atp", "passed_authority"),
        # The first of the trains has none ahead of it; all the others always have.
        least_gap_m=min(gap_m for gap_m in gaps_m if gap_m is not None),
        overspeed_s=total("atp", "overspeed_s"),
        forged_accepted=total("cbtc", "forged_accepted"),
        mislocated=total("cbtc", "mislocated"),
    )


def run_kill_campaign(runs: int, seed: int, console: Console) -> Iterator[KillRow]:
    """Make so many runs, with seeds from the first one on; yield their rows.

    Raises
    ------
    RunFailedError
        If a run did not come to its report.
    """
    for number in range(runs):
        row = run_case(draw_case(seed + number))
        text = ", ".join(row.violations) or "safe"
        console.print(
            f"{number + 1} of {runs}, seed {row.seed}: {row.node} at {row.killed_s:.2f} s, "
            f"least gap {row.least_gap_m:.1f} m: {text}",
            style="bold red" if row.violations else "dim",
            soft_wrap=True,
        )
        yield row


def kill_campaign(runs: int, seed: int, console: Console, path: Path | None = None) -> int:
    """Make a campaign, show it, write it; return the exit code, 1 after a violation."""
    rows: list[KillRow] = []
    try:
        for row in run_kill_campaign(runs, seed, console):
            rows.append(row)
    except RunFailedError as error:
        print(f"rail: {error}", file=sys.stderr)
        return 1
    finally:
        # Also after an interrupt: what is done is worth seeing.
        print_kill_rows(rows, console)
        if path is not None:
            write_kill_rows(rows, path)
    return 1 if any(row.violations for row in rows) else 0


def run_case(case: KillCase) -> KillRow:
    """Run one case in a process of its own.

    Raises
    ------
    RunFailedError
        If it did not come to its report.
    """
    label = f"seed {case.seed}, {case.kill.node} at {case.kill.time_s} s"
    arguments = ["--timeout", str(_SILENCE_S), "--kill", f"{case.kill.node}@{case.kill.time_s}"]
    report = report_of(case.data, label, timeout_s=_RUN_TIMEOUT_S, arguments=arguments)
    return row_of(case, report)


def print_kill_rows(rows: Iterable[KillRow], console: Console) -> None:
    """Show the campaign as a table of kinds, and every run with a violation."""
    table = Table(title="Kill campaign", title_justify="left", title_style="bold")
    table.add_column("killed")
    headings = (
        "runs",
        "passed",
        "touched",
        "least\ngap m",
        "over-\nspeed s",
        "forged",
        "wrong\nplace",
    )
    for heading in (*headings, "braked", "emer-\ngency", "shortest\nway m"):
        table.add_column(heading, justify="right")
    by_kind: dict[str, list[KillRow]] = {}
    for row in rows:
        by_kind.setdefault(row.kind, []).append(row)
    total = [row for group in by_kind.values() for row in group]
    for kind, group in [*sorted(by_kind.items()), ("all", total)] if total else ():
        table.add_row(
            kind,
            str(len(group)),
            str(sum(row.passed_authority for row in group)),
            str(sum(row.touched for row in group)),
            f"{min(row.least_gap_m for row in group):.1f}",
            f"{sum(row.overspeed_s for row in group):.1f}",
            str(sum(row.forged_accepted for row in group)),
            str(sum(row.mislocated for row in group)),
            str(sum(row.braked for row in group)),
            str(sum(row.emergencies for row in group)),
            f"{min(row.shortest_m for row in group):.0f}",
        )
    console.print(table)
    for row in total:
        if row.violations:
            what = f"seed {row.seed}, {row.node} killed at {row.killed_s:.2f} s"
            console.print(f"[red]{what}:[/red] {', '.join(row.violations)}", soft_wrap=True)


def write_kill_rows(rows: Iterable[KillRow], path: Path) -> None:
    """Write the campaign as a list of objects, one per run."""
    dicts = [asdict(row) | {"violations": row.violations} for row in rows]
    path.write_text(json.dumps(dicts, indent=2) + "\n")
