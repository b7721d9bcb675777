"""The rows of a study: one for every run that counts, in the order of cells and seeds."""

from __future__ import annotations

import csv
import importlib.util
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from .journal import Entry
from .model import RESERVED

*_FIRST, _LAST = RESERVED


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

    def row(self, entry: Entry) -> list[Any]:
        """One row, column by column; None where a value is not known."""
        return [
            *(self._study, self._version, *entry.key, entry.seed),
            *(entry.values.get(name) for name in self.values),
            *(entry.facts.get(name) for name in self.facts),
            *(_short(entry.figures.get(name)) for name in self.figures),
            entry.failure,
        ]


def _short(value: float | None) -> float | None:
    """A count as one: 12, not 12.0."""
    return int(value) if value is not None and float(value).is_integer() else value


def write_csv(path: Path, rows: Rows, entries: Iterable[Entry]) -> None:
    """Write a CSV file; what is not known is an empty cell."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(rows.columns)
        writer.writerows(map(rows.row, entries))


def has_parquet() -> bool:
    """Whether Parquet files can be written: pyarrow is an extra."""
    return importlib.util.find_spec("pyarrow") is not None


def write_parquet(path: Path, csv_path: Path, rows: Rows, entries: Iterable[Entry]) -> None:
    """Make a Parquet file of one of `write_csv`, piece by piece; see `has_parquet`.

    Figures are floating-point numbers; what was set or drawn is a number where it always is, and
    else a text.
    """
    from importlib import import_module

    pa, pq = import_module("pyarrow"), import_module("pyarrow.parquet")
    reader = import_module("pyarrow.csv")
    kinds: dict[str, set[type]] = {name: set() for name in (*rows.values, *rows.facts)}
    for entry in entries:
        found = {**entry.facts, **entry.values}
        for name, seen in kinds.items():
            seen.add(type(found.get(name)))
    types = {
        **dict.fromkeys(("cell", "run", "seed"), pa.int64()),
        **dict.fromkeys(rows.figures, pa.float64()),
        **{name: _type_of(pa, seen) for name, seen in kinds.items()},
    }
    schema = pa.schema([(name, types.get(name, pa.string())) for name in rows.columns])
    options = reader.ConvertOptions(column_types=schema, strings_can_be_null=True, null_values=[""])
    lines = reader.ParseOptions(newlines_in_values=True)  # a failure may tell more than one
    with (
        reader.open_csv(csv_path, parse_options=lines, convert_options=options) as pieces,
        pq.ParquetWriter(path, schema) as writer,
    ):
        for piece in pieces:
            writer.write_batch(piece)


def _type_of(pa: Any, kinds: set[type]) -> Any:
    kinds = kinds - {type(None)}
    for plain, as_type in ((bool, pa.bool_()), (int, pa.int64()), (float, pa.float64())):
        if kinds == {plain}:
            return as_type
    return pa.float64() if kinds == {int, float} else pa.string()
