"""What commands share: options, and that wrong use is one line and starts nothing."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer

from .completion import complete_json, complete_scenario

ScenarioArgument = Annotated[
    str,
    typer.Argument(
        help="Name of a built-in scenario, or a YAML file.",
        metavar="SCENARIO",
        autocompletion=complete_scenario,
    ),
]
TrackOption = Annotated[
    Path | None,
    typer.Option(
        "--track",
        help="TTOBench file that replaces the first track.",
        metavar="FILE",
        autocompletion=complete_json,
    ),
]


class UsageError(Exception):
    """Wrong use of a command; one line."""


def check_writable(option: str, path: Path) -> None:
    """Raise UsageError for a file that cannot be written."""
    if path.is_dir():
        raise UsageError(f"{option}: {path}: is a directory")
    if not path.absolute().parent.is_dir():
        raise UsageError(f"{option}: {path}: there is no such directory")
    if not os.access(path.absolute().parent, os.W_OK):
        raise UsageError(f"{option}: {path}: cannot be written")


Choice = TypeVar("Choice", bound=str)


def check_choice(option: str, value: str | None, choices: tuple[Choice, ...]) -> Choice | None:
    """The choice that a value names, None for no value; UsageError for what is not offered."""
    if value is None:
        return None
    for choice in choices:
        if choice == value:
            return choice
    raise UsageError(f"{option}: {value!r}: must be one of {', '.join(choices)}")


def assignments(option: str, given: Iterable[str]) -> dict[str, Any]:
    """Fields and values, as in YAML, of arguments FIELD=VALUE; UsageError for what is none."""
    import yaml

    found = {}
    for each in given:
        field, equals, text = each.partition("=")
        try:
            found[field] = yaml.safe_load(text)
        except yaml.YAMLError:
            equals = ""
        if not (field and equals):
            raise UsageError(f"{option}: {each!r}: must be FIELD=VALUE")
    return found


def check_library() -> None:
    """Raise UsageError where recordings can be neither written nor read."""
    if importlib.util.find_spec("mcap") is None:
        raise UsageError("recordings need the Python package mcap")
