"""``rail echo``: which messages of a topic are shown, which of their fields, and in which form."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable
from typing import Any

from .decoded import decode, raw_text, values_line
from .fields import ROW, STAMP, Record, RecordReader, Records
from .selection import Selection
from .topic_kinds import kind_of


class Echo:
    """Puts the messages of one topic into text, one after the other.

    Parameters
    ----------
    topic : str
        Absolute name.
    selection : Selection
    write : callable of a text
        Takes lines, without the end of the last.

    Raises
    ------
    UsageError
        If a field is none of the topic's.
    """

    def __init__(self, topic: str, selection: Selection, write: Callable[[str], None]) -> None:
        self._topic, self._selection, self._write = topic, selection, write
        names = (*selection.fields, *(selection.where.fields if selection.where else ()))
        self._reader = RecordReader(topic, selection.row, raw=selection.raw, names=names)
        self._passed = self._shown = 0
        self._columns: tuple[str, ...] = ()
        # As a whole a message is in better words than its fields one by one.
        self._whole = selection.format == "text" and not selection.fields and selection.row is None

    @property
    def complete(self) -> bool:
        """Whether as many messages have been shown as were asked for."""
        return self._selection.count is not None and self._shown >= self._selection.count

    def take(self, message: Any) -> None:
        """Show a message, if it is one of those; UsageError if it lacks a field."""
        if self.complete:
            return
        chosen = self._selection
        if self._whole and chosen.where is None:
            if self._is_next():
                self._write(raw_text(message) if chosen.raw else decode(self._topic, message))
            return
        try:
            read = self._reader.read(message)
        except ValueError:  # not what its topic carries
            if self._whole:
                self._write(decode(self._topic, message))
            return
        passed = [each for each in read.records if chosen.where is None or chosen.where(each)]
        if (passed or (chosen.where is None and chosen.format == "json")) and self._is_next():
            self._show(message, read, passed)

    def _is_next(self) -> bool:
        """Count a message that passes; whether it is to be shown."""
        self._passed += 1
        if (self._passed - 1) % self._selection.every:
            return False
        self._shown += 1
        return True

    def _show(self, message: Any, read: Records, records: list[Record]) -> None:
        if self._whole and not read.has_rows:
            text = raw_text(message) if self._selection.raw else decode(self._topic, message)
            self._write(text)
        elif self._selection.format == "csv":
            self._show_csv(read, records)
        elif self._selection.format == "json":
            self._write(json.dumps(self._object(read, records), allow_nan=False))
        else:
            self._write("\n".join(self._line(record) for record in records))

    def _names(self, record: Record) -> tuple[str, ...]:
        return self._selection.fields or record.default_fields

    def _line(self, record: Record) -> str:
        pairs = [(name, record[name]) for name in self._names(record) if name != STAMP]
        return values_line(record.stamp_s, record.row, pairs)

    def _show_csv(self, read: Records, records: list[Record]) -> None:
        lines = io.StringIO()
        writer = csv.writer(lines, lineterminator="\n")
        for record in records:
            if not self._columns:
                names = [name for name in self._names(record) if name != STAMP]
                if read.has_rows and ROW not in names:
                    names.insert(0, ROW)
                self._columns = (STAMP, *names)
                writer.writerow(self._columns)
            writer.writerow([_cell(record[name]) for name in self._columns])
        if records:
            self._write(lines.getvalue().removesuffix("\n"))

    def _object(self, read: Records, records: list[Record]) -> dict[str, Any]:
        head = {STAMP: _plain(read.stamp_s)}
        if not read.has_rows:
            return head | self._values(records[0])
        return head | {"rows": {record.row: self._values(record) for record in records}}

    def _values(self, record: Record) -> dict[str, Any]:
        if record.message is not None and not self._selection.fields:
            whole: dict[str, Any] = _plain(record.message)
            return whole
        return {name: _plain(record[name]) for name in self._names(record) if name != STAMP}


def column_lines(topic: str, fields: tuple[str, ...] = ()) -> list[str]:
    """One line for each column of a table that says what it is; none where nothing is said.

    Parameters
    ----------
    topic : str
        Absolute name.
    fields : tuple of str
        Only what these name, if there are any.
    """
    kind = kind_of(topic)
    texts: tuple[str, ...] = getattr(kind, "column_texts", ())
    if kind is None or not texts:
        return []
    chosen = {name.rpartition(".")[2] for name in fields} or {*kind.columns}
    pairs = [pair for pair in zip(kind.columns, texts, strict=True) if pair[0] in chosen]
    wide = max((len(column) for column, _ in pairs), default=0)
    return [f"# {column:{wide}}  {text}" for column, text in pairs]


def _cell(value: Any) -> str:
    """A value in CSV: numbers in full, empty where there is none."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float | str):
        return str(value)
    return json.dumps(_plain(value))


def _plain(value: Any) -> Any:
    """A value as JSON can hold it: what is not finite as "inf", "-inf", "nan"."""
    if isinstance(value, float):
        return value if math.isfinite(value) else str(value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, bytes):
        return value[0] if len(value) == 1 else value.hex()  # an octet, or many
    if isinstance(value, complex):
        return [_plain(value.real), _plain(value.imag)]
    if hasattr(value, "get_fields_and_field_types"):
        return {name: _plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if hasattr(value, "tolist"):
        return _plain(value.tolist())
    return [_plain(item) for item in value] if hasattr(value, "__iter__") else str(value)
