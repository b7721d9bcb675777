"""The ``rail`` command."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

# One thread for linear algebra: two cores are shared by many nodes, and the bits of a sum must
# not depend on how many threads computed it. Has to be set before NumPy is loaded.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer

from rail_corridor.view.command import view

from .figures import add_to as add_figures
from .live import add_to as add_live
from .others import add_to as add_others
from .recordings import (
    NoWaveformsOption,
    RecordOption,
    RecordSplitOption,
    RecordTopicsOption,
    record_options,
)
from .recordings import add_to as add_recordings
from .studies import add_to as add_studies
from .usage import (
    ScenarioArgument,
    TrackOption,
    UsageError,
    check_choice,
    check_writable,
)
from .workshop import add_to as add_workshop

if TYPE_CHECKING:
    from rail_corridor.plan.plan import Part
    from rail_corridor.scenario.model import Scenario

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="A railway signalling corridor on ROS 2, at waveform level.",
)

_PLACEMENTS: tuple[Literal["one", "site", "node"], ...] = ("one", "site", "node")
_PARTS: tuple[Part, ...] = ("wayside", "onboard", "report")

SeedOption = Annotated[
    int | None, typer.Option("--seed", help="Seed of every random draw.", metavar="N")
]
DurationOption = Annotated[
    float | None, typer.Option("--duration", help="Simulated time, in seconds.", metavar="S")
]
TrainsOption = Annotated[
    int | None, typer.Option("--trains", help="Number of trains.", metavar="N")
]
ZoneOption = Annotated[
    float | None,
    typer.Option("--zone-length", help="No zone longer than this, in metres.", metavar="M"),
]
ReverseOption = Annotated[
    bool,
    typer.Option("--reverse", help="Trains run the other way, from the other end of their track."),
]


def _load(
    scenario: str,
    seed: int | None,
    duration: float | None,
    track: Path | None,
    trains: int | None,
    zone_length: float | None,
    reverse: bool,
) -> Scenario:
    from rail_corridor.loading.loader import load_scenario
    from rail_corridor.loading.overrides import Overrides

    overrides = Overrides(
        seed=seed,
        duration_s=duration,
        track=track,
        trains=trains,
        sections={"--zone-length": zone_length},
        reverse=reverse,
    )
    return load_scenario(scenario, overrides=overrides)


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
            help="one process, one per site and train, or one per node: one, site, node. "
            "[default: site, or one if that makes more than eight processes to a core]",
            metavar="HOW",
        ),
    ] = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
    reverse: ReverseOption = False,
    report: Annotated[
        Path | None,
        typer.Option("--report", help="Write the report as JSON.", metavar="FILE.json"),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(
            "--only",
            help="Run one part here, the others elsewhere: wayside, onboard, or report, which "
            "runs no node.",
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
    attach: Annotated[
        list[str] | None,
        typer.Option(
            "--attach",
            help="Wait in every tick for this node of yours, beside the others, to be done; "
            "repeatable.",
            metavar="NODE",
        ),
    ] = None,
    timeout: Annotated[
        float,
        typer.Option(
            "--timeout", help="A node silent for so many seconds is given up.", metavar="S"
        ),
    ] = 30.0,
    kill: Annotated[
        list[str] | None,
        typer.Option(
            "--kill", help="Kill this node at this simulated time; repeatable.", metavar="NODE@S"
        ),
    ] = None,
    record: RecordOption = None,
    record_topics: RecordTopicsOption = None,
    no_waveforms: NoWaveformsOption = False,
    record_split: RecordSplitOption = None,
    allow_failures: Annotated[
        bool,
        typer.Option(
            "--allow-failures",
            help="Exit code 0 although nodes failed that were not killed by --kill.",
        ),
    ] = False,
    switches: Annotated[
        bool | None,
        typer.Option(
            "--switches/--no-switches",
            help="Whether equipment can be switched off by its lifecycle service, which takes "
            "time to start where many nodes share a process; the default is to, with --rate.",
        ),
    ] = None,
) -> None:
    """Run a corridor, and report."""
    import gc
    import math

    gc.disable()  # until all is loaded: there is no garbage in modules, and looking takes a tenth

    placement = check_choice("--processes", processes, _PLACEMENTS)
    part = check_choice("--only", only, _PARTS)
    if not (math.isfinite(rate) and 0.0 <= rate <= 1e6):
        raise UsageError(f"--rate: {rate}: must be from 0 to 1e6")
    if not (math.isfinite(timeout) and 0.5 <= timeout <= 3600.0):
        raise UsageError(f"--timeout: {timeout}: must be from 0.5 to 3600 s")
    if report is not None:
        check_writable("--report", report)
    recorded = record_options(record, record_topics, no_waveforms, record_split)
    from rail_corridor.run.kills import parse_kill

    kills = tuple(parse_kill(text) for text in kill or ())
    loaded = _load(scenario, seed, duration, track, trains, zone_length, reverse)

    from rich.console import Console

    from rail_corridor.run.launcher import run as run_corridor
    from rail_corridor.run.options import RunOptions

    options = RunOptions(
        rate,
        placement,
        part,
        report,
        timeout,
        tuple(external or ()),
        kills,
        recorded,
        rate > 0.0 if switches is None else switches,
        allow_failures,
        tuple(attach or ()),
    )
    raise typer.Exit(run_corridor(loaded, options, Console()))


@app.command()
def check(
    scenario: ScenarioArgument,
    duration: DurationOption = None,
    seed: SeedOption = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
    reverse: ReverseOption = False,
) -> None:
    """Validate a scenario and show what it would run; starts nothing."""
    loaded = _load(scenario, seed, duration, track, trains, zone_length, reverse)

    from rich.console import Console

    from rail_corridor.loading.summary import print_summary

    print_summary(loaded, Console())


@app.command()
def plan(
    scenario: ScenarioArgument,
    write: Annotated[
        Path | None,
        typer.Option(
            "--write",
            help="Write what it takes to start every node by hand: the world, a ROS parameter "
            "file for each node, and their command lines.",
            metavar="DIR",
        ),
    ] = None,
    duration: DurationOption = None,
    seed: SeedOption = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
    reverse: ReverseOption = False,
) -> None:
    """Show the nodes of a scenario, or write their parameter files; starts nothing."""
    if write is not None:
        if write.exists() and not write.is_dir():
            raise UsageError(f"--write: {write}: is not a directory")
        check_writable("--write", write / "any" if write.is_dir() else write)
    loaded = _load(scenario, seed, duration, track, trains, zone_length, reverse)

    from rich.console import Console

    from .plans import show_plan

    raise typer.Exit(show_plan(loaded, write, Console()))


@app.command()
def keys(
    scenario: ScenarioArgument,
    file: Annotated[Path, typer.Argument(help="File to write; it must be new.", metavar="FILE")],
) -> None:
    """Draw a key for each train and the zone controller, for `cbtc.keys` of a scenario."""
    loaded = _load(scenario, None, None, None, None, None, False)

    from rail_corridor.equipment.train_radio.keys import write_keys

    count = write_keys(loaded, file)
    typer.echo(f"{count} keys written to {file}; name it in the scenario as cbtc.keys")


@app.command()
def scenarios() -> None:
    """List the built-in scenarios."""
    from rich.console import Console

    from rail_corridor.loading.summary import print_scenarios

    print_scenarios(Console())


add_live(app)
app.command()(view)


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
        check_writable("--json", json)
    from rail_corridor.studies.benchmarks import run_benchmarks

    raise typer.Exit(run_benchmarks(tuple(names or ()), json))


@app.command()
def profile(
    scenario: ScenarioArgument,
    duration: DurationOption = None,
    seed: SeedOption = None,
    track: TrackOption = None,
    trains: TrainsOption = None,
    zone_length: ZoneOption = None,
    reverse: ReverseOption = False,
    flame: Annotated[
        Path | None,
        typer.Option(
            "--flame",
            help="File of the flame graph, SCENARIO.flame.html if none is named. It opens in any "
            "browser: Timeline is the graph, Call stack the same as a list. One that ends in "
            ".json opens on www.speedscope.app, Left Heavy.",
            metavar="FILE",
        ),
    ] = None,
    json: Annotated[
        Path | None, typer.Option("--json", help="Write the figures as JSON.", metavar="FILE")
    ] = None,
) -> None:
    """Show where a tick goes, by kind of node and stage, beside the floor; all in one process."""
    for option, path in (("--flame", flame), ("--json", json)):
        if path is not None:
            check_writable(option, path)
    if flame is not None and flame.suffix not in (".html", ".json"):
        raise UsageError(f"--flame: {flame}: must end in .html or .json")
    loaded = _load(scenario, seed, duration, track, trains, zone_length, reverse)
    if flame is None:
        flame = Path(f"{loaded.name}.flame.html")
        check_writable("--flame", flame)

    from rich.console import Console

    from rail_corridor.studies.tick_profile.profile import profile as profile_ticks

    raise typer.Exit(profile_ticks(loaded, flame, json, Console()))


add_studies(app)
add_recordings(app)
add_workshop(app)
add_figures(app)


def main() -> None:
    """Entry point of ``rail``."""
    add_others(app)
    run_application(app)


def run_application(application: typer.Typer) -> None:
    """Run commands: every wrong input is one line and exit code 2."""
    from rail_corridor.errors import InputError
    from rail_msgs_py.parameters import ParameterError

    # Typer brings its own command-line parser, or uses click: its errors are known by name.
    usage_errors: Any = next(
        c for c in typer.BadParameter.__mro__ if c.__name__ == "ClickException"
    )

    try:
        code = application(standalone_mode=False)
    except (InputError, ParameterError, UsageError) as error:
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
