"""Journals and rows: what counts, in which order, and the same in every kind of file."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from rail_corridor.errors import InputError
from rail_corridor.study.journal import Entries, Entry, Header, Journal
from rail_corridor.study.rows import Rows, write_csv, write_parquet

HEADER = Header("noise", "0123", "1.0")


def entry(cell: int, run: int, *, failure: str | None = None, **changes: Any) -> Entry:
    values = {"cbtc.scheme": "mrc", "tick_s": 0.1 * (cell + 1)} | changes
    figures = {} if failure else {"gap_m": 1.5 * run, "trips": None}
    return Entry(cell, run, run + 1, values, {"killed": run % 2 == 0}, figures, failure, 0.1)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a journal of runs that came in out of order, one of them again."""
    journal = Journal(tmp_path / "a" / "journal.jsonl", HEADER, resume=False)
    assert not journal.path.exists()
    for each in (
        entry(1, 0),
        entry(0, 1, failure="it fell,\nand broke"),
        entry(0, 0),
        entry(0, 2),
        entry(0, 1),
        entry(1, 1, failure='it said "no"\nand left'),
    ):
        journal.add(each)
    journal.close()
    return journal.path


def test_the_last_try_of_each_run_counts_in_the_order_of_cells_and_runs(path: Path) -> None:
    entries = Entries(path)
    assert [each.key for each in entries] == [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1)]
    assert [each.failure is None for each in entries] == [True] * 4 + [False]
    assert (len(entries), entries.facts, entries.figures) == (5, ("killed",), ("gap_m", "trips"))
    assert [each.key for each in Entries(path, {0: 2})] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert len(Entries(path.parent / "none.jsonl")) == 0


def test_a_line_that_was_cut_short_is_forgotten_and_one_that_is_wrong_is_told(path: Path) -> None:
    with path.open("a") as file:
        file.write('{"cell": 4')
    assert len(Entries(path)) == 5
    Journal(path, HEADER, resume=True).close()
    journal = Journal(path, HEADER, resume=True)
    journal.add(entry(1, 2))
    journal.close()
    assert [each.key for each in Entries(path)][-1] == (1, 2)
    with path.open("a") as file:
        file.write("[1, 2]\n")
    with pytest.raises(InputError, match=r"journal\.jsonl: .*is no run of a study"):
        Entries(path)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (HEADER._replace(fingerprint="4567"), "is of another study, noise, or one in which"),
        (HEADER._replace(version="1.1"), r"is of version 1\.0, and this is 1\.1: name another"),
    ],
)
def test_what_another_study_or_version_has_made_is_not_gone_on_with(
    path: Path, header: Header, said: str
) -> None:
    with pytest.raises(InputError, match=said):
        Journal(path, header, resume=True)
    path.write_text("cell,run\n")
    with pytest.raises(InputError, match="is no journal of a study"):
        Journal(path, header, resume=True)


def test_a_csv_and_a_parquet_file_say_the_same(path: Path, tmp_path: Path) -> None:
    entries = Entries(path)
    rows = Rows("noise", "1.0", ["cbtc.scheme", "tick_s"], entries.facts, entries.figures)
    as_csv, as_parquet = tmp_path / "rows.csv", tmp_path / "rows.parquet"
    write_csv(as_csv, rows, entries)
    write_parquet(as_parquet, as_csv, rows, entries)
    table = pq.read_table(as_parquet)
    assert table.column_names == list(rows.columns)
    kinds = {name: str(table.schema.field(name).type) for name in table.column_names}
    assert (kinds["seed"], kinds["tick_s"], kinds["killed"]) == ("int64", "double", "bool")
    assert (kinds["cbtc.scheme"], kinds["gap_m"], kinds["failure"]) == (
        "string",
        "double",
        "string",
    )
    found = table.to_pylist()
    assert [list(row.values()) for row in found] == [rows.row(each) for each in entries]
    with as_csv.open(newline="") as file:
        written = list(csv.DictReader(file))
    assert [row["failure"] or None for row in written] == [row["failure"] for row in found]
    assert [float(row["tick_s"]) for row in written] == [row["tick_s"] for row in found]


def test_values_of_several_kinds_are_texts(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl", HEADER, resume=False)
    for run, value in enumerate((1, 2.5, None, "all", [1, 2])):
        journal.add(entry(0, run, tick_s=value))
    journal.close()
    entries = Entries(journal.path)
    rows = Rows("noise", "1.0", ["tick_s"], (), entries.figures)
    write_csv(tmp_path / "rows.csv", rows, entries)
    write_parquet(tmp_path / "rows.parquet", tmp_path / "rows.csv", rows, entries)
    values = pq.read_table(tmp_path / "rows.parquet")["tick_s"].to_pylist()
    assert values == ["1", "2.5", None, "all", "[1, 2]"]
