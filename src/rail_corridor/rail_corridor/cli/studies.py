"""The commands that study corridors: many runs, random scenarios, what geometry allows."""

from __future__ import annotations

import shlex
import signal
import sys
from pathlib import Path
from typing import Annotated

import typer

from .completion import complete_study
from .usage import (
    ScenarioArgument,
    TrackOption,
    UsageError,
    assignments,
    check_choice,
    check_writable,
)


def add_to(app: typer.Typer) -> None:
    """Add the commands to the application."""
    app.command()(study)
    # Names of before, short for studies that come along.
    app.command("campaign", hidden=True)(study)
    app.command("sweep", hidden=True)(study)
    app.command()(draw)
    app.command()(accuracy)


SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="Another value of a field; repeatable.", metavar="FIELD=VALUE"),
]


def study(
    what: Annotated[
        str | None,
        typer.Argument(
            help="A study file, or one that comes along; without it these are listed.",
            metavar="[STUDY]",
            autocompletion=complete_study,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder of the results; NAME.study if not given.", metavar="DIR"
        ),
    ] = None,
    runs: Annotated[
        int | None, typer.Option("--runs", help="Runs of each cell at most.", metavar="N", min=1)
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Seed of the first run.", metavar="N", min=0)
    ] = None,
    fields: SetOption = None,
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
    figures: Annotated[
        bool, typer.Option("--figures", help="Show the places that figures can be of.")
    ] = False,
    compare: Annotated[
        Path | None,
        typer.Option(
            "--compare", help="Folder of an earlier study: what has moved.", metavar="DIR"
        ),
    ] = None,
) -> None:
    """Make many runs of one question: rows, a summary with intervals, a picture."""
    from rich.console import Console

    from rail_corridor.errors import InputError
    from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
    from rail_corridor.study.engine import LostClusterError
    from rail_corridor.study.run_study import Where, run_study
    from rail_corridor.study.single_run import show_places, show_run
    from rail_corridor.study.study_file import list_studies, load_study

    console = Console()
    if what is None:
        list_studies(FOLDER, console)
        return
    given = {"runs": runs, "first_seed": seed}
    changes = {key: value for key, value in given.items() if value is not None}
    changes |= assignments("--set", fields or ())
    loaded, source = load_study(what, FOLDER, GENERATORS, CALCULATIONS, changes)
    if figures:
        show_places(loaded, source, console)
        return
    if only is not None:
        raise typer.Exit(show_run(loaded, source, only, console))
    repeated = ["rail", "study", what, *(["--seed", str(seed)] if seed is not None else [])]
    repeated += [part for each in fields or () for part in ("--set", each)]
    folder = out or Path(f"{loaded.name}.study")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"--out: {folder}: is not a directory")
    check_writable("--out", (folder if folder.is_dir() else folder.parent) / "any")
    signal.signal(signal.SIGTERM, _leave)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # also where a shell has it ignored
    if workers is not None and scheduler is not None:
        raise UsageError("--workers: are those of the scheduler, where one is named")
    try:
        code = run_study(
            loaded,
            source,
            folder,
            console,
            shlex.join(repeated),
            where=Where(scheduler, workers),
            resume=resume,
            compare=compare,
        )
    except InputError as error:
        raise (error.located(what) if error.field.startswith("figures.") else error) from None
    except OSError as error:
        raise UsageError(f"{error.filename}: {(error.strerror or str(error)).lower()}") from None
    except LostClusterError as error:
        print(f"rail: {error}", file=sys.stderr)
        code = 1
    raise typer.Exit(code)


def _leave(*_: object) -> None:
    """End as after Ctrl-C: what is done is shown and kept."""
    raise SystemExit(128 + signal.SIGTERM)


def draw(
    generator: Annotated[
        str, typer.Argument(help="Of random scenarios: handover, kills, link_margin, safety.")
    ],
    seed: Annotated[int, typer.Option("--seed", help="Of all that is drawn.", metavar="N")] = 1,
    fields: SetOption = None,
) -> None:
    """Print a random scenario, as a study draws it, as a scenario file."""
    import yaml

    from rail_corridor.studies.registry import GENERATORS

    check_choice("GENERATOR", generator, tuple(GENERATORS))
    if not 0 <= seed < 2**62:
        raise UsageError(f"--seed: {seed}: must be from 0 to 2**62")
    drawn = GENERATORS[generator].drawn(assignments("--set", fields or ()), seed)
    kills = "".join(f" --kill {kill.node}@{kill.time_s:g}" for kill in drawn.kills)
    print(f"# rail draw {generator} --seed {seed}; rail run FILE{kills}")
    print(yaml.safe_dump(drawn.data, sort_keys=False), end="")


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
