"""From messages to a recording: what each topic that the report reads means.

The same for a run that is under way and for one read from a file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message

from rail_corridor.plan.plan import Plan
from rail_corridor.run_data import Decoder, EventRecord, Record, RunData
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE

_MOST_EVENTS: Final = 10_000
_LEVELS: Final = {
    DiagnosticStatus.OK: "ok",
    DiagnosticStatus.WARN: "warn",
    DiagnosticStatus.ERROR: "error",
    DiagnosticStatus.STALE: "stale",
}


@dataclass(frozen=True)
class Reader:
    """What is done with the messages of one topic.

    Parameters
    ----------
    topic : Topic
    parts : dict
        Of its name.
    take : callable
        Takes a serialised message, or a message where ``raw`` is False.
    raw : bool
    """

    topic: Topic
    parts: dict[str, object]
    take: Callable[[Any], None]
    raw: bool = True

    @property
    def name(self) -> str:
        """Absolute name of the topic."""
        return self.topic.name(**self.parts)


def _event(time_s: float, status: DiagnosticStatus) -> dict[str, Any]:
    """What a node said of its health; of an event of the world its kind and place as well."""
    said: dict[str, Any] = {
        "time_s": time_s,
        "level": _LEVELS.get(status.level, "?"),
        "name": status.name,
        "message": status.message,
    }
    values = {pair.key: pair.value for pair in status.values}
    if "kind" in values:
        place = {key: values[key] for key in ("kind", "train", "other", "track") if key in values}
        said |= place | {"at_m": float(values["at_m"])}
    return said


def names_read(plan: Plan) -> frozenset[str]:
    """Names of the topics that a report reads, other than those that are kept for it."""
    ports = (spec.topic.name(**parts) for spec in plan.records for _, parts, _ in spec.ports())
    return frozenset((DIAGNOSTICS.name(), *ports))


class Intake:
    """Reads the messages of a run.

    Parameters
    ----------
    plan : Plan
    """

    def __init__(self, plan: Plan) -> None:
        world = plan.world
        self._tick_ns = world.tick_ns
        self._most_ticks = plan.ticks
        trains = tuple(train.name for train in world.trains)
        self.recording = RunData(trains, tuple(world.tracks), STATE, plan.records)
        self._failures: dict[str, tuple[float, str, str]] = {}
        self._events: list[dict[str, Any]] = []
        self._health: dict[str, tuple[bytes, str]] = {}
        #: Newest message on health of each node, without its stamp.
        self._said: dict[str, bytes] = {}
        self._standing: set[bytes] = set()
        self.finished_ticks: int | None = None
        #: Wall time of the first and of the last tick [s].
        self.first_tick_s = self.last_tick_s = math.nan
        self.readers: list[Reader] = [
            Reader(FAILED, {}, self.take_failed, raw=False),
            Reader(DIAGNOSTICS, {}, self._take_diagnostics),
            Reader(FINISHED, {}, self._take_finished, raw=False),
        ]
        self.readers += [
            Reader(spec.topic, dict(parts), self._storing(record, row, decode))
            for spec, record in zip(plan.records, self.recording.records, strict=True)
            for row, parts, decode in spec.ports()
        ]

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Nodes that failed, each as it was first noticed, in the order of that time."""
        failures = sorted((seen, node) for node, seen in self._failures.items())
        return [
            {"node": node, "reason": reason, "detected_by": by, "time_s": time_s}
            for (time_s, by, reason), node in failures
        ]

    @property
    def events(self) -> list[dict[str, Any]]:
        """What nodes said about their health, in the order of time, then of name.

        Messages of several nodes arrive in any order, those of one in the order it sent them.
        """
        return sorted(self._events, key=lambda event: (event["time_s"], event["name"]))

    def _storing(
        self, record: Record | EventRecord, row: int | slice, decode: Decoder
    ) -> Callable[[bytes], None]:
        """Reader of the messages of one row, or of all rows of a record."""
        lines = isinstance(row, slice) or isinstance(record, EventRecord)

        def take(raw: bytes) -> None:
            stamp_ns, values = decode(raw)
            record.put(self._tick(stamp_ns), row, values if lines else values[0])

        return take

    def _tick(self, stamp_ns: int) -> int:
        """Tick of a stamp; raises ValueError if the run has none such."""
        tick = stamp_ns // self._tick_ns
        if not 0 <= tick < self._most_ticks:
            raise ValueError(f"stamp of {stamp_ns} ns: the run has {self._most_ticks} ticks")
        return tick

    def take_failed(self, message: Any) -> None:
        """Note that a node has failed: the first that noticed it counts."""
        values = {pair.key: pair.value for pair in message.values}
        try:
            time_s = float(values["time_s"])
        except (KeyError, ValueError):  # said by somebody else's node
            time_s = max(self.recording.ticks - 1, 0) * self._tick_ns * 1e-9
        seen = (round(time_s, 3), values.get("detected_by", ""), message.message)
        self._failures[message.name] = min(seen, self._failures.get(message.name, seen))

    def _take_diagnostics(self, raw: bytes) -> None:
        """Note what has changed; nodes repeat the rest in every second."""
        said = bytes(raw[12:])
        if said in self._standing:
            return
        message = deserialize_message(raw, DIAGNOSTICS.type)
        for status in message.status:
            self._standing.discard(self._said.get(status.hardware_id, b""))
            self._said[status.hardware_id] = said
            if self._health.get(status.name) == (status.level, status.message):
                continue
            self._health[status.name] = (status.level, status.message)
            if len(self._events) < _MOST_EVENTS:
                time_s = to_ns(message.header.stamp) * 1e-9
                self._events.append(_event(time_s, status))
        self._standing.add(said)

    def _take_finished(self, message: Any) -> None:
        self.finished_ticks = to_ns(message.stamp) // self._tick_ns + 1
