"""What a run reported and what was true, tick by tick, as arrays."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rclpy.serialization import deserialize_message

from rail_msgs_py.table import Table, values_from_cdr
from rail_msgs_py.topics.topic import Topic
from rail_signals.arrays import BoolArray, FloatArray

#: Stamp [ns] and values [row, column] of a serialised message.
Decoder = Callable[[bytes], tuple[int, FloatArray]]

_FIRST_TICKS = 1024


class Record:
    """One table per tick, [tick, row, column]; NaN where nothing was received."""

    def __init__(self, rows: Sequence[str], columns: int) -> None:
        self._values = np.full((_FIRST_TICKS, len(rows), columns), np.nan)
        # What is received may be that nothing is known, NaN.
        self._is_here = np.zeros((_FIRST_TICKS, len(rows)), dtype=bool)
        self.rows = tuple(rows)
        self.ticks = 0

    def put(self, tick: int, row: int | slice, values: FloatArray) -> None:
        """Store one row, or the table of all of them."""
        self._make_room(tick + 1)
        self._values[tick, row] = values
        self._is_here[tick, row] = True
        self.ticks = max(self.ticks, tick + 1)

    def upto(self, ticks: int) -> FloatArray:
        """The first ticks, [tick, row, column]."""
        self._make_room(ticks)
        return self._values[:ticks]

    def _make_room(self, ticks: int) -> None:
        while ticks > len(self._values):
            self._values = np.concatenate((self._values, np.full_like(self._values, np.nan)))
            self._is_here = np.concatenate((self._is_here, np.zeros_like(self._is_here)))

    def received(self, ticks: int) -> BoolArray:
        """Whether every row of each of the first ticks is here."""
        self._make_room(ticks)
        return np.asarray(self._is_here[:ticks].all(axis=1))

    def received_at(self, tick: int) -> bool:
        """Whether every row of a tick is here."""
        return self.ticks > tick and bool(self._is_here[tick].all())


class EventRecord:
    """Tables of any number of lines, one for every row and tick."""

    def __init__(self, rows: Sequence[str]) -> None:
        self.rows = tuple(rows)
        self._lines: list[dict[int, FloatArray]] = [{} for _ in self.rows]

    def put(self, tick: int, row: int | slice, values: FloatArray) -> None:
        """Store the lines [line, column] of one row and tick."""
        assert isinstance(row, int)
        self._lines[row][tick] = values

    def of(self, row: int, ticks: int) -> Iterator[tuple[int, FloatArray]]:
        """Tick and columns of each line of a row in the first ticks, in their order."""
        for tick, lines in sorted(self._lines[row].items()):
            for line in lines if tick < ticks else ():
                yield tick, line

    def received(self, ticks: int) -> BoolArray:
        """Whether every row of each of the first ticks is here."""
        return np.array([self.received_at(tick) for tick in range(ticks)], dtype=bool)

    def received_at(self, tick: int) -> bool:
        """Whether every row of a tick is here."""
        return all(tick in ticks for ticks in self._lines)


@dataclass(frozen=True)
class RecordSpec:
    """One quantity that the report reads.

    Parameters
    ----------
    topic : Topic
        It is on; a table unless ``decode`` is given.
    rows : mapping
        Name of each row to the parts of its topic's name. Where the topic's name has no parts, one
        message holds all rows.
    key : str
        Tells apart several records of one topic.
    columns : int, optional
        Number of columns; that of the topic's table unless given.
    decode : callable, optional
        From a serialised message to stamp and values.
    estimated : bool
        Whether equipment has estimated it, so that it is in the digest.
    awaited : bool
        Whether a tick without it is incomplete.
    events : bool
        Whether there is any number of lines in a tick.
    """

    topic: Topic
    rows: Mapping[str, Mapping[str, object]]
    key: str = ""
    columns: int = 0
    decode: Decoder | None = None
    estimated: bool = True
    awaited: bool = True
    events: bool = False

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.columns or len(self.topic.columns)

    def ports(self) -> Iterator[tuple[int | slice, Mapping[str, object], Decoder]]:
        """Row, parts of the topic's name and decoder of every topic that is read."""
        if not any(self.rows.values()):
            yield slice(None), {}, self._decoder(len(self.rows))
            return
        for row, parts in enumerate(self.rows.values()):
            yield row, parts, self._decoder(1)

    def _decoder(self, rows: int) -> Decoder:
        if self.decode is not None:
            return self.decode
        if self.events:
            return self._lines
        width = self.width
        return lambda raw: values_from_cdr(raw, rows, width)

    def _lines(self, raw: bytes) -> tuple[int, FloatArray]:
        """Decoder of a table of any number of lines."""
        table = Table.from_msg(deserialize_message(raw, self.topic.type))
        if table.columns != self.topic.columns:
            raise ValueError(f"not a table of {self.topic.pattern}: {', '.join(table.columns)}")
        return table.stamp_ns, table.values


