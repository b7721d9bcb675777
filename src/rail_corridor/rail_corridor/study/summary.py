"""The summary of a study: groups of runs, figures with their intervals, what must hold."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.table import Table

from .figures import Figure
from .intervals import Estimate, estimate, known_or_nan
from .journal import Entry
from .model import Study

#: An interval is even when its middle is off the value by no more than this part of it.
_EVEN: Final = 0.05
#: All runs gave the same, but for rounding.
_NOTHING: Final = 1e-12
#: Intervals below are told with powers of ten.
_SMALL: Final = 1e-3
_UNLIMITED: Final = 100_000


@dataclass(frozen=True)
class Group:
    """Runs that are alike in the columns of the summary."""

    key: tuple[Any, ...]
    runs: int
    failed: int
    estimates: Mapping[str, Estimate]


class _Members:
    """Values of the runs of one group."""

    def __init__(self, figures: Mapping[str, Figure]) -> None:
        self.runs = self.failed = 0
        self.values = {name: array("d") for name in figures}

    def add(self, entry: Entry) -> None:
        if entry.failure is not None:
            self.failed += 1
            return
        self.runs += 1
        for name, values in self.values.items():
            values.append(known_or_nan(entry.figures.get(name)))

    def group(self, key: tuple[Any, ...], figures: Mapping[str, Figure]) -> Group:
        estimates = {
            name: estimate(
                self.values[name],
                figure.over_runs,
                None if figure.per is None else self.values[figure.per],
            )
            for name, figure in figures.items()
        }
        return Group(key, self.runs, self.failed, estimates)


def groups_of(
    entries: Iterable[Entry], by: Sequence[str], figures: Mapping[str, Figure]
) -> list[Group]:
    """Groups in the order in which they come first, numbers in theirs."""
    members: dict[tuple[Any, ...], _Members] = {}
    for entry in entries:
        found = {**entry.values, **entry.facts}
        key = tuple(_plain(found.get(name)) for name in by)
        if key not in members:
            members[key] = _Members(figures)
        members[key].add(entry)
    groups = [each.group(key, figures) for key, each in members.items()]
    if all(_is_ordered(group.key) for group in groups):
        groups.sort(key=lambda group: group.key)
    return groups


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


def violations_of(entries: Iterable[Entry], figures: Mapping[str, Figure]) -> Iterator[Violation]:
    """Every violation of every run that has not failed."""
    for entry in entries:
        if entry.failure is None:
            for name, figure in figures.items():
                if figure.violated_by(entry.figures.get(name)):
                    yield Violation(entry, name, entry.figures.get(name))


def total_of(groups: Sequence[Group], entries: Iterable[Entry], study: Study) -> Group | None:
    """All runs together, of the figures of which that says something; None for one group."""
    figures = {
        name: figure
        for name, figure in study.figures.items()
        if figure.over_runs in ("sum", "min", "max") or figure.per is not None
    }
    if len(groups) < 2 or not figures:
        return None
    needed = {**figures, **{f.per: study.figures[f.per] for f in figures.values() if f.per}}
    (total,) = groups_of(entries, (), needed)
    return total


def print_summary(
    study: Study, groups: Sequence[Group], console: Console, total: Group | None = None
) -> None:
    """Show figures of groups as tables as wide as the console, with their 95 % intervals."""
    names, title = list(study.figures), study.name
    while names:
        shown = len(names)
        while shown > 1 and (
            _width(_table(title, study, groups, names[:shown], total), console) > console.width
        ):
            shown -= 1
        console.print(_table(title, study, groups, names[:shown], total))
        names, title = names[shown:], f"{study.name}, continued"


def _width(table: Table, console: Console) -> int:
    """Width that a table would like to have."""
    unlimited = console.options.update(max_width=_UNLIMITED)
    return Measurement.get(console, unlimited, table).maximum


def _table(
    title: str, study: Study, groups: Sequence[Group], names: Sequence[str], total: Group | None
) -> Table:
    by = study.columns
    table = Table(title=title, title_justify="left", title_style="bold")
    for name in by:
        table.add_column(name.rpartition(".")[2].replace("_", "\n"), no_wrap=True)
    table.add_column("runs", justify="right", no_wrap=True)
    for name in names:
        heading = f"{name.replace('_', chr(10))}\n[dim]{study.figures[name].over_runs}[/dim]"
        table.add_column(heading, justify="right", no_wrap=True)
    for group in groups:
        table.add_row(*_cells(group, names), end_section=group is groups[-1])
    if total is not None:
        table.add_row("[bold]together[/bold]", *[""] * (len(by) - 1), *_cells(total, names))
    return table


def _cells(group: Group, names: Sequence[str]) -> list[str]:
    failed = f" [red]+{group.failed} failed[/red]" if group.failed else ""
    return [
        *(f"{v:g}" if isinstance(v, float) else escape(str(v)) for v in group.key),
        f"{group.runs}{failed}",
        *(_text(group.estimates[n], group.runs) if n in group.estimates else "" for n in names),
    ]


def _text(estimate: Estimate, runs: int) -> str:
    """An estimate, and of how many runs it is where it is not known in all."""
    few = f" [dim]({estimate.runs} of {runs})[/dim]" if 0 < estimate.runs < runs else ""
    return escape(text_of(estimate)) + few


def text_of(estimate: Estimate) -> str:
    """An estimate in a cell: with ± if its interval is even on both sides, else with its ends.

    >>> text_of(Estimate(0.12345, 0.12, 0.1269, 10)), text_of(Estimate(0.9967, 0.9931, 0.9987, 9))
    ('0.1235 ± 0.0034', '0.9967 [0.9931, 0.9987]')
    >>> text_of(Estimate(0.0, 0.0, 7.5, 9)), text_of(Estimate(3.4e-07, 8.6e-09, 1.9e-06, 9))
    ('0.0 [0.0, 7.5]', '3.4e-07 [8.6e-09, 1.9e-06]')
    >>> text_of(Estimate(3.0, math.nan, math.nan, 1)), text_of(Estimate(math.nan, 0.0, 0.0, 0))
    ('3', '-')
    """
    value, low, high = estimate.value, estimate.low, estimate.high
    if math.isnan(value):
        return "-"
    if math.isnan(estimate.half_width) or estimate.half_width <= _NOTHING * abs(value):
        return f"{value:.6g}"
    if abs(high + low - 2.0 * value) <= _EVEN * (high - low):
        return f"{value:.4g} ± {estimate.half_width:.2g}"
    if high < _SMALL:
        return f"{value:.3g} [{low:.2g}, {high:.2g}]"
    digits = max(0, 1 - math.floor(math.log10(high - low)))  # what the interval is worth
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
