"""Running a study: its cells to their ends, the rows and the summary as far as it came."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from itertools import cycle
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from rail_corridor.errors import InputError

from .cells import Case, case_of, cells_of
from .cluster import client_of
from .comparison import moves
from .engine import Engine
from .figures import Figure
from .journal import Entry, Journal, entries_of, fingerprint
from .model import Study
from .picture import draw_study
from .rows import Rows, counting, write_csv, write_parquet
from .sources import Source
from .stopping import Stopping
from .summary import Group, Violation, groups_of, print_summary, text_of, violations_of


class StudyOutcome(NamedTuple):
    """What came of a study."""

    entries: list[Entry]
    groups: list[Group]
    violations: list[Violation]
    failed: list[Entry]


class _Cells:
    """Which case comes next: cell after cell in turn, each until it has had enough."""

    def __init__(self, study: Study) -> None:
        self._study, self._cells = study, cells_of(study)
        self.rules = [Stopping(study.stop, study.figures, study.runs) for _ in self._cells]
        self._next = [0] * len(self._cells)
        self._turn = cycle(range(len(self._cells)))
        self._made: set[tuple[int, int]] = set()

    def take(self, entry: Entry) -> None:
        """A run has ended, now or in an earlier go."""
        self._made.add(entry.key)
        self.rules[entry.cell].add(entry.run, None if entry.failure else entry.figures)

    def more(self, count: int) -> list[Case]:
        """At most so many further cases."""
        cases: list[Case] = []
        idle = 0
        while len(cases) < count and idle < len(self._cells):
            cell = next(self._turn)
            run = self._next[cell]
            while (cell, run) in self._made:
                run += 1
            if self.rules[cell].ended is not None or run >= self._study.runs:
                idle += 1
                continue
            idle = 0
            self._next[cell] = run + 1
            cases.append(case_of(self._study, self._cells, cell, run))
        return cases

    @property
    def ended(self) -> dict[int, int]:
        """Runs after which cells have had enough."""
        return {n: rule.ended for n, rule in enumerate(self.rules) if rule.ended is not None}

    @property
    def wanted(self) -> int:
        """Runs that are wanted, as far as is known."""
        return sum(rule.ended or self._study.runs for rule in self.rules)


def run_study(
    study: Study,
    source: Source,
    out: Path,
    console: Console,
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    resume: bool = False,
    compare: Path | None = None,
) -> StudyOutcome:
    """Run a study; write ``rows.csv``, with pyarrow ``rows.parquet``, and ``summary.png``.

    What has been made is kept in ``journal.jsonl``, so that it can be gone on with; it is
    written out and shown also after an interrupt.

    Raises
    ------
    InputError
        If there is a journal already that is not to be gone on with, or no scheduler.
    """
    before = None if compare is None else journal_of(compare)
    out.mkdir(parents=True, exist_ok=True)
    code = code_version()
    journal = Journal(out / "journal.jsonl", fingerprint(study, code), resume=resume)
    cells = _Cells(study)
    for entry in journal.entries():
        if entry.failure is None:
            cells.take(entry)
    try:
        with client_of(scheduler, workers) as client, _progress(console, study.name) as show:
            engine = Engine(client, source, study.figures, study.timeout_s)
            done = failed = 0
            for entry in engine.results(cells.more):
                journal.add(entry)
                cells.take(entry)
                done, failed = done + 1, failed + (entry.failure is not None)
                show(done, failed, engine.running, cells.wanted)
    finally:
        journal.close()
        outcome = conclude(study, out, code, console, cells.ended)
    if before is not None:
        print_moves(study, before, outcome, console)
    return outcome


def conclude(
    study: Study, out: Path, code: str, console: Console, ended: dict[int, int]
) -> StudyOutcome:
    """Write and show what the journal holds."""
    entries = counting(entries_of(out / "journal.jsonl"), ended)
    figures = study.figures or _figures_of(entries)
    facts = list(dict.fromkeys(name for entry in entries for name in entry.facts))
    rows = Rows(study.name, code, [*study.vary, *study.draw], facts, list(figures))
    write_csv(out / "rows.csv", rows, entries)
    write_parquet(out / "rows.parquet", rows, entries)
    by = list(study.vary) if study.group_by is None else list(study.group_by)
    groups = groups_of(entries, by, figures)
    failed = [entry for entry in entries if entry.failure is not None]
    violations = violations_of(entries, figures)
    print_summary(study.name, groups, by, figures, console)
    if groups:
        draw_study(out / "summary.png", study.name, groups, by, figures)
    for violation in violations[:20]:
        console.print(
            f"[red]{violation.figure} is {violation.value}[/red]: {again(study, violation.entry)}",
            soft_wrap=True,
        )
    for entry in failed[:20]:
        console.print(f"[red]failed:[/red] {entry.failure}", soft_wrap=True, markup=True)
        console.print(f"  again: {again(study, entry)}", soft_wrap=True)
    console.print(f"{len(entries)} rows in {out / 'rows.csv'}", soft_wrap=True)
    return StudyOutcome(entries, groups, violations, failed)


def journal_of(folder: Path) -> list[Entry]:
    """Runs of an earlier study; InputError if there are none in a folder."""
    path = folder / "journal.jsonl"
    if not path.is_file():
        raise InputError("there is no journal.jsonl", field="--compare", value=str(folder))
    return counting(entries_of(path), {})


def print_moves(study: Study, before: list[Entry], outcome: StudyOutcome, console: Console) -> None:
    """Show which figures have moved beyond their intervals."""
    figures = study.figures or _figures_of(outcome.entries)
    by = list(study.vary) if study.group_by is None else list(study.group_by)
    found = moves(groups_of(before, by, figures), outcome.groups, figures)
    for move in found:
        where = ", ".join(f"{name} {value}" for name, value in zip(by, move.key, strict=True))
        said = f"{move.figure}: {text_of(move.before)}, now {text_of(move.now)}"
        console.print(
            f"[yellow]moved:[/yellow] {where + ': ' if where else ''}{said}", soft_wrap=True
        )
    if not found:
        console.print("nothing has moved beyond its interval")


def again(study: Study, entry: Entry) -> str:
    """The command that makes one run once more."""
    return f"rail study {study.name} --only {entry.cell}:{entry.run}"


def _figures_of(entries: list[Entry]) -> dict[str, Figure]:
    """Figures of a calculation whose study names none: all."""
    names = dict.fromkeys(name for entry in entries for name in entry.figures)
    return {name: Figure() for name in names}


@contextmanager
def _progress(console: Console, name: str) -> Iterator[Any]:
    """A display of what is done, failed and under way, and when it will be over."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("[red]{task.fields[failed]}[/red]running {task.fields[running]}"),
        TimeElapsedColumn(),
        TextColumn("to go"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(name, total=None, failed="", running=0)

        def show(done: int, failed: int, running: int, wanted: int) -> None:
            said = f"{failed} failed, " if failed else ""
            progress.update(task, completed=done, total=wanted, failed=said, running=running)

        yield show


def code_version() -> str:
    """Version of the corridor, with the commit where it runs from a checkout."""
    here = Path(__file__).resolve().parent
    command = ["git", "-C", str(here), "describe", "--always", "--dirty"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=5.0)
        commit = done.stdout.strip() if done.returncode == 0 else ""
    except (OSError, subprocess.TimeoutExpired):
        commit = ""
    return f"{version('rail-corridor')}{'+' if commit else ''}{commit}"


def exit_code(outcome: StudyOutcome) -> int:
    """1 if anything that must hold does not, or runs have failed."""
    return 1 if outcome.violations or outcome.failed else 0
