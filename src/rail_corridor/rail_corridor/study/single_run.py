"""One run of a study by itself: for those who look into it, or look for figures."""

from __future__ import annotations

import re

from rich.console import Console

from rail_corridor.errors import InputError

from .cells import case_of, cells_of
from .figures import places_of
from .model import Study
from .sources import Source


def show_run(study: Study, source: Source, place: str, console: Console) -> int:
    """Make one run in this process and show it; the exit code, 1 if a figure is wrong.

    Raises
    ------
    InputError
        If there is no such run.
    """
    cells = cells_of(study)
    found = re.fullmatch(r"(\d+):(\d+)", place)
    cell, run = map(int, found.groups()) if found else (len(cells), 0)
    if cell >= len(cells):
        reason = f"must be CELL:RUN, a cell from 0 to {len(cells) - 1}"
        raise InputError(reason, field="--only", value=place)
    case = case_of(study, cells, cell, run)
    outcome = source.run(case.values, case.seed, study.figures)
    for name, value in ({"seed": case.seed} | dict(case.values) | outcome.facts).items():
        console.print(f"{name}: {value}", soft_wrap=True)
    wrong = False
    for name, value in outcome.figures.items():
        figure = study.figures.get(name)
        bad = figure is not None and figure.violated_by(value)
        wrong |= bad
        console.print(f"[{'red' if bad else 'default'}]{name}: {value}[/]", soft_wrap=True)
    return 1 if wrong else 0


def show_places(study: Study, source: Source, console: Console) -> None:
    """Show what figures can be of, from the first tick of the first run."""
    case = case_of(study, cells_of(study), 0, 0)
    _, report = source.report(case.values, case.seed, ticks=1 if source.has_ticks else None)
    for place, value in places_of(report).items():
        shown = "" if value is None else f"[dim]{value}[/dim]"
        console.print(f"{place}  {shown}", soft_wrap=True, highlight=False)
