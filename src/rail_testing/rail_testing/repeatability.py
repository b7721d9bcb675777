"""Whether two runs said the same: the first message that differs, by tick, topic and field."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from rail_corridor.stepped.topics import RowView, TableView, TopicHistory

#: Topics whose order is that of wall time, not of the run.
_UNORDERED = ("/ready", "/waiting", "/failed", "/diagnostics")


@dataclass(frozen=True)
class Difference:
    """Where two runs part.

    Parameters
    ----------
    tick : int
        In which the message came in the first run.
    topic, field : str
        A field of its typed view, ``count`` if one run has a message more.
    first, second : object
        Its values.
    """

    tick: int
    topic: str
    field: str
    first: Any
    second: Any

    def __str__(self) -> str:
        return f"tick {self.tick}: {self.topic}: {self.field}: {self.first!r}, then {self.second!r}"


def first_difference(
    first: Mapping[str, TopicHistory], second: Mapping[str, TopicHistory]
) -> Difference | None:
    """The earliest message in which two runs differ; None if they said the same.

    Parameters
    ----------
    first, second : mapping
        Histories by topic, see `rail_corridor.stepped.histories.Histories`.
    """
    topics = [topic for topic in sorted(first.keys() | second.keys()) if topic not in _UNORDERED]
    found = (_of_topic(topic, first.get(topic), second.get(topic)) for topic in topics)
    parted = [difference for difference in found if difference is not None]
    return min(parted, key=lambda each: (each.tick, each.topic), default=None)


def _of_topic(
    topic: str, first: TopicHistory | None, second: TopicHistory | None
) -> Difference | None:
    ours, our_ticks = ([], []) if first is None else (first.all, first.ticks)
    theirs, their_ticks = ([], []) if second is None else (second.all, second.ticks)
    for one, other, tick in zip(ours, theirs, our_ticks, strict=False):
        left, right = _values(one), _values(other)
        for name in left | right:
            if not _same(left.get(name), right.get(name)):
                return Difference(tick, topic, name, left.get(name), right.get(name))
    if len(ours) != len(theirs):
        longer = max(our_ticks, their_ticks, key=len)
        tick = longer[min(len(ours), len(theirs))]
        return Difference(tick, topic, "count", len(ours), len(theirs))
    return None


def _values(view: Any) -> dict[str, Any]:
    """Fields of a view by name."""
    if isinstance(view, RowView):
        return view.as_dict()
    if isinstance(view, TableView):
        return {
            f"{row.row}.{name}": value for row in view.rows for name, value in row.as_dict().items()
        }
    if is_dataclass(view):
        return {each.name: getattr(view, each.name) for each in fields(view)}
    return {name: getattr(view, name) for name in view.get_fields_and_field_types()}


def _same(one: Any, other: Any) -> bool:
    """Whether two values are the same, what is not known being the same as itself."""
    if hasattr(one, "get_fields_and_field_types") and type(one) is type(other):
        return all(_same(getattr(one, n), getattr(other, n)) for n in _values(one))
    if isinstance(one, array | list | tuple) and isinstance(other, array | list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    both_nan = isinstance(one, float) and isinstance(other, float) and one != one and other != other
    return bool(both_nan or one == other)
