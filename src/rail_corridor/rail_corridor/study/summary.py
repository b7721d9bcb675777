"""The summary of a study: groups of runs, figures with their intervals, what must hold."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from rich import box
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
_TEXT_WIDTH: Final = 80
_CUT_OFF: Final = "\u2265"


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
    for table in _tables(study, groups, console, total):
        console.print(table)


def _tables(
    study: Study, groups: Sequence[Group], console: Console, total: Group | None
) -> Iterator[Table]:
    names, title = list(study.figures), study.name
    while names:
        shown = len(names)
        while shown > 1 and (
            _width(_table(title, study, groups, names[:shown], total), console) > console.width
        ):
            shown -= 1
        yield _table(title, study, groups, names[:shown], total)
        names, title = names[shown:], f"{study.name}, continued"


def write_summary(
    path: Path, study: Study, groups: Sequence[Group], total: Group | None = None
) -> None:
    """Write the tables as plain text of 80 columns, as documents have them."""
    with path.open("w", encoding="utf-8") as file:
        console = Console(file=file, width=_TEXT_WIDTH, color_system=None)
        for table in _tables(study, groups, console, total):
            table.box = box.SIMPLE_HEAD
            console.print(table)


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
        how = "theory" if study.figures[name].beside else study.figures[name].over_runs
        heading = f"{name.replace('_', chr(10))}\n[dim]{how}[/dim]"
        table.add_column(heading, justify="right", no_wrap=True)
    for group in groups:
        cells = _cells(group, names, study.figures)
        table.add_row(*cells, end_section=group is groups[-1])
    if total is not None:
        cells = _cells(total, names, study.figures)
        table.add_row("[bold]together[/bold]", *[""] * (len(by) - 1), *cells)
    table.caption_justify = "left"
    table.caption = "\n".join(_notes(table)) or None
    return table


def _notes(table: Table) -> Iterator[str]:
    """What the marks in the cells mean, of those that there are."""
    cells = [cell for column in table.columns for cell in column.cells if isinstance(cell, str)]
    if any(cell.startswith("(") for cell in cells):
        yield "(in brackets): theory alone, the runs saw none"
    if any(cell.startswith(_CUT_OFF) for cell in cells):
        yield f"{_CUT_OFF} lower bound: the end of the run has cut some off"


def _cells(group: Group, names: Sequence[str], figures: Mapping[str, Figure]) -> list[str]:
    failed = f" [red]+{group.failed} failed[/red]" if group.failed else ""
    return [
        *(f"{v:g}" if isinstance(v, float) else escape(str(v)) for v in group.key),
        f"{group.runs}{failed}",
        *(_text(group, n, figures[n]) if n in group.estimates else "" for n in names),
    ]


def _text(group: Group, name: str, figure: Figure) -> str:
    """An estimate, and of how many runs it is where it is not known in all."""
    estimate, runs = group.estimates[name], group.runs
    if figure.beside is not None:
        value = "-" if math.isnan(estimate.value) else f"{estimate.value:.3g}"
        return f"({value})" if is_theory_alone(group, figure) else value
    few = f" [dim]({estimate.runs} of {runs})[/dim]" if 0 < estimate.runs < runs else ""
    bound = f"{_CUT_OFF} " if is_cut_off(group, figure) else ""
    return bound + escape(text_of(estimate)) + few


def is_theory_alone(group: Group, figure: Figure) -> bool:
    """Whether the runs of a group saw nothing of what a figure of theory stands beside."""
    measured = None if figure.beside is None else group.estimates.get(figure.beside)
    return measured is not None and not measured.value > 0.0


def is_cut_off(group: Group, figure: Figure) -> bool:
    """Whether the ends of the runs of a group make a figure of it a lower bound."""
    count = None if figure.cut_off_by is None else group.estimates.get(figure.cut_off_by)
    return count is not None and count.value > 0.0


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
