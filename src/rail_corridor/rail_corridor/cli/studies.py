"""The commands that study corridors: campaigns, sweeps, what geometry allows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from .usage import ScenarioArgument, TrackOption, UsageError, check_choice, check_writable


def add_to(app: typer.Typer) -> None:
    """Add the commands to the application."""
    for command in (study, campaign, sweep, accuracy):
        app.command()(command)


def study(
    what: Annotated[
        str,
        typer.Argument(help="A study file, or one that comes with the corridor.", metavar="STUDY"),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder of the results; STUDY.study if not given.", metavar="DIR"
        ),
    ] = None,
    runs: Annotated[
        int | None, typer.Option("--runs", help="Runs of each cell at most.", metavar="N", min=1)
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Seed of the first run.", metavar="N", min=0)
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", help="Of this machine; one for each core.", metavar="N", min=1),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option("--scheduler", help="Of a cluster of Dask: tcp://host:8786.", metavar="URL"),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the runs that there are.")
    ] = False,
    only: Annotated[
        str | None,
        typer.Option(
            "--only", help="Make one run of one cell here, and show it.", metavar="CELL:RUN"
        ),
    ] = None,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare", help="Folder of an earlier study: what has moved.", metavar="DIR"
        ),
    ] = None,
) -> None:
    """Make many runs of one question: rows, a summary with intervals, a picture."""
    from rich.console import Console

    from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
    from rail_corridor.study.run_study import exit_code, run_study
    from rail_corridor.study.single_run import show_run
    from rail_corridor.study.study_file import load_study

    changes = {"runs": runs, "first_seed": seed}
    loaded, source = load_study(what, FOLDER, GENERATORS, CALCULATIONS, changes)
    console = Console()
    if only is not None:
        raise typer.Exit(show_run(loaded, source, only, console))
    outcome = run_study(
        loaded,
        source,
        out or Path(f"{loaded.name}.study"),
        console,
        scheduler=scheduler,
        workers=workers,
        resume=resume,
        compare=compare,
    )
    raise typer.Exit(exit_code(outcome))


def campaign(
    what: Annotated[
        str,
        typer.Argument(help="What to put to the test: handover, threats, kills.", metavar="WHAT"),
    ],
    crossings: Annotated[
        int, typer.Option("--crossings", help="handover: at least so many each.", metavar="N")
    ] = 200,
    runs: Annotated[
        int, typer.Option("--runs", help="kills: runs, of one seed each.", metavar="N")
    ] = 100,
    frames: Annotated[
        int, typer.Option("--frames", help="threats: frames under each.", metavar="N")
    ] = 100_000,
    seed: Annotated[int, typer.Option("--seed", help="Seed of the first run.", metavar="N")] = 1,
    json: Annotated[
        Path | None, typer.Option("--json", help="Write the rows as JSON.", metavar="FILE")
    ] = None,
) -> None:
    """Run many generated scenarios and count what must not happen; exit code 1 if it did."""
    check_choice("WHAT", what, ("handover", "threats", "kills"))
    if not 1 <= frames <= 100_000_000:
        raise UsageError(f"--frames: {frames}: must be from 1 to 100000000")
    if not 1 <= runs <= 1_000_000:
        raise UsageError(f"--runs: {runs}: must be from 1 to 1000000")
    if not 1 <= crossings <= 1_000_000:
        raise UsageError(f"--crossings: {crossings}: must be from 1 to 1000000")
    if not 0 <= seed < 2**62:
        raise UsageError(f"--seed: {seed}: must be from 0 to 2**62")
    if json is not None:
        check_writable("--json", json)

    from rich.console import Console

    from rail_corridor.run.child_run import RunFailedError
    from rail_corridor.studies.handover import HandoverRow, print_rows, run_campaign, write_rows
    from rail_corridor.studies.handover_scenarios import situations

    console = Console()
    if what == "kills":
        from rail_corridor.studies.kills import kill_campaign

        raise typer.Exit(kill_campaign(runs, seed, console, json))
    if what == "threats":
        from rail_corridor.studies.threat_table import threat_campaign

        raise typer.Exit(threat_campaign(frames, seed, console, json))
    rows: list[HandoverRow] = []
    try:
        rows.extend(run_campaign(situations(), crossings, seed, console))
    except KeyboardInterrupt:
        print_rows(rows, console)  # what is done is worth seeing
        raise
    except RunFailedError as error:
        print(f"rail: {error}", file=sys.stderr)
        raise typer.Exit(1) from None
    print_rows(rows, console)
    if json is not None:
        write_rows(rows, json)
    raise typer.Exit(1 if any(row.violations for row in rows) else 0)


def sweep(
    what: Annotated[str, typer.Argument(help="What to vary: link_margin.", metavar="WHAT")],
    out: Annotated[
        Path, typer.Option("--out", help="Folder for the figure and the numbers.", metavar="DIR")
    ] = Path("link_margin"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points.")] = False,
    seeds: Annotated[
        int, typer.Option("--seeds", help="Runs of each point.", metavar="N", min=1, max=100)
    ] = 1,
) -> None:
    """Run one situation over a range of parameters: a table, a figure, and JSON."""
    check_choice("WHAT", what, ("link_margin",))
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out: {out}: is not a directory")
    check_writable("--out", (out if out.is_dir() else out.parent) / "any")

    from rich.console import Console

    from rail_corridor.run.child_run import RunFailedError
    from rail_corridor.studies.link_margin.sweep import run_link_margin

    try:
        run_link_margin(out, quick, Console(), seeds)
    except RunFailedError as error:
        print(f"rail: {error}", file=sys.stderr)
        raise typer.Exit(1) from None


def accuracy(
    scenario: ScenarioArgument,
    track: TrackOption = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            "--spacing", help="Reference stations so many metres apart at most.", metavar="M"
        ),
    ] = None,
    offset: Annotated[
        float | None,
        typer.Option("--offset", help="So many metres off the track.", metavar="M"),
    ] = None,
    speed: Annotated[
        list[float] | None,
        typer.Option("--speed", help="Speed in km/h; repeatable.", metavar="KMH"),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", help="Figure: .png, .svg or .pdf.", metavar="FILE")
    ] = Path("accuracy.png"),
) -> None:
    """Draw the accuracy that geometry allows to Doppler positions along a line; starts nothing."""
    speeds = speed or [30.0, 120.0, 300.0]
    for value in speeds:
        if not 1.0 <= value <= 500.0:
            raise UsageError(f"--speed: {value:g} is not from 1 to 500 km/h")
    if out.suffix not in (".png", ".svg", ".pdf"):
        raise UsageError(f"--out: {out}: must end in .png, .svg or .pdf")
    check_writable("--out", out)

    from rich.console import Console

    from rail_corridor.loading.loader import load_scenario
    from rail_corridor.loading.overrides import Overrides
    from rail_corridor.studies.accuracy import run_accuracy

    changes = Overrides(track=track, sections={"--spacing": spacing, "--offset": offset})
    run_accuracy(load_scenario(scenario, overrides=changes), speeds, out, Console())
