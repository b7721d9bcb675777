"""The link-margin sweep on the screen and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from .points import LinkMarginRow


def print_rows(rows: Iterable[LinkMarginRow], console: Console) -> None:
    """Show the sweep as a table."""
    table = Table(title="Link margin", title_justify="left", title_style="bold")
    table.add_column("scheme", no_wrap=True)
    headings = ("Es/N0\ndB", "lost\n%", "theory\n%", "age 95 %\ns", "headway\ns")
    for heading in (*headings, "not\npassed", "brak-\nings", "per h", "theory\nper h"):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        prediction = row.prediction
        table.add_row(
            row.scheme,
            f"{row.es_n0_db:.1f}",
            _formatted(row.frame_loss, 100.0, 1),
            f"{100.0 * prediction.frame_loss_at_rest:.1f}-{100.0 * prediction.frame_loss:.1f}",
            _formatted(row.age_p95_s, 1.0, 2),
            _formatted(row.headway_s, 1.0, 1),
            f"{row.unpassed}/{row.passings}",
            str(row.brakings),
            _formatted(row.brakings_per_hour, 1.0, 0),
            f"{prediction.brakings_per_hour:.2g}",
        )
    console.print(table)


def write_rows(rows: Iterable[LinkMarginRow], path: Path) -> None:
    """Write the sweep as a list of objects, one per point."""
    records = [asdict(row) | {"brakings_per_hour": row.brakings_per_hour} for row in rows]
    path.write_text(json.dumps(records, indent=2, allow_nan=False) + "\n")


def _formatted(value: float | None, factor: float, digits: int) -> str:
    return "-" if value is None else f"{factor * value:.{digits}f}"
