"""``rail bench``: runs the benchmarks of the source tree and shows their rows."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from rail_corridor.errors import InputError

COLUMNS = ("name", "unit", "ours", "peer_name", "peer", "ratio", "bound")
_FOLDER = Path(__file__).resolve().parents[4] / "benchmarks"
#: Module of the benchmarks folder -> first part of the names of its rows.
MODULES = {
    "ranging_receive": "ranging",
    "track_code_decode": "track_code",
    "cbtc_ber": "cbtc",
    "doppler_solve": "doppler",
    "train_bus_traces": "train_bus",
    "corridor_speed": "corridor",
    "recording_cost": "corridor",
    "study_speed": "study",
}


def run_benchmarks(names: tuple[str, ...], path: Path | None) -> int:
    """Run benchmarks, print their rows and write them; returns the exit code.

    Parameters
    ----------
    names : tuple of str
        Rows wanted, or the first part of their names, as ``corridor``; all if empty.
    path : Path, optional
        JSON file to write.
    """
    if not _FOLDER.is_dir():
        raise InputError("benchmarks are part of the source tree, not of the installed package")
    wanted = [name for name in MODULES if _is_wanted(MODULES[name], names)]
    unknown = [n for n in names if n.split(".")[0] not in MODULES.values()]
    if unknown:
        known = ", ".join(sorted(set(MODULES.values())))
        raise InputError(f"no such benchmark; there are {known}", field="NAME", value=unknown[0])
    console = Console()
    rows: list[dict[str, Any]] = []
    for name in wanted:
        console.print(f"running {name} ...", highlight=False)
        rows += [row for row in _rows_of(name)(names) if _is_row_wanted(row["name"], names)]
    _show(rows, console)
    if path is not None:
        path.write_text(json.dumps(rows, indent=2) + "\n")
    return 0


def _is_wanted(prefix: str, names: tuple[str, ...]) -> bool:
    return not names or any(name.split(".")[0] == prefix for name in names)


def _is_row_wanted(row: str, names: tuple[str, ...]) -> bool:
    return not names or any(
        row == name or row.startswith((f"{name}.", f"{name}_")) for name in names
    )


def _rows_of(name: str) -> Callable[[tuple[str, ...]], Iterator[dict[str, Any]]]:
    """The ``rows`` function of a module in the benchmarks folder."""
    if str(_FOLDER) not in sys.path:
        sys.path.insert(0, str(_FOLDER))
    module = importlib.import_module(name)

    def rows(names: tuple[str, ...]) -> Iterator[dict[str, Any]]:
        # A module whose rows take long is told which of them are wanted.
        takes_names = module.rows.__code__.co_argcount > 0
        yield from module.rows(names) if takes_names else module.rows()

    return rows


def _show(rows: list[dict[str, Any]], console: Console) -> None:
    table = Table()
    for column in COLUMNS:
        left = column in ("name", "unit", "peer_name")
        table.add_column(column, justify="left" if left else "right", overflow="fold")
    for row in rows:
        table.add_row(*(_text(row.get(column)) for column in COLUMNS))
    console.print(table)


def _text(value: Any) -> str:
    if value is None:
        return "-"
    return (
        f"{value:.3g}"
        if isinstance(value, float) and value < 1e4
        else (f"{value:,.0f}" if isinstance(value, float) else str(value))
    )
