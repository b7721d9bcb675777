"""The threat campaign on the screen and in a file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from .threats import CampaignRow, run_threat_campaign


def threat_campaign(frames: int, seed: int, console: Console, path: Path | None = None) -> int:
    """Make the campaign, show it, write it; return the exit code, 1 if anything false was taken."""
    rows = run_threat_campaign(frames, seed=seed)
    print_threat_rows(rows, console)
    if path is not None:
        write_threat_rows(rows, path)
    return 1 if any(row.wrongly_accepted for row in rows) else 0


def print_threat_rows(rows: Iterable[CampaignRow], console: Console) -> None:
    """Show the rows as a table."""
    table = Table(
        title="frames under the threats of EN 50159", title_justify="left", title_style="bold"
    )
    headings = (
        "threat",
        "frames",
        "restarts",
        "attacks",
        "arrived",
        "rejected",
        "taken",
        "wrongly",
    )
    for heading in headings:
        table.add_column(heading, justify="left" if heading == "threat" else "right", no_wrap=True)
    for row in rows:
        wrong = sum(row.wrongly_accepted.values())
        rejected = sum(row.rejected.values())
        counts = (row.frames, row.restarts, row.attacks, row.arrived, rejected, row.accepted)
        shown = f"[red]{wrong}[/red]" if wrong else "0"
        table.add_row(row.threats, *(str(count) for count in counts), shown)
    console.print(table)


def write_threat_rows(rows: Iterable[CampaignRow], path: Path) -> None:
    """Write the campaign as a list of objects, one per row."""
    # What `asdict` makes of a Counter counts its items.
    dicts = [
        asdict(row)
        | {"wrongly_accepted": dict(row.wrongly_accepted), "rejected": dict(row.rejected)}
        for row in rows
    ]
    path.write_text(json.dumps(dicts, indent=2) + "\n")
