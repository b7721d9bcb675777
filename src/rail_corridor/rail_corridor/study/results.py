"""What a study leaves behind: rows, a summary, a picture, and what must not have happened."""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from rich.console import Console
from rich.markup import escape

from rail_corridor.errors import InputError

from .comparison import moves
from .figures import Figure
from .journal import Entries, Entry, header_of
from .model import Study
from .picture import draw_study
from .rows import Rows, has_parquet, write_csv, write_parquet
from .summary import (
    Group,
    groups_of,
    print_summary,
    text_of,
    total_of,
    violations_of,
    write_summary,
)

JOURNAL: Final = "journal.jsonl"
#: Runs that are told one by one.
_MOST_TOLD: Final = 20


class StudyOutcome(NamedTuple):
    """What came of a study: groups of its runs, and how many were not as they must be."""

    study: Study
    entries: Entries
    groups: list[Group]
    violations: int
    failed: int


def with_all_figures(study: Study, entries: Entries) -> Study:
    """The study; one of a calculation that names no figures has all that there are."""
    if study.figures:
        return study
    return study.model_copy(update={"figures": {name: Figure() for name in entries.figures}})


def conclude(
    study: Study, entries: Entries, out: Path, code: str, console: Console, command: str
) -> StudyOutcome:
    """Write and show runs; ``command`` is that of the study, to which ``--only`` can be added."""
    study = with_all_figures(study, entries)
    rows = Rows(
        study.name,
        code,
        [*study.varied, *study.draw],
        [name for name in entries.facts if name not in study.figures],
        list(study.figures),
    )
    groups = groups_of(entries, study.columns, study.figures)
    if not groups:
        console.print("no run has ended")
        return StudyOutcome(study, entries, groups, 0, 0)
    write_csv(out / "rows.csv", rows, entries)
    if has_parquet():
        write_parquet(out / "rows.parquet", out / "rows.csv", rows, entries)
    total = total_of(groups, entries, study)
    print_summary(study, groups, console, total)
    write_summary(out / "summary.txt", study, groups, total)
    names = [name for name, figure in study.figures.items() if figure.beside is None]
    draw_study(out / "summary.png", study, groups, names)
    violated = _tell_violations(study, entries, console, command)
    failed = _tell_failures(entries, console, command)
    console.print(f"{len(entries)} rows in {out / 'rows.csv'}", soft_wrap=True)
    return StudyOutcome(study, entries, groups, violated, failed)


def _tell_violations(study: Study, entries: Entries, console: Console, command: str) -> int:
    """Show the first figures that are not as they must be; how many there are."""
    count = 0
    for violation in violations_of(entries, study.figures):
        count += 1
        if count <= _MOST_TOLD:
            value = "not known" if violation.value is None else f"{violation.value:g}"
            said = f"[red]{violation.figure} is {value}[/red]"
            console.print(f"{said}: {escape(_again(command, violation.entry))}", soft_wrap=True)
    if count > _MOST_TOLD:
        console.print(f"[red]{count} figures in all are not as they must be[/red]")
    return count


def _tell_failures(entries: Entries, console: Console, command: str) -> int:
    """Show the first runs that have failed; how many there are."""
    count = 0
    for entry in entries:
        if entry.failure is None:
            continue
        count += 1
        if count <= _MOST_TOLD:
            said = f"[red]failed:[/red] {escape(entry.failure)}"
            console.print(f"{said}: {escape(_again(command, entry))}", soft_wrap=True)
    if count > _MOST_TOLD:
        console.print(f"[red]{count} runs in all have failed[/red]")
    return count


def _again(command: str, entry: Entry) -> str:
    """The command that makes one run once more."""
    return f"{command} --only {entry.cell}:{entry.run}"


def entries_of(folder: Path, name: str) -> Entries:
    """Runs of an earlier study of that name; InputError if there are none in a folder."""
    path = folder / JOURNAL
    if not path.is_file():
        raise InputError(f"there is no {JOURNAL}", field="--compare", value=str(folder))
    found = header_of(path).name
    if found != name:
        reason = f"is of the study {found}, and this is {name}"
        raise InputError(reason, field="--compare", value=str(folder))
    return Entries(path)


def print_moves(before: Entries, now: StudyOutcome, console: Console) -> bool:
    """Show which figures have moved beyond their intervals; whether any has."""
    study = now.study
    # A sum grows with the runs; what can be compared is what it is in one.
    figures = {
        name: figure.model_copy(update={"over_runs": "mean"})
        if figure.over_runs == "sum"
        else figure
        for name, figure in study.figures.items()
    }
    old = groups_of(before, study.columns, figures)
    compared, found = moves(old, groups_of(now.entries, study.columns, figures), figures)
    for move in found:
        key = zip(study.columns, move.key, strict=True)
        where = ", ".join(f"{name} {value}" for name, value in key)
        said = f"{move.figure}: {text_of(move.before)}, now {text_of(move.now)}"
        said = escape(f"{where + ': ' if where else ''}{said}")
        console.print(f"[yellow]moved:[/yellow] {said}", soft_wrap=True)
    if not compared:
        console.print("[yellow]no group of runs is in both studies[/yellow]")
    elif not found:
        console.print(f"nothing has moved beyond its interval in {compared} groups")
    return bool(found)
