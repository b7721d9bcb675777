"""``rail figures``: every figure from the code, those of a run from its recording."""

from __future__ import annotations

from collections.abc import Iterable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_recording
from .usage import UsageError, check_library, check_writable


def add_to(app: typer.Typer) -> None:
    """Add the command to an application."""
    app.command()(figures)


def figures(
    directory: Annotated[
        Path, typer.Argument(help="Where the figures go.", metavar="[OUTDIR]")
    ] = Path("figures"),
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Draw these, as 'run_*'; repeatable.", metavar="NAME"),
    ] = None,
    recording: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="A recording: the figures of that run.",
            metavar="FILE.mcap",
            autocompletion=complete_recording,
        ),
    ] = None,
    listing: Annotated[
        bool, typer.Option("--list", help="Show names and captions; draw nothing.")
    ] = False,
) -> None:
    """Draw the figures of the source documents, of the project and of a run, from the code."""
    if directory.exists() and not directory.is_dir():
        raise UsageError(f"OUTDIR: {directory}: is not a directory")
    if not listing:
        check_writable("OUTDIR", directory / "any" if directory.is_dir() else directory)
    if recording is not None:
        check_library()

    from rail_corridor.figures import run as run_figures
    from rail_corridor.figures.catalogue import ELSEWHERE, FIGURES, draw, write_index

    captions = {name: one.caption for name, one in (FIGURES | run_figures.FIGURES).items()}
    wanted = _chosen(captions, only)
    if listing:
        for name in wanted:
            typer.echo(f"{name}\n    {captions[name]}")
        for what, how in ELSEWHERE.items():
            typer.echo(f"elsewhere: {what}: {how}")
        return
    of_run = [name for name in wanted if name in run_figures.FIGURES]
    available = dict(FIGURES)
    if recording is not None and of_run:
        from rail_corridor.recording.parts import Recording
        from rail_corridor.report.from_recording import run_of

        with Recording(recording) as file:
            run = run_of(file)
        available |= run_figures.figure_specs_of(run)
    specs = {name: available[name] for name in wanted if name in available}
    for path in draw(directory, specs):
        typer.echo(path)
    if specs:
        typer.echo(write_index(directory, specs))
    if of_run and recording is None:
        typer.echo(
            f"not drawn: {', '.join(of_run)}: they need a run, as of 'rail run moving_block "
            "--record run.mcap', then 'rail figures --from run.mcap'"
        )
    elif missing := [name for name in of_run if name not in specs]:
        typer.echo(f"not drawn: {', '.join(missing)}: the run has nothing for them")


def _chosen(names: Iterable[str], patterns: list[str] | None) -> list[str]:
    """Names that fit any of the patterns, all without any; UsageError for one that fits none."""
    names = list(names)
    for pattern in patterns or ():
        if not any(fnmatchcase(name, pattern) for name in names):
            raise UsageError(f"--only: {pattern!r}: is not one of {', '.join(names)}")
    return [n for n in names if not patterns or any(fnmatchcase(n, p) for p in patterns)]
