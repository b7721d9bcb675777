"""Running a study: its cells to their ends, the results as far as it came."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from rail_corridor.errors import InputError

from .cells import Case, case_of, cells_of
from .cluster import client_of
from .engine import Engine
from .journal import Entries, Entry, Header, Journal
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


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold a folder, which is made, against other studies; one that stays empty goes again."""
    folder.mkdir(exist_ok=True)
    held = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            reason = "another study is writing there"
            raise InputError(reason, field="--out", value=str(folder)) from None
        yield
    finally:
        os.close(held)
        if not any(folder.iterdir()):
            folder.rmdir()


class _Cells:
    """Which case comes next: cell after cell in turn, each until it has had enough."""

    def __init__(self, study: Study) -> None:
        self._study, self._cells = study, cells_of(study)
        self.rules = [Stopping(study.stop, study.figures, study.runs) for _ in self._cells]
        self._next = [0] * len(self._cells)
        self._turn = cycle(range(len(self._cells)))
        self._earlier: set[tuple[int, int]] = set()
        #: Runs that have ended, now or before.
        self.made = 0

    def take(self, entry: Entry) -> None:
        """A run has ended."""
        self.made += 1
        self.rules[entry.cell].add(entry.run, None if entry.failure else entry.figures)

    def take_earlier(self, entry: Entry) -> None:
        """A run has ended before the study was gone on with; one that failed is made again."""
        if entry.cell >= len(self._cells):
            raise InputError(f"there is no cell {entry.cell} in the study", file=JOURNAL)
        if entry.failure is None:
            self._earlier.add(entry.key)
            self.take(entry)

    def more(self, count: int) -> list[Case]:
        """At most so many further cases."""
        cases: list[Case] = []
        idle = 0
        while len(cases) < count and idle < len(self._cells):
            cell = next(self._turn)
            run = self._next[cell]
            while (cell, run) in self._earlier:
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
    def over(self) -> bool:
        """Whether every cell has had enough."""
        return all(rule.ended is not None for rule in self.rules)


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
    before = None if compare is None else entries_of(compare, study.name)
    with alone_in(out):
        code = code_version()
        journal = Journal(out / JOURNAL, Header.of(study, source, code), resume=resume)
        cells = _Cells(study)
        for entry in Entries(journal.path):
            cells.take_earlier(entry)
        try:
            if not cells.over:
                _make(study, source, console, where or Where(), code, cells, journal)
        finally:
            journal.close()
            if journal.path.exists():
                counting = Entries(journal.path, cells.ended)
                outcome = conclude(study, counting, out, code, console, command)
                if not cells.over:
                    made = f"{cells.made} of {cells.wanted} runs at most"
                    said = f"[yellow]not over: {made}; go on with --resume[/yellow]"
                    console.print(said, soft_wrap=True)
        moved = before is not None and print_moves(before, outcome, console)
        return 1 if outcome.violations or outcome.failed or moved else 0


def _make(
    study: Study,
    source: Source,
    console: Console,
    where: Where,
    code: str,
    cells: _Cells,
    journal: Journal,
) -> None:
    """Make the runs that are lacking."""
    with progress(console, study.name) as show, client_of(*where) as client:
        engine = Engine(client, source, study.figures, study.timeout_s, code)
        engine.try_out(case_of(study, cells_of(study), 0, 0))
        failed = 0
        for entry in engine.results(cells.more):
            journal.add(entry)
            cells.take(entry)
            failed += entry.failure is not None
            show(cells.made, failed, engine.running, cells.wanted)
