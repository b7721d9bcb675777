"""The table of a run on a terminal."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from .results import Results, TestResult

_STYLES = {"passed": "green", "failed": "bold red", "not applicable": "dim"}


def print_results(title: str, results: Results, console: Console) -> None:
    """Clause, test and verdict of each, then why those failed that did."""
    table = Table(title=title, title_justify="left")
    for column in ("test", "clauses", "verdict"):
        table.add_column(column, overflow="fold")
    for test in results.tests:
        style = _STYLES[test.verdict]
        table.add_row(
            escape(test.name), escape("\n".join(test.clauses)), f"[{style}]{test.verdict}[/{style}]"
        )
    console.print(table)
    for test in results.tests:
        if test.verdict == "failed":
            _print_failure(test, console)
    said = [f"{results.count(verdict)} {verdict}" for verdict in _STYLES if results.count(verdict)]
    console.print(", ".join(said))


def _print_failure(test: TestResult, console: Console) -> None:
    lines = [f"failed {test.name}: {test.words}"]
    if test.recording is not None:
        lines.append(f"  recording: {test.recording}")
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False, markup=False)


def print_list(tests: Iterable[TestResult], console: Console) -> None:
    """Names of tests, what they show, and their clauses."""
    for test in tests:
        for line in (test.name, f"    {test.text}", *(f"    {each}" for each in test.clauses)):
            console.print(line, soft_wrap=True, highlight=False, markup=False)
