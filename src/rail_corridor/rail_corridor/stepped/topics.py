"""What has been on a topic so far, as typed views."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message

from rail_msgs_py.delivery import serialised
from rail_msgs_py.position import Position
from rail_msgs_py.table import Table
from rail_msgs_py.topics.topic import Topic


class NotKnownError(ValueError):
    """A value was compared that is not known."""


class NotKnown(float):
    """NaN in a table: neither more nor less than anything, and so is what is computed from it.

    >>> value = NotKnown()
    >>> value == value, abs(value - 3.0)
    (False, nan)
    >>> 3.0 <= abs(value - 3.0)
    Traceback (most recent call last):
        ...
    rail_corridor.stepped.topics.NotKnownError: compared with a value that is not known
    """

    def __new__(cls) -> NotKnown:
        """Make the one there is to say."""
        return super().__new__(cls, "nan")

    def _refuse(self, other: object) -> bool:
        raise NotKnownError("compared with a value that is not known")

    __lt__ = __le__ = __gt__ = __ge__ = _refuse

    def __eq__(self, other: object) -> bool:
        return False if other is self else self._refuse(other)  # as of NaN: a test for it

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __bool__(self) -> bool:
        return self._refuse(None)

    __hash__ = float.__hash__

    def _unknown(self, *_: object) -> NotKnown:
        return self

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = _unknown
    __truediv__ = __rtruediv__ = __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = _unknown
    __pow__ = __rpow__ = __neg__ = __pos__ = __abs__ = __round__ = _unknown  # type: ignore[assignment]


class RowView:
    """One row of a table: its columns are attributes; NaN is `NotKnown`.

    >>> view = RowView(5, "train_a", ("speed_mps", "warning"), [3.5, 1.0])
    >>> view.speed_mps, view.stamp_s
    (3.5, 5e-09)
    """

    __slots__ = ("_columns", "_values", "row", "stamp_ns")

    def __init__(
        self, stamp_ns: int, row: str, columns: tuple[str, ...], values: Sequence[float]
    ) -> None:
        self.stamp_ns, self.row = stamp_ns, row
        self._columns, self._values = columns, values

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self._columns

    @property
    def stamp_s(self) -> float:
        """Simulated time [s]."""
        return self.stamp_ns * 1e-9

    def as_dict(self) -> dict[str, float]:
        """Values by column."""
        return dict(zip(self._columns, map(float, self._values), strict=True))

    def __getattr__(self, name: str) -> float:
        if name in self._columns:
            value = float(self._values[self._columns.index(name)])
            return value if value == value else NotKnown()
        raise AttributeError(f"no column {name}; there are {', '.join(self._columns)}")

    def __repr__(self) -> str:
        cells = zip(self._columns, self._values, strict=True)
        said = ", ".join(f"{column}={float(value):.6g}" for column, value in cells)
        return f"<{self.stamp_s:.3f} s {self.row}: {said}>"


class TableView:
    """A table of several rows, or of none: ``view["train_a"].speed_mps``."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self.stamp_ns = table.stamp_ns
        self.columns = table.columns

    @property
    def stamp_s(self) -> float:
        """Simulated time [s]."""
        return self.stamp_ns * 1e-9

    @property
    def rows(self) -> tuple[RowView, ...]:
        """All rows, in their order."""
        table = self._table
        return tuple(
            RowView(table.stamp_ns, name, table.columns, values)
            for name, values in zip(table.rows, np.asarray(table.values).tolist(), strict=True)
        )

    def __getitem__(self, name: str) -> RowView:
        for row in self.rows:
            if row.row == name:
                return row
        raise KeyError(f"no row {name}; there are {', '.join(self._table.rows)}")

    def __repr__(self) -> str:
        return f"<{self.stamp_s:.3f} s, rows {', '.join(self._table.rows)}>"


def view_of(topic: Topic | None, kind: Any, message: Any) -> Any:
    """Typed view of what was sent: serialised, or a view already.

    Of a table with one row that row; of a topic without a view the ROS message.
    """
    wanted = None if topic is None else topic.view
    if wanted is None or not isinstance(message, wanted):
        message = deserialize_message(serialised(message), kind)
        if wanted is not None:
            message = wanted.from_msg(message)
    if isinstance(message, Position) and not message.known:
        # What it holds is the last that was known, which is no position now.
        return replace(message, chainage_m=NotKnown(), speed_mps=NotKnown())
    if not isinstance(message, Table):
        return message
    if len(message.rows) != 1:
        return TableView(message)
    values = message.values[0].tolist()
    return RowView(message.stamp_ns, message.rows[0], message.columns, values)


class TopicHistory:
    """Messages of one topic, in the order in which they were sent.

    Parameters
    ----------
    name : str
        Absolute name.
    topic : Topic, optional
        Its kind, if it is of the corridor's table.
    kind : message class
    tick : callable
        Number of the tick at hand.
    looked_at : dict, optional
        Is told the name of the topic whenever somebody looks at its messages.
    """

    def __init__(
        self,
        name: str,
        topic: Topic | None,
        kind: Any,
        tick: Callable[[], int],
        looked_at: dict[str, None] | None = None,
    ) -> None:
        self.name = name
        self._looked_at = {} if looked_at is None else looked_at
        self._topic, self._kind, self._tick = topic, kind, tick
        #: As they were sent: serialised, or as views.
        self.sent: list[Any] = []
        #: Tick in which each message came.
        self.ticks: list[int] = []

    def take(self, message: Any) -> None:
        """Keep a message, as it was sent."""
        self.sent.append(message)
        self.ticks.append(self._tick())

    @property
    def count(self) -> int:
        """Number of messages so far."""
        self._looked_at[self.name] = None
        return len(self.sent)

    def newest(self, count: int) -> list[Any]:
        """Views of the newest messages, the newest last; fewer if there are not so many."""
        self._looked_at[self.name] = None
        return [view_of(self._topic, self._kind, message) for message in self.sent[-count:]]

    @property
    def latest(self) -> Any:
        """View of the newest message.

        Raises
        ------
        LookupError
            If there is none yet.
        """
        self._looked_at[self.name] = None
        if not self.sent:
            raise LookupError(f"{self.name}: nothing has been sent on it yet")
        return view_of(self._topic, self._kind, self.sent[-1])

    @property
    def all(self) -> list[Any]:
        """Views of all messages."""
        return list(self)

    def __iter__(self) -> Iterator[Any]:
        self._looked_at[self.name] = None
        return (view_of(self._topic, self._kind, message) for message in self.sent)

    def __len__(self) -> int:
        return len(self.sent)

    def __repr__(self) -> str:
        last = f", last {self.latest!r}" if self.sent else ""
        return f"<{self.name}: {len(self.sent)} messages{last}>"
