"""``rail report`` and ``rail replay``, and of ``rail run`` the options of its recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .completion import complete_recording
from .usage import UsageError, check_library, check_writable

if TYPE_CHECKING:
    from rail_corridor.run.options import RecordOptions

RecordOption = Annotated[
    Path | None,
    typer.Option("--record", help="Record every topic, or those selected.", metavar="FILE.mcap"),
]
RecordTopicsOption = Annotated[
    str | None,
    typer.Option(
        "--record-topics",
        help="Record only topics that fit a pattern of a shell, as '/train_a/*,*/position'; the "
        "clock goes with any. The report can be computed only from all that it reads.",
        metavar="PATTERN[,PATTERN]",
    ),
]
NoWaveformsOption = Annotated[
    bool,
    typer.Option(
        "--no-waveforms",
        help="Record no waveforms: a hundredth of the size, and the same report.",
    ),
]
RecordSplitOption = Annotated[
    float | None,
    typer.Option(
        "--record-split",
        help="Begin another file when one has grown to so many megabytes: FILE.mcap, "
        "FILE_1.mcap and so on.",
        metavar="MB",
    ),
]
Recording = Annotated[
    Path,
    typer.Argument(
        help="A recording: an MCAP file, of several the first.",
        metavar="FILE.mcap",
        autocompletion=complete_recording,
    ),
]


def record_options(
    path: Path | None, topics: str | None, no_waveforms: bool, split_mb: float | None
) -> RecordOptions | None:
    """What to record of a run, None if nothing is; UsageError for what does not fit together."""
    if path is None:
        given = {"--record-topics": topics, "--no-waveforms": no_waveforms or None}
        for option, value in (given | {"--record-split": split_mb}).items():
            if value is not None:
                raise UsageError(f"{option}: needs --record FILE.mcap")
        return None
    check_writable("--record", path)
    check_library()
    patterns = () if topics is None else tuple(topics.split(","))
    if not all(patterns):
        raise UsageError(f"--record-topics: {topics!r}: has an empty pattern")
    if split_mb is not None and not 1.0 <= split_mb <= 1e6:
        raise UsageError(f"--record-split: {split_mb:g}: must be from 1 to 1e6 MB")

    from rail_corridor.recording.topic_selection import TopicSelection
    from rail_corridor.run.options import RecordOptions

    selection = TopicSelection(patterns, waveforms=not no_waveforms)
    return RecordOptions(path, selection, None if split_mb is None else round(split_mb * 1e6))


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
