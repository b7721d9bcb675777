"""The summary of a study: groups of runs, figures with their intervals, what must hold."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rich.console import Console
from rich.table import Table

from .figures import Figure
from .intervals import Estimate, estimate
from .journal import Entry


@dataclass(frozen=True)
class Group:
    """Runs that are alike in the columns of the summary."""

    key: tuple[Any, ...]
    runs: int
    failed: int
    estimates: Mapping[str, Estimate]


def groups_of(
    entries: Iterable[Entry], by: Sequence[str], figures: Mapping[str, Figure]
) -> list[Group]:
    """Groups in the order in which they come first, numbers in theirs."""
    members: dict[tuple[Any, ...], list[Entry]] = {}
    for entry in entries:
        found = {**entry.values, **entry.facts}
        members.setdefault(tuple(_plain(found.get(name)) for name in by), []).append(entry)
    groups = [_group(key, group, figures) for key, group in members.items()]
    if all(_is_ordered(group.key) for group in groups):
        groups.sort(key=lambda group: group.key)
    return groups


def _group(key: tuple[Any, ...], group: list[Entry], figures: Mapping[str, Figure]) -> Group:
    made = [entry for entry in group if entry.failure is None]
    values = {name: [_known(entry.figures.get(name)) for entry in made] for name in figures}
    return Group(
        key,
        len(made),
        len(group) - len(made),
        {name: estimate(values[name], figures[name].over_runs) for name in figures},
    )


def _known(value: float | None) -> float:
    return math.nan if value is None else value


def _plain(value: Any) -> Any:
    return str(value) if isinstance(value, dict | list) else value


def _is_ordered(key: tuple[Any, ...]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in key)


@dataclass(frozen=True)
class Violation:
    """A run in which a figure was not what it must be."""

    entry: Entry
    figure: str
    value: float | None


def violations_of(entries: Iterable[Entry], figures: Mapping[str, Figure]) -> list[Violation]:
    """Every violation of every run that has not failed."""
    return [
        Violation(entry, name, entry.figures.get(name))
        for entry in entries
        if entry.failure is None
        for name, figure in figures.items()
        if figure.violated_by(entry.figures.get(name))
    ]


def print_summary(
    title: str,
    groups: Sequence[Group],
    by: Sequence[str],
    figures: Mapping[str, Figure],
    console: Console,
) -> None:
    """Show the groups as tables as wide as the console; ± is half of a 95 % interval."""
    names = list(figures)
    while True:
        shown = len(names)
        while shown > 1 and console.measure(_table(title, groups, by, names[:shown])).minimum > (
            console.width
        ):
            shown -= 1
        console.print(_table(title, groups, by, names[:shown]))
        names = names[shown:]
        if not names:
            return


def _table(title: str, groups: Sequence[Group], by: Sequence[str], names: Sequence[str]) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in by:
        table.add_column(name.rpartition(".")[2].replace("_", "\n"), no_wrap=True)
    table.add_column("runs", justify="right", no_wrap=True)
    for name in names:
        table.add_column(name.replace("_", "\n"), justify="right", no_wrap=True)
    for group in groups:
        failed = f" [red]+{group.failed} failed[/red]" if group.failed else ""
        table.add_row(
            *(f"{value:g}" if isinstance(value, float) else str(value) for value in group.key),
            f"{group.runs}{failed}",
            *(text_of(group.estimates[name]) for name in names),
        )
    return table


def text_of(estimate: Estimate) -> str:
    """An estimate in a cell: as many digits as its interval is worth.

    >>> text_of(Estimate(0.12345, 0.12, 0.13, 10)), text_of(Estimate(3.0, math.nan, math.nan, 1))
    ('0.1235 ± 0.005', '3')
    """
    if math.isnan(estimate.value):
        return "-"
    if math.isnan(estimate.half_width):
        return f"{estimate.value:.6g}"
    return f"{estimate.value:.4g} ± {estimate.half_width:.2g}"
