"""The display of a study that runs: what is done, failed, under way, and how long it will take."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


class Show(Protocol):
    """Shows how far a study has come."""

    def __call__(self, done: int, failed: int, running: int, wanted: int) -> None:
        """Numbers of runs; those that are wanted may become fewer when a rule ends a cell."""


@contextmanager
def progress(console: Console, name: str) -> Iterator[Show]:
    """A display that is gone when its block ends."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[state]}"),
        TimeElapsedColumn(),
        TextColumn("to go"),
        TimeRemainingColumn(elapsed_when_finished=False),
    )
    with Progress(*columns, console=console, transient=True, refresh_per_second=2) as display:
        task = display.add_task(name, total=None, state="starting workers")

        def show(done: int, failed: int, running: int, wanted: int) -> None:
            state = f"[red]{failed} failed[/red], " if failed else ""
            state += f"{running} running" if running else "no worker yet"
            display.update(task, completed=done, total=wanted, state=state)

        yield show