def per_train(trains: Iterable[str], **parts: object) -> dict[str, Mapping[str, object]]:
    """Rows of a record with a topic per train."""
    return {train: {"train": train, **parts} for train in trains}


def in_one_message(names: Iterable[str]) -> dict[str, Mapping[str, object]]:
    """Rows of a record whose topic carries them all."""
    return {name: {} for name in names}


class RunData:
    """Truth and estimates of a run.

    Parameters
    ----------
    trains, tracks : tuple of str
        Names, in the order of the scenario.
    truth : Topic
        By which ticks are counted.
    specs : sequence of RecordSpec
        What there is; estimates are in the digest in this order.
    """

    def __init__(
        self,
        trains: tuple[str, ...],
        tracks: tuple[str, ...],
        truth: Topic,
        specs: Sequence[RecordSpec],
    ) -> None:
        self.trains, self.tracks = trains, tracks
        self.specs = tuple(specs)
        self._events = {
            (spec.topic.pattern, spec.key): EventRecord(tuple(spec.rows))
            for spec in specs
            if spec.events
        }
        self._records = {
            (spec.topic.pattern, spec.key): Record(tuple(spec.rows), spec.width)
            for spec in specs
            if not spec.events
        }
        self._truth = self[truth]
        self._most_ticks: int | None = None

    def __contains__(self, topic: Topic) -> bool:
        """Whether anything of a topic is recorded."""
        return any(spec.topic is topic for spec in self.specs)

    def __getitem__(self, key: Topic | tuple[Topic, str]) -> Record:
        """Record of a topic, with its key where it has several."""
        topic, name = key if isinstance(key, tuple) else (key, "")
        return self._records[topic.pattern, name]

    def events(self, topic: Topic) -> EventRecord:
        """Record of a topic with any number of lines in a tick."""
        return self._events[topic.pattern, ""]

    @property
    def records(self) -> tuple[Record | EventRecord, ...]:
        """Records in the order of the quantities."""
        return tuple(self._record_of(spec) for spec in self.specs)

    def _record_of(self, spec: RecordSpec) -> Record | EventRecord:
        key = spec.topic.pattern, spec.key
        return self._events[key] if spec.events else self._records[key]

    @property
    def ticks(self) -> int:
        """Ticks whose truth has been received."""
        if self._most_ticks is None:
            return self._truth.ticks
        return min(self._truth.ticks, self._most_ticks)

    def end_at(self, ticks: int) -> None:
        """Leave out what came after so many ticks: a run that was stopped was in mid-tick."""
        self._most_ticks = ticks

    @property
    def missing_ticks(self) -> int:
        """Ticks of which anything has not arrived; 0 when nothing is lost."""
        if not self.trains:
            return 0
        ticks = self.ticks
        received = [self._record_of(spec).received(ticks) for spec in self.specs if spec.awaited]
        return int(np.count_nonzero(~np.logical_and.reduce(received)))

    def complete(self, ticks: int) -> bool:
        """Whether everything of the last of so many ticks is there."""
        if not self.trains or ticks < 1:
            return True
        return all(
            self._record_of(spec).received_at(ticks - 1) for spec in self.specs if spec.awaited
        )

    def digest(self) -> str:
        """SHA-256 of everything the equipment estimated, to the last bit."""
        total = hashlib.sha256()
        for spec in self.specs:
            if spec.estimated:
                values = np.ascontiguousarray(
                    self._records[spec.topic.pattern, spec.key].upto(self.ticks), dtype="<f8"
                )
                # One bit pattern for every NaN.
                total.update(np.where(np.isnan(values), np.nan, values).tobytes())
        return total.hexdigest()
