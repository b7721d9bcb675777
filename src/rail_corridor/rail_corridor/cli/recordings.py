"""``rail report`` and ``rail replay``: what is done with a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_recording
from .usage import UsageError, check_library, check_writable

Recording = Annotated[
    Path,
    typer.Argument(
        help="A recording: an MCAP file.",
        metavar="FILE.mcap",
        autocompletion=complete_recording,
    ),
]


def add_to(app: typer.Typer) -> None:
    """Add the commands to an application."""
    app.command()(report)
    app.command()(replay)


def report(
    recording: Recording,
    json: Annotated[
        Path | None, typer.Option("--json", help="Write the report as JSON.", metavar="FILE")
    ] = None,
) -> None:
    """Report of a recorded run, computed anew from what was recorded."""
    if json is not None:
        check_writable("--json", json)
    check_library()
    from rich.console import Console

    from rail_corridor.report.from_recording import show_report

    raise typer.Exit(show_report(recording, json, Console()))


def replay(
    recording: Recording,
    rate: Annotated[
        float, typer.Option("--rate", help="Simulated seconds per second.", metavar="R")
    ] = 1.0,
    start: Annotated[
        float,
        typer.Option("--start", help="Start at this simulated time, in s.", metavar="S"),
    ] = 0.0,
    duration: Annotated[
        float | None,
        typer.Option("--duration", help="Simulated time to publish, in seconds.", metavar="S"),
    ] = None,
    topics: Annotated[
        list[str] | None,
        typer.Option(
            "--topics", help="Only this topic, and the clock; repeatable.", metavar="NAME"
        ),
    ] = None,
) -> None:
    """Publish a recorded run again, paced, with its clock."""
    if not 0.001 <= rate <= 1000.0:
        raise UsageError(f"--rate: {rate}: must be from 0.001 to 1000")
    if not 0.0 <= start <= 1e9:
        raise UsageError(f"--start: {start}: must be from 0 to 1e9 s")
    if duration is not None and not 0.0 < duration <= 1e9:
        raise UsageError(f"--duration: {duration}: must be above 0, at most 1e9 s")
    check_library()
    from rich.console import Console

    from rail_corridor.recording.replay import ReplayOptions
    from rail_corridor.recording.replay import replay as replay_recording

    options = ReplayOptions(rate, start, duration, tuple(topics or ()))
    raise typer.Exit(replay_recording(recording, options, Console()))
