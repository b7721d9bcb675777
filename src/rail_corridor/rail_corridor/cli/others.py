"""Commands that packages above the corridor, or other distributions, add to ``rail``.

Each is an entry point of the group ``rail_corridor.commands``: its name is that of the command, and
it names a function with the arguments of one, as those here. What it needs it imports when called.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import entry_points
from typing import Final

import typer

from .usage import UsageError

GROUP: Final = "rail_corridor.commands"


def add_to(app: typer.Typer) -> None:
    """Add them to the application, in the order of their names.

    A command that cannot be loaded says so when it is called; the others are there all the same.
    """
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            app.command(entry.name)(entry.load())
        except Exception as error:
            app.command(entry.name)(_broken(entry.value, f"{type(error).__name__}: {error}"))


def _broken(value: str, reason: str) -> Callable[[], None]:
    def broken() -> None:
        """Cannot be loaded."""
        raise UsageError(f"{GROUP}: {value}: cannot be loaded: {reason}")

    return broken
