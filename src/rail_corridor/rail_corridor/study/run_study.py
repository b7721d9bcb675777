"""Running a study: its cells to their ends, the results as far as it came."""

from __future__ import annotations

from itertools import cycle
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from .cells import Case, case_of, cells_of
from .cluster import client_of
from .engine import Engine
from .journal import Entries, Entry, Journal, fingerprint
from .model import Study
from .progress import progress
from .results import JOURNAL, conclude, entries_of, print_moves
from .sources import Source
from .stopping import Stopping
from .version import code_version


class Where(NamedTuple):
    """Where runs are made: by so many workers here, or by those of a scheduler."""

    scheduler: str | None = None
    workers: int | None = None


class _Cells:
    """Which case comes next: cell after cell in turn, each until it has had enough."""

    def __init__(self, study: Study) -> None:
        self._study, self._cells = study, cells_of(study)
        self.rules = [Stopping(study.stop, study.figures, study.runs) for _ in self._cells]
        self._next = [0] * len(self._cells)
        self._turn = cycle(range(len(self._cells)))
        self._made: set[tuple[int, int]] = set()

    def take(self, entry: Entry) -> None:
        """A run has ended."""
        self.rules[entry.cell].add(entry.run, None if entry.failure else entry.figures)

    def take_earlier(self, entry: Entry) -> None:
        """A run has ended before the study was gone on with; one that failed is made again."""
        if entry.failure is None:
            self._made.add(entry.key)
            self.take(entry)

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

    @property
    def made(self) -> int:
        """Runs that were made before."""
        return len(self._made)


def run_study(
    study: Study,
    source: Source,
    out: Path,
    console: Console,
    command: str,
    *,
    where: Where | None = None,
    resume: bool = False,
    compare: Path | None = None,
) -> int:
    """Run a study; write ``rows.csv``, with pyarrow ``rows.parquet``, and ``summary.png``.

    What has been made is kept in ``journal.jsonl``, so that it can be gone on with; it is
    written out and shown also after an interrupt.

    Parameters
    ----------
    command : str
        What the user would repeat a run with, but for ``--only``.

    Returns
    -------
    int
        Exit code: 1 if anything that must hold does not, runs have failed, or a figure has moved
        since the study that this one is compared with.

    Raises
    ------
    InputError
        If there is a journal already that is not to be gone on with, no scheduler, or a figure
        that the report has not.
    LostClusterError
        If the scheduler has gone.
    """
    before = None if compare is None else entries_of(compare)
    code = code_version()
    journal = Journal(out / JOURNAL, fingerprint(study, code), resume=resume)
    cells = _Cells(study)
    for entry in Entries(journal.path):
        cells.take_earlier(entry)
    try:
        with progress(console, study.name) as show, client_of(*(where or Where())) as client:
            engine = Engine(client, source, study.figures, study.timeout_s, code)
            first = cells.more(1)
            if first:
                engine.try_out(first[0])
            done, failed = cells.made, 0
            for entry in engine.results(first, cells.more):
                journal.add(entry)
                cells.take(entry)
                done, failed = done + 1, failed + (entry.failure is not None)
                show(done, failed, engine.running, cells.wanted)
    finally:
        journal.close()
        if journal.path.exists():
            counting = Entries(journal.path, cells.ended)
            outcome = conclude(study, counting, out, code, console, command)
    moved = before is not None and print_moves(before, outcome, console)
    return 1 if outcome.violations or outcome.failed or moved else 0
