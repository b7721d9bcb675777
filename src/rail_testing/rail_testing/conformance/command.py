"""``rail conformance``."""

from __future__ import annotations

import importlib.util
import shlex
from pathlib import Path
from typing import Annotated

import typer

from rail_corridor.cli.usage import UsageError, check_choice, check_writable

from .kinds import kind_names, load_kind


def conformance(
    kind: Annotated[
        str,
        typer.Argument(
            help=f"Kind of equipment: {', '.join(kind_names())}.",
            metavar="KIND",
            autocompletion=kind_names,
        ),
    ],
    command: Annotated[
        str | None,
        typer.Option(
            "--command",
            help="Starts the implementation, which is given its name and its parameters as ROS "
            "arguments; the corridor's own without it.",
            metavar='"WORDS"',
        ),
    ] = None,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            help="Scenario to run it in, by name or file, in the place of the kind's own.",
            metavar="SCENARIO",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", help="Seed of every random draw.", metavar="N", min=0)
    ] = None,
    keyword: Annotated[
        str, typer.Option("-k", help="Only tests that match, as with pytest.", metavar="EXPRESSION")
    ] = "",
    junit: Annotated[
        Path | None, typer.Option("--junit", help="Write JUnit XML.", metavar="FILE.xml")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            help="Write one page: from clause to test, verdict and recording.",
            metavar="FILE.html",
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(
            "--record",
            help="Folder for the recordings of what fails; that for temporary files without it.",
            metavar="DIR",
        ),
    ] = None,
    listing: Annotated[
        bool, typer.Option("--list", help="Show the tests and their clauses; starts nothing.")
    ] = False,
) -> None:
    """Test an implementation of a kind of equipment: interface, timing, restarts, safety.

    Exit code 0 if all passed, 1 if a test failed, 2 for wrong input.
    """
    name = check_choice("KIND", kind, tuple(kind_names()))
    assert name is not None
    for option, path in (("--junit", junit), ("--html", html)):
        if path is not None:
            check_writable(option, path)
    for package in ("pytest", "jinja2"):
        if importlib.util.find_spec(package) is None:
            raise UsageError(f"conformance needs the Python package {package}")
    try:
        words = tuple(shlex.split(command)) if command is not None else ()
    except ValueError as error:
        raise UsageError(f"--command: {command!r}: {error}") from None
    if command is not None and not words:
        raise UsageError(f"--command: {command!r}: names no program")

    from rich.console import Console

    from .bench import Settings
    from .page import page_of
    from .run import check_command, check_scenario, list_tests, run_tests
    from .table import print_list, print_results

    settings = Settings(load_kind(name), words, scenario, seed, record)
    console = Console()
    if listing:
        print_list(list_tests(settings, keyword), console)
        raise typer.Exit(0)
    if record is not None:
        _make_folder(record)
    check_scenario(settings)
    check_command(settings)
    results = run_tests(settings, keyword=keyword, junit=junit)
    who = " ".join(words) or "the corridor's own"
    print_results(f"Conformance of {settings.kind.title}: {who}", results, console)
    if html is not None:
        html.write_text(page_of(settings, results), encoding="utf-8")
    raise typer.Exit(0 if results.passed else 1)


def _make_folder(path: Path) -> None:
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(f"--record: {path}: {error.strerror}") from None
