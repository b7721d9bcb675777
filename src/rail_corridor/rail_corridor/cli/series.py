"""Values of fields over simulated time, gathered from messages: what ``rail plot`` draws."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, Final, NamedTuple

from rclpy.serialization import deserialize_message

from rail_corridor.errors import InputError
from rail_corridor.recording.parts import Recording
from rail_msgs_py.message_definition import message_class

from .fields import Record, RecordReader
from .usage import UsageError

#: Unit that the ending of a field's name stands for.
UNITS: Final = {
    **{"mps2": "m/s²", "mps": "m/s", "kmh": "km/h", "m2": "m²", "m": "m", "s": "s", "ns": "ns"},
    **{"hz": "Hz", "dbm": "dBm", "db": "dB", "rad": "rad", "deg": "°", "permil": "‰"},
    **{"ohm": "Ω", "v": "V", "ppm": "ppm"},
}


class Trace(NamedTuple):
    """One field of one topic, as ``/train_a/odometer.speed_mps``."""

    topic: str
    field: str


def traces_in(text: str) -> list[Trace]:
    """Traces that a text names, as ``/train_a/odometer.distance_m,speed_mps``.

    Raises
    ------
    UsageError
        If it names none.
    """
    topic, _, fields = text.partition(".")
    names = [field.strip() for field in fields.split(",")]
    if not topic.startswith("/") or not all(names):
        raise UsageError(f"{text}: must be TOPIC.field, as /train_a/odometer.speed_mps")
    return [Trace(topic, name) for name in names]


class Series:
    """Values of one curve: times [s] in the order of their coming, values that may be nan."""

    def __init__(self, label: str, unit: str) -> None:
        self.label, self.unit = label, unit
        self.times_s: list[float] = []
        self.values: list[float] = []

    def sort(self) -> None:
        """Put the values into the order of time."""
        pairs = sorted(zip(self.times_s, self.values, strict=True), key=lambda pair: pair[0])
        self.times_s = [time_s for time_s, _ in pairs]
        self.values = [value for _, value in pairs]

    def forget_before(self, time_s: float) -> None:
        """Drop what is older."""
        keep = sum(each < time_s for each in self.times_s)
        del self.times_s[:keep], self.values[:keep]


class Gatherer:
    """Gathers the series of some traces from messages.

    Parameters
    ----------
    traces : iterable of Trace
        A column of a table of several rows is a series for each row.

    Raises
    ------
    UsageError
        If a field is none of its topic's.
    """

    def __init__(self, traces: Iterable[Trace]) -> None:
        self._traces = tuple(dict.fromkeys(traces))
        self._readers = {
            trace: RecordReader(trace.topic, names=[trace.field]) for trace in self._traces
        }
        self._series: dict[tuple[Trace, str | None], Series] = {}

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics that are read."""
        return tuple(dict.fromkeys(trace.topic for trace in self._traces))

    @property
    def series(self) -> list[Series]:
        """The series, in the order of the traces and of the rows."""
        place = {trace: index for index, trace in enumerate(self._traces)}
        return [self._series[key] for key in sorted(self._series, key=lambda key: place[key[0]])]

    def clear(self) -> None:
        """Forget what has come: another run."""
        self._series.clear()

    @property
    def span_s(self) -> tuple[float, float] | None:
        """First and last time that is known, None without any."""
        series = [each for each in self._series.values() if each.times_s]
        if not series:
            return None
        return min(each.times_s[0] for each in series), max(each.times_s[-1] for each in series)

    def take(self, topic: str, message: Any, time_s: float | None = None) -> None:
        """Take a message of a topic.

        Parameters
        ----------
        topic : str
        message : message
        time_s : float, optional
            Its time, if it carries none itself.

        Raises
        ------
        UsageError
            If it lacks the field, or that is no number, or there is no time.
        """
        for trace in self._traces:
            if trace.topic != topic:
                continue
            try:
                read = self._readers[trace].read(message)
            except ValueError:  # not what its topic carries
                continue
            at_s = time_s if read.stamp_s is None else read.stamp_s
            if at_s is None:
                raise UsageError(f"{topic}: carries no time")
            for record in read.records:
                series = self._of(trace, record.row if read.has_rows else None)
                series.values.append(_number(trace, record))
                series.times_s.append(at_s)

    def _of(self, trace: Trace, row: str | None) -> Series:
        key = trace, row
        if key not in self._series:
            name = trace.field if row is None else f"{row}.{trace.field}"
            self._series[key] = Series(f"{trace.topic}.{name}", unit_of(trace.field))
        return self._series[key]


def _number(trace: Trace, record: Record) -> float:
    value = record[trace.field]
    if not isinstance(value, bool | int | float):
        raise UsageError(f"{trace.topic}.{trace.field}: is no number")
    return float(value) if math.isfinite(value) else math.nan


def unit_of(field: str) -> str:
    """Unit of a field by its name, empty if it has none.

    >>> unit_of("train_a.speed_mps"), unit_of("occupied")
    ('m/s', '')
    """
    head, _, ending = field.rpartition(".")[2].rpartition("_")
    return UNITS.get(ending, "") if head else ""


def panels_of(series: Iterable[Series]) -> dict[str, list[Series]]:
    """Series by unit, in their order."""
    panels: dict[str, list[Series]] = {}
    for each in series:
        panels.setdefault(each.unit, []).append(each)
    return panels


def gather_from(file: Recording, gatherer: Gatherer) -> None:
    """Gather from a recording; reads it to its end.

    Raises
    ------
    InputError
        If it is damaged, or a topic was not recorded.
    """
    kinds: dict[str, Any] = {}
    for chunk in file.chunks(lambda channel: channel.topic in gatherer.topics):
        for recorded in chunk:
            channel = recorded.channel
            if channel.topic not in kinds:
                kinds[channel.topic] = _class_of(channel.topic, channel.type)
            message = deserialize_message(recorded.data, kinds[channel.topic])
            gatherer.take(channel.topic, message, recorded.log_time_ns * 1e-9)
    # Processes are recorded side by side.
    for each in gatherer.series:
        each.sort()
    for topic in gatherer.topics:
        if topic not in kinds:
            raise InputError(f"{topic} was not recorded", file=str(file.path))


def _class_of(topic: str, type_name: str) -> Any:
    try:
        return message_class(type_name)
    except LookupError as error:
        raise InputError(str(error), field=topic, value=type_name) from None
