"""The bar of a run on the screen."""

from __future__ import annotations

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn


def progress_of(console: Console) -> Progress:
    """Bar of simulated seconds; its tasks have a field ``speed``."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(bar_width=None),
        TextColumn("{task.completed:.1f} of {task.total:.0f} s  {task.fields[speed]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
