"""The ``rail`` command."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

# One thread for linear algebra: two cores are shared by many nodes, and the bits of a sum must
# not depend on how many threads computed it. Has to be set before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="A railway signalling corridor on ROS 2, at waveform level.",
)

ScenarioArgument = Annotated[
    str, typer.Argument(help="Name of a built-in scenario, or a YAML file.", metavar="SCENARIO")
]
SeedOption = Annotated[
    int | None, typer.Option("--seed", help="Seed of every random draw.", metavar="N")
]
DurationOption = Annotated[
    float | None, typer.Option("--duration", help="Simulated time [s].", metavar="S")
]
TrackOption = Annotated[
    Path | None,
    typer.Option("--track", help="TTOBench file that replaces the first track.", metavar="FILE"),
]
TrainsOption = Annotated[
    int | None, typer.Option("--trains", help="Number of trains.", metavar="N")
]
ZoneOption = Annotated[
    float | None,
    typer.Option("--zone-length", help="No zone longer than this [m].", metavar="M"),
]


class UsageError(Exception):
    """Wrong use of a command; one line."""


def _load(
    scenario: str,
    seed: int | None,
    duration: float | None,
    track: Path | None,
    trains: int | None,
    zone_length: float | None,
) -> object:
    from .scenario import Overrides, load_scenario

    overrides = Overrides(
        seed=seed, duration_s=duration, track=track, trains=trains, zone_length_m=zone_length
    )
    return load_scenario(scenario, overrides=overrides)


def _choice(option: str, value: str | None, choices: tuple[str, ...]) -> None:
    if value is not None and value not in choices:
        raise UsageError(f"{option}: {value!r}: must be one of {', '.join(choices)}")


@app.command()
def run(
    scenario: ScenarioArgument,
    duration: DurationOption = None,
    rate: Annotated[
        float,
        typer.Option(
            "--rate", help="Simulated seconds per second; 0 = as fast as possible.", metavar="R"
        ),
    ] = 0.0,
    seed: SeedOption = None,
    processes: Annotated[
        str | None,
        typer.Option(
            "--processes",
            help="one process, one per site and train, or one per node: one, site, node.",
            metavar="HOW",
        ),
    ] = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write the report as JSON.", metavar="FILE.json"),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(
            "--only",
            help="Run one part here, the other on another host: wayside, onboard.",
            metavar="PART",
        ),
    ] = None,
    external: Annotated[
        list[str] | None,
        typer.Option(
            "--external",
            help="Do not start this node but wait for yours of the same name; repeatable.",
            metavar="NODE",
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(
            "--timeout", help="Wall time after which a silent node is given up [s].", metavar="S"
        ),
    ] = 30.0,
    kill: Annotated[
        list[str] | None,
        typer.Option(
            "--kill", help="Kill this node at this simulated time; repeatable.", metavar="NODE@S"
        ),
    ] = None,
) -> None:
    """Run a corridor, and report."""
    import math

    _choice("--processes", processes, ("one", "site", "node"))
    _choice("--only", only, ("wayside", "onboard"))
    if not (math.isfinite(rate) and 0.0 <= rate <= 1e6):
        raise UsageError(f"--rate: {rate}: must be from 0 to 1e6")
    if not (math.isfinite(timeout) and 0.5 <= timeout <= 3600.0):
        raise UsageError(f"--timeout: {timeout}: must be from 0.5 to 3600 s")
    if report is not None:
        _check_writable("--report", report)
    from .kills import parse_kill

    kills = tuple(parse_kill(text) for text in kill or ())
    loaded = _load(scenario, seed, duration, track, trains, zone_length)

    from rich.console import Console

    from .launcher import RunOptions
    from .launcher import run as run_corridor

    options = RunOptions(  # type: ignore[arg-type]
        rate, processes, only, report, timeout, tuple(external or ()), kills
    )
    raise typer.Exit(run_corridor(loaded, options, Console()))  # type: ignore[arg-type]


def _check_writable(option: str, path: Path) -> None:
    if path.is_dir():
        raise UsageError(f"{option}: {path}: is a directory")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"{option}: {path}: there is no such directory")
    if not os.access(path.absolute().parent, os.W_OK):
        raise UsageError(f"{option}: {path}: cannot be written")


@app.command()
def check(
    scenario: ScenarioArgument,
    duration: DurationOption = None,
    seed: SeedOption = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
) -> None:
    """Validate a scenario and show what it would run; starts nothing."""
    loaded = _load(scenario, seed, duration, track, trains, zone_length)

    from rich.console import Console

    from .summary import print_summary

    print_summary(loaded, Console())  # type: ignore[arg-type]


@app.command()
def scenarios() -> None:
    """List the built-in scenarios."""
    from rich.console import Console

    from .summary import print_scenarios

    print_scenarios(Console())


@app.command()
def topics() -> None:
    """List the topics of the running corridor, and what they carry."""
    from .live_tools import list_topics

    raise typer.Exit(list_topics())


@app.command()
def echo(
    topic: Annotated[str, typer.Argument(help="Absolute name of a topic.", metavar="TOPIC")],
    once: Annotated[bool, typer.Option("--once", help="Stop after one message.")] = False,
    raw: Annotated[bool, typer.Option("--raw", help="Show the message as it is.")] = False,
) -> None:
    """Show the messages of a topic, decoded."""
    from .live_tools import echo_topic

    raise typer.Exit(echo_topic(topic, once=once, raw=raw))


@app.command()
def hz(
    topic: Annotated[str, typer.Argument(help="Absolute name of a topic.", metavar="TOPIC")],
) -> None:
    """Show how often a topic is published, in wall and in simulated time."""
    from .live_tools import topic_rate

    raise typer.Exit(topic_rate(topic))


@app.command()
def figures(
    directory: Annotated[
        Path, typer.Argument(help="Where the pictures go.", metavar="[OUTDIR]")
    ] = Path("figures"),
    only: Annotated[
        list[str] | None,
        typer.Option("--only", help="Draw this figure; repeatable.", metavar="NAME"),
    ] = None,
) -> None:
    """Draw the figures of the source documents and of the project, from its own code."""
    from .figures import FIGURES, draw

    for name in only or ():
        _choice("--only", name, tuple(FIGURES))
    if directory.exists() and not directory.is_dir():
        raise UsageError(f"OUTDIR: {directory}: is not a directory")
    _check_writable("OUTDIR", directory / "any")
    for path in draw(directory, tuple(only or ())):
        typer.echo(path)


@app.command()
def bench(
    names: Annotated[
        list[str] | None, typer.Argument(help="Rows to run; all if none.", metavar="NAME...")
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", help="Write the rows as JSON.", metavar="FILE")
    ] = None,
) -> None:
    """Run the benchmarks: every ratio is measured side by side in one run."""
    if json is not None:
        _check_writable("--json", json)
    from .bench import run_benchmarks

    raise typer.Exit(run_benchmarks(tuple(names or ()), json))


@app.command()
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
    _choice("WHAT", what, ("handover", "threats", "kills"))
    if not 1 <= frames <= 100_000_000:
        raise UsageError(f"--frames: {frames}: must be from 1 to 100000000")
    if not 1 <= runs <= 1_000_000:
        raise UsageError(f"--runs: {runs}: must be from 1 to 1000000")
    if not 1 <= crossings <= 1_000_000:
        raise UsageError(f"--crossings: {crossings}: must be from 1 to 1000000")
    if not 0 <= seed < 2**62:
        raise UsageError(f"--seed: {seed}: must be from 0 to 2**62")
    if json is not None:
        _check_writable("--json", json)

    from rich.console import Console

    from .campaign import Row, print_rows, run_campaign, write_rows
    from .campaign_scenarios import situations
    from .child_run import RunFailedError

    console = Console()
    if what == "kills":
        from .kill_campaign import kill_campaign

        raise typer.Exit(kill_campaign(runs, seed, console, json))
    if what == "threats":
        from .threat_table import threat_campaign

        raise typer.Exit(threat_campaign(frames, seed, console, json))
    rows: list[Row] = []
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


@app.command()
def sweep(
    what: Annotated[str, typer.Argument(help="What to vary: link_margin.", metavar="WHAT")],
    out: Annotated[
        Path, typer.Option("--out", help="Folder for picture and figures.", metavar="DIR")
    ] = Path("link_margin"),
    quick: Annotated[bool, typer.Option("--quick", help="Fewer points.")] = False,
    seeds: Annotated[
        int, typer.Option("--seeds", help="Runs of each point.", metavar="N", min=1, max=100)
    ] = 1,
) -> None:
    """Run one situation over a range of parameters: a table, a picture, and JSON."""
    _choice("WHAT", what, ("link_margin",))
    if out.exists() and not out.is_dir():
        raise UsageError(f"--out: {out}: is not a directory")
    _check_writable("--out", (out if out.is_dir() else out.parent) / "any")

    from rich.console import Console

    from .child_run import RunFailedError
    from .link_margin import run_link_margin

    try:
        run_link_margin(out, quick, Console(), seeds)
    except RunFailedError as error:
        print(f"rail: {error}", file=sys.stderr)
        raise typer.Exit(1) from None


def main() -> None:
    """Entry point: every wrong input is one line and exit code 2."""
    from .errors import InputError

    # Typer brings its own command-line parser, or uses click: its errors are known by name.
    usage_errors = next(c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException")

    try:
        code = app(standalone_mode=False)
    except (InputError, UsageError) as error:
        sys.exit(_refuse(str(error)))
    except usage_errors as error:
        sys.exit(_refuse(" ".join(error.format_message().split())))
    except (typer.Abort, KeyboardInterrupt):
        sys.exit(130)
    sys.exit(code if isinstance(code, int) else 0)


def _refuse(line: str) -> int:
    print(f"rail: {line}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    main()
