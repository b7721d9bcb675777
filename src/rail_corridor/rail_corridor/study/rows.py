"""The rows of a study: one for every run that counts, in the order of cells and seeds."""

from __future__ import annotations

import csv
import importlib.util
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from .journal import Entry

_FIRST: Final = ("study", "version", "cell", "run", "seed")
_LAST: Final = "failure"


class Rows:
    """Rows of entries, as plain values.

    Parameters
    ----------
    study, version : str
        Its name, and that of the code.
    values, facts, figures : sequence of str
        Columns: fields that were varied or drawn, what else was drawn, figures.
    """

    def __init__(
        self,
        study: str,
        version: str,
        values: Sequence[str],
        facts: Sequence[str],
        figures: Sequence[str],
    ) -> None:
        self._study, self._version = study, version
        self.values, self.facts, self.figures = tuple(values), tuple(facts), tuple(figures)
        self.columns = (*_FIRST, *self.values, *self.facts, *self.figures, _LAST)

    def row(self, entry: Entry) -> dict[str, Any]:
        """One row, by column."""
        return {
            **dict(zip(_FIRST, (self._study, self._version, *entry.key, entry.seed), strict=True)),
            **{name: entry.values.get(name) for name in self.values},
            **{name: entry.facts.get(name) for name in self.facts},
            **{name: entry.figures.get(name) for name in self.figures},
            _LAST: entry.failure,
        }


def counting(entries: Iterable[Entry], ended: Mapping[int, int]) -> list[Entry]:
    """Those that count: the last of each run, none after the end of its cell."""
    last = {entry.key: entry for entry in entries}
    return [last[key] for key in sorted(last) if key[1] < ended.get(key[0], 1 << 62)]


def write_csv(path: Path, rows: Rows, entries: Iterable[Entry]) -> None:
    """Write a CSV file; what is not known is an empty cell."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows.columns)
        writer.writeheader()
        writer.writerows(map(rows.row, entries))


def write_parquet(path: Path, rows: Rows, entries: Iterable[Entry]) -> bool:
    """Write a Parquet file; whether that could be, which takes pyarrow."""
    if importlib.util.find_spec("pyarrow") is None:
        return False
    from importlib import import_module

    pa, pq = import_module("pyarrow"), import_module("pyarrow.parquet")

    table = [rows.row(entry) for entry in entries]
    columns = {name: [row[name] for row in table] for name in rows.columns}
    # Values of a field may be of several kinds.
    plain = {
        name: [None if v is None else str(v) for v in column] if _is_mixed(column) else column
        for name, column in columns.items()
    }
    pq.write_table(pa.table(plain), path)
    return True


def _is_mixed(column: Sequence[Any]) -> bool:
    kinds = {type(value) for value in column if value is not None}
    return (len(kinds - {int, float}) > 0 and len(kinds) > 1) or bool(kinds & {dict, list})


def read_csv(path: Path) -> Iterator[dict[str, str]]:
    """Rows of a file that a study has written."""
    with path.open(newline="") as file:
        yield from csv.DictReader(file)


def number(text: str | float | None) -> float:
    """A cell as a number, NaN where it is not known."""
    return float(text) if text not in (None, "") else math.nan
