"""``rail plan``: the nodes of a scenario, and the files to start them by hand."""

from __future__ import annotations

import tempfile
from pathlib import Path

from rich.console import Console

from rail_corridor.errors import InputError
from rail_corridor.plan.parameter_files import COMMANDS, module_of, write_plan
from rail_corridor.plan.plan import Plan, make_plan
from rail_corridor.run.options import default_placement
from rail_corridor.scenario.model import Scenario


def show_plan(scenario: Scenario, directory: Path | None, console: Console) -> int:
    """Print the nodes of a scenario, or write them as files; returns the exit code."""
    if directory is None:
        with tempfile.TemporaryDirectory() as temporary:
            plan = make_plan(scenario, Path(temporary))
        for line in table(plan):
            console.print(line, soft_wrap=True, highlight=False, markup=False)
        return 0
    try:
        plan = write_plan(scenario, directory)
    except OSError as error:
        reason = error.strerror or "cannot be written"
        raise InputError(reason, field="--write", value=str(error.filename)) from None
    line = f"{len(plan.nodes)} nodes written to {directory}; bash {directory / COMMANDS}"
    console.print(f"{line} starts them all", soft_wrap=True, highlight=False, markup=False)
    return 0


def table(plan: Plan) -> list[str]:
    """Lines of the table of nodes, whatever the width of the terminal: for grep and the eye."""
    groups = plan.groups(default_placement(plan))
    process = {spec.name: name for name, specs in groups.items() for spec in specs}
    rows = [("kind", "module", "namespace", "name", "process")]
    for spec in plan.nodes:
        namespace, _, name = spec.name.rpartition("/")
        rows.append((spec.kind, module_of(spec), namespace or "/", name, process[spec.name]))
    wide = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, wide, strict=True)).rstrip()
        for row in rows
    ]
