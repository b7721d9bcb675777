"""Fields of messages by name: columns of tables, attributes of views, paths in raw messages.

A message is one or more *records*, a mapping from names to values: one for each row of a table,
one for any other message. ``row.column`` names a value whatever the record.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from rail_msgs_py.stamps import to_ns
from rail_msgs_py.table import Table

from .topic_kinds import kind_of
from .usage import UsageError

STAMP, ROW = "stamp_s", "row"
_INDEX = re.compile(r"\[(\d+)\]")
_SHOWN = (bool, int, float, str, tuple, np.bool_, np.integer, np.floating)


class UnknownField(UsageError):
    """A name that is no field of a message; the text says which there are."""

    def __init__(self, name: str, known: Iterable[str]) -> None:
        super().__init__(f"{name}: is no such field; there are {', '.join(known)}")


class Record:
    """Values of one row of a table, or of one message, by the names of its fields.

    Parameters
    ----------
    stamp_s : float or None
        Simulated time of the message.
    row : str or None
        Name of the row; None if the message has no rows.
    content : Table, view or message
    """

    def __init__(self, stamp_s: float | None, row: str | None, content: Any) -> None:
        self.stamp_s, self.row = stamp_s, row
        self._content = content

    def __getitem__(self, name: str) -> Any:
        """Value of a field; UnknownField if there is none of this name."""
        if name == STAMP:
            return self.stamp_s
        if isinstance(self._content, Table):
            return self._cell(self._content, name)
        return _scalar(_followed(self._content, name))

    def _cell(self, table: Table, name: str) -> Any:
        if name == ROW:
            return self.row
        row, _, column = name.rpartition(".")
        row = row or self.row or ""
        if column not in table.columns:
            raise UnknownField(name, table.columns)
        if row not in table.rows:
            raise UnknownField(name, [f"{each}.{column}" for each in table.rows])
        return float(table.values[table.rows.index(row), table.columns.index(column)])

    @property
    def default_fields(self) -> tuple[str, ...]:
        """What is shown where no fields are chosen: all but arrays and lists."""
        if isinstance(self._content, Table):
            return self._content.columns
        return tuple(_shown_fields(self._content))

    @property
    def message(self) -> Any:
        """The message, where it is read as it is; None where a view of it is read."""
        return self._content if hasattr(self._content, "get_fields_and_field_types") else None


def _followed(content: Any, path: str) -> Any:
    value = content
    for part in _INDEX.sub(r".\1", path).split("."):
        try:
            if part.isdecimal():
                value = value[int(part)]
                continue
            if part not in field_names(value):
                raise UnknownField(path, field_names(value))
            value = getattr(value, part)
        except (IndexError, TypeError):
            raise UsageError(f"{path}: has no item {part}") from None
    return value


def _scalar(value: Any) -> Any:
    """A value of Python where it is one value: NumPy's print and serialise otherwise."""
    if isinstance(value, np.generic):
        return value.item()
    return value


def field_names(content: Any) -> tuple[str, ...]:
    """Names of the fields of a message, or of the public attributes of a view or its class."""
    if hasattr(content, "get_fields_and_field_types"):
        return tuple(content.get_fields_and_field_types())
    kind = content if isinstance(content, type) else type(content)
    declared = list(getattr(kind, "__dataclass_fields__", ()))
    computed = [
        name
        for name, member in vars(kind).items()
        if isinstance(member, property | cached_property) and not name.startswith("_")
    ]
    return tuple(declared + computed)


def _shown_fields(content: Any, prefix: str = "") -> Iterable[str]:
    for name in field_names(content):
        try:
            value = getattr(content, name)
        except (IndexError, ValueError):  # of a block without samples the first row, for example
            continue
        if isinstance(value, _SHOWN) and name != "stamp_ns":
            yield prefix + name
        elif hasattr(value, "get_fields_and_field_types"):
            yield from _shown_fields(value, f"{prefix}{name}.")


class Records(NamedTuple):
    """Records of one message.

    Parameters
    ----------
    stamp_s : float or None
        Simulated time.
    records : list of Record
    has_rows : bool
        Whether they are rows among which the name tells one from another.
    """

    stamp_s: float | None
    records: list[Record]
    has_rows: bool


class RecordReader:
    """Reads the records of the messages of one topic.

    Parameters
    ----------
    topic : str
        Absolute name.
    row : str, optional
        Of a table: this row alone.
    raw : bool
        Whether the fields are those of the message, not of its view.
    names : iterable of str
        Fields that will be asked for.

    Raises
    ------
    UsageError
        If it is known already that a field is none of the topic's, or the topic has no rows.
    """

    def __init__(
        self, topic: str, row: str | None = None, *, raw: bool = False, names: Iterable[str] = ()
    ) -> None:
        kind = kind_of(topic)
        self._view = None if raw or kind is None else kind.view
        self._row = row
        names = [name for name in names if name not in (STAMP, ROW)]
        if row is not None and self._view is not Table:
            raise UsageError(f"--row: {row}: {topic} has no rows")
        self._across = self._view is Table and any("." in name for name in names)
        if self._view is Table and kind is not None and kind.columns:
            for name in names:
                if name.rpartition(".")[2] not in kind.columns:
                    raise UnknownField(name, kind.columns)
        elif self._view not in (None, Table):
            for name in names:
                if re.split(r"[.\[]", name)[0] not in field_names(self._view):
                    raise UnknownField(name, field_names(self._view))

    def read(self, message: Any) -> Records:
        """Records of a message; UsageError if its table has not the row that is wanted."""
        content = message if self._view is None else self._view.from_msg(message)
        if not isinstance(content, Table):
            stamp_s = stamp_of(message) if self._view is None else content.stamp_ns * 1e-9
            return Records(stamp_s, [Record(stamp_s, None, content)], False)
        stamp_s = content.stamp_ns * 1e-9
        if self._row is not None:
            if self._row not in content.rows:
                raise UsageError(
                    f"--row: {self._row}: is no such row; there are {', '.join(content.rows)}"
                )
            return Records(stamp_s, [Record(stamp_s, self._row, content)], False)
        if self._across:
            only = content.rows[0] if len(content.rows) == 1 else None
            return Records(stamp_s, [Record(stamp_s, only, content)], False)
        records = [Record(stamp_s, name, content) for name in content.rows]
        return Records(stamp_s, records, len(records) != 1)


def stamp_of(message: Any) -> float | None:
    """Simulated time [s] that a message carries, None if it carries none."""
    header = getattr(message, "header", None)
    stamp = getattr(message, "clock", getattr(header, "stamp", getattr(message, "stamp", None)))
    if stamp is not None:
        return to_ns(stamp) * 1e-9
    layout = getattr(message, "layout", None)
    if layout is not None and layout.data_offset > 0 and len(message.data) > 0:
        return float(message.data[0])
    return None
