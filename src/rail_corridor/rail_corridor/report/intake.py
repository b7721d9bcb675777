"""From messages to a recording: what each topic that the report reads means.

The same for a run that is under way and for one read from a file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message

from rail_corridor.run.plan import Plan
from rail_msgs_py.position import figures_from_cdr as position_from_cdr
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.table import Table, figures_from_cdr
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
from rail_msgs_py.topics.train_radio import (
    ATP_STATE,
    AUTHORITY,
    CBTC_LINKS,
    RADIO_LINK,
    REPORTS,
    STRIKES,
)
from rail_msgs_py.topics.world import COMMAND, STATE

from .run_data import FloatArray, Record, Recording

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


class Intake:
    """Reads the messages of a run.

    Parameters
    ----------
    plan : Plan
    tracks : tuple of str
        Names of the tracks in the order of the scenario.
    """

    def __init__(self, plan: Plan, tracks: tuple[str, ...]) -> None:
        radio = plan.world.radio
        self._tick_ns = plan.world.tick_ns
        self._most_ticks = plan.ticks
        self._tracks = {name: index for index, name in enumerate(tracks)}
        channels = len({antenna.downlink_channel for antenna in radio.stations})
        rails = plan.world.rails
        circuits = () if rails is None else tuple(circuit.name for circuit in rails.circuits)
        bus = plan.world.bus
        self.recording = Recording(
            radio.trains,
            tracks,
            channels,
            circuits,
            cbtc=plan.world.cbtc is not None,
            threatened=bool(plan.world.threats),
            references=plan.world.references is not None,
            localizer=any(spec.kind == "localizer" for spec in plan.nodes),
            buses=() if bus is None else tuple(each.train for each in bus.trains),
        )
        self._failures: dict[str, tuple[float, str, str]] = {}
        self._events: list[dict[str, Any]] = []
        self.finished_ticks: int | None = None
        #: Wall time of the first and of the last tick [s].
        self.first_tick_s = self.last_tick_s = math.nan
        self.readers: list[Reader] = [
            Reader(FAILED, {}, self.take_failed, raw=False),
            Reader(DIAGNOSTICS, {}, self._take_diagnostics, raw=False),
            Reader(FINISHED, {}, self._take_finished, raw=False),
        ]
        self._read_ranging()
        self._read_codes()
        self._read_authorities()
        self._read_positions()
        self._read_buses()

    @property
    def failures(self) -> list[dict[str, Any]]:
        """Nodes that failed, each as it was first noticed, in the order of that time."""
        found = sorted((seen, node) for node, seen in self._failures.items())
        return [
            {"node": node, "reason": reason, "detected_by": by, "time_s": time_s}
            for (time_s, by, reason), node in found
        ]

    @property
    def events(self) -> list[dict[str, Any]]:
        """What nodes said about their health, in the order of time, then of name.

        Messages of several nodes arrive in any order, those of one in the order it sent them.
        """
        return sorted(self._events, key=lambda event: (event["time_s"], event["name"]))

    def complete(self, ticks: int) -> bool:
        """Whether all figures of the last of so many ticks are there."""
        recording = self.recording
        if not recording.trains or ticks < 1:
            return True
        threats = (recording.strikes,) if recording.threatened else ()
        records = (*recording.estimates, recording.links, *threats)
        return recording.reports.have(ticks - 1) and all(
            record.ticks >= ticks and not np.isnan(record.upto(ticks)[ticks - 1, :, 0]).any()
            for record in records
        )

    # What is read ------------------------------------------------------------------------

    def _read(self, topic: Topic, take: Callable[[bytes], None], **parts: object) -> None:
        self.readers.append(Reader(topic, parts, take))

    def _read_ranging(self) -> None:
        recording = self.recording
        self._read(STATE, self._table(recording.state))
        self._read(LINKS, self._table(recording.links))
        for index, train in enumerate(recording.trains):
            self._read(POSITION, lambda raw, i=index: self._take_position(i, raw), train=train)
            self._read_row(recording.channel, VRS_CHANNEL, index, train=train)

    def _read_codes(self) -> None:
        recording = self.recording
        for index, circuit in enumerate(recording.circuits):
            self._read_row(recording.sent, CODE_SENT, index, circuit=circuit)
        for index, train in enumerate(recording.trains if recording.circuits else ()):
            self._read_row(recording.received, CODE_RECEIVED, index, train=train)
            self._read_command(index, train, "code_supervision")

    def _read_authorities(self) -> None:
        recording = self.recording
        if not recording.cbtc:
            return
        for index, train in enumerate(recording.trains):
            self._read_row(recording.radio, RADIO_LINK, index, train=train)
            self._read_row(recording.atp, ATP_STATE, index, train=train)
            self._read_row(recording.authority, AUTHORITY, index, train=train)
            self._read(REPORTS, self._reports(index), train=train)
            self._read_command(index, train, "atp")
        if recording.threatened:
            self._read_row(recording.strikes, STRIKES, 0)
        self._read(CBTC_LINKS, self._table(recording.cbtc_links))

    def _read_positions(self) -> None:
        recording = self.recording
        for index, train in enumerate(recording.trains):
            if recording.references:
                self._read_row(recording.doppler, DOPPLER_FIX, index, train=train)
            if recording.localizer:
                self._read_row(recording.located, LOCALIZER_STATE, index, train=train)

    def _read_buses(self) -> None:
        recording = self.recording
        for index, train in enumerate(recording.buses):
            self._read_row(recording.bus_head, BUS_LINK, index, train=train, end="head")
            self._read_row(recording.bus_tail, BUS_LINK, index, train=train, end="tail")
            self._read_row(recording.bus_state, BUS_STATE, index, train=train)
        if recording.buses:
            self._read(BUS_LINKS, self._table(recording.bus_links, len(recording.buses)))

    def _read_command(self, index: int, train: str, supervision: str) -> None:
        command = self.recording.command
        self._read_row(command, COMMAND, index, train=train, supervision=supervision)

    def _read_row(self, record: Record, topic: Topic, row: int, **parts: object) -> None:
        """Read the one row of each table on a topic."""

        def take(raw: bytes) -> None:
            stamp_ns, figures = figures_from_cdr(raw, 1, record.columns)
            self._put(record, stamp_ns, row, figures[0])

        self._read(topic, take, **parts)

    def _table(self, record: Record, rows: int | None = None) -> Callable[[bytes], None]:
        """Reader of whole tables, with a row per train unless told otherwise."""
        count = len(self.recording.trains) if rows is None else rows

        def take(raw: bytes) -> None:
            stamp_ns, figures = figures_from_cdr(raw, count, record.columns)
            self._put(record, stamp_ns, slice(None), figures)

        return take

    def _reports(self, train: int) -> Callable[[bytes], None]:
        """Reader of the location reports taken from a train: any number of rows."""

        def take(raw: bytes) -> None:
            table = Table.from_msg(deserialize_message(raw, REPORTS.type))
            if table.columns != REPORTS.columns:
                raise ValueError(f"not a table of reports: {', '.join(table.columns)}")
            self.recording.reports.put(self._tick(table.stamp_ns), train, table.values)

        return take

    def _put(self, record: Record, stamp_ns: int, row: int | slice, figures: FloatArray) -> None:
        record.put(self._tick(stamp_ns), row, figures)

    def _tick(self, stamp_ns: int) -> int:
        """Tick of a stamp; raises ValueError if the run has none such."""
        tick = stamp_ns // self._tick_ns
        if not 0 <= tick < self._most_ticks:
            raise ValueError(f"stamp of {stamp_ns} ns: the run has {self._most_ticks} ticks")
        return tick

    def _take_position(self, train: int, raw: bytes) -> None:
        stamp_ns, track, figures = position_from_cdr(raw)
        chainage_m, variance_m2, speed_mps, _ = figures
        row = np.array((self._tracks.get(track, -1), chainage_m, variance_m2, speed_mps))
        self._put(self.recording.position, stamp_ns, train, row)

    def take_failed(self, message: Any) -> None:
        """Note that a node has failed: the first that noticed it counts."""
        values = {pair.key: pair.value for pair in message.values}
        try:
            time_s = float(values["time_s"])
        except (KeyError, ValueError):  # said by somebody else's node
            time_s = max(self.recording.ticks - 1, 0) * self._tick_ns * 1e-9
        seen = (round(time_s, 3), values.get("detected_by", ""), message.message)
        self._failures[message.name] = min(seen, self._failures.get(message.name, seen))

    def _take_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if len(self._events) < _MOST_EVENTS:
                self._events.append(
                    {
                        "time_s": to_ns(message.header.stamp) * 1e-9,
                        "level": _LEVELS.get(status.level, "?"),
                        "name": status.name,
                        "message": status.message,
                    }
                )

    def _take_finished(self, message: Any) -> None:
        self.finished_ticks = to_ns(message.stamp) // self._tick_ns + 1
