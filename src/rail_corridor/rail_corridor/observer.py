"""The report's ear: a node that reads truth and estimates from the running corridor."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from rail_msgs_py import topics
from rail_msgs_py.failures import failure
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.position import figures_from_cdr as position_from_cdr
from rail_msgs_py.qos import OBSERVER_WINDOW_TICKS
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.table import Table, figures_from_cdr
from rail_msgs_py.topic import Topic

from .plan import Plan
from .recording import Record, Recording

NAME = "report"
_MOST_EVENTS = 10_000
_LEVELS = {
    DiagnosticStatus.OK: "ok",
    DiagnosticStatus.WARN: "warn",
    DiagnosticStatus.ERROR: "error",
    DiagnosticStatus.STALE: "stale",
}


class Observer(CorridorNode):
    """Records a run; says when it has ended.

    Parameters
    ----------
    plan : Plan
    tracks : tuple of str
        Names of the tracks in the order of the scenario.
    on_progress : callable
        Called about ten times a second of wall time.
    record : bool
        False where the report is made on another host.
    """

    def __init__(
        self,
        plan: Plan,
        tracks: tuple[str, ...],
        on_progress: Callable[[], None],
        *,
        context: Any = None,
        record: bool = True,
    ) -> None:
        super().__init__(NAME, "/", context=context, services=False)
        radio = plan.world.radio
        self._tick_ns = plan.world.tick_ns
        self._tracks = {name: index for index, name in enumerate(tracks)}
        channels = len({antenna.downlink_channel for antenna in radio.stations})
        rails = plan.world.rails
        circuits = () if rails is None else tuple(circuit.name for circuit in rails.circuits)
        self.recording = Recording(
            radio.trains,
            tracks,
            channels,
            circuits,
            cbtc=plan.world.cbtc is not None,
            threatened=bool(plan.world.threats),
            references=plan.world.references is not None,
            localizer=any(spec.kind == "localizer" for spec in plan.nodes),
        )
        self._width = 2 + channels
        self.failures: list[dict[str, Any]] = []
        self.events: list[dict[str, Any]] = []
        self.first_tick_s = math.nan
        self.last_tick_s = math.nan
        self.finished_ticks: int | None = None
        self._failed = self.publisher(topics.FAILED)
        self.listen(topics.FAILED, self._on_failed)
        self.listen(topics.DIAGNOSTICS, self._on_diagnostics)
        self.listen(topics.FINISHED, self._on_finished)
        if record:
            self._observed = self.publisher(topics.OBSERVED)
            self.stream_in(topics.STATE, self._on_state)
            self.stream_in(topics.LINKS, self._on_links)
            for index, train in enumerate(radio.trains):
                self.stream_in(
                    topics.POSITION, lambda raw, i=index: self._on_position(i, raw), train=train
                )
                self.stream_in(
                    topics.VRS_CHANNEL, lambda raw, i=index: self._on_channel(i, raw), train=train
                )
            self._listen_to_codes()
            self._listen_to_authorities()
            self._listen_to_positions()
        self.every(0.1, on_progress)
        self.announce_when_connected()

    @property
    def tick(self) -> int:
        """Ticks seen so far."""
        return self.recording.ticks

    @property
    def complete(self) -> bool:
        """Whether the last tick of a finished run has been read in full."""
        if self.finished_ticks is None:
            return False
        records = (*self.recording.estimates, self.recording.links)
        if not self.recording.trains:
            return True
        last = self.finished_ticks - 1
        if self.recording.threatened:
            records = (*records, self.recording.strikes)
        return self.recording.reports.have(last) and all(
            record.ticks > last and not np.isnan(record.upto(last + 1)[last, :, 0]).any()
            for record in records
        )

    def announce_failure(self, node: str, reason: str) -> None:
        """Tell the corridor that a node has gone."""
        self._failed.publish(failure(node, reason, "the launcher"))

    def _listen_to_codes(self) -> None:
        recording = self.recording
        for index, circuit in enumerate(recording.circuits):
            self._record(recording.sent, topics.CODE_SENT, index, circuit=circuit)
        for index, train in enumerate(recording.trains if recording.circuits else ()):
            self._record(recording.received, topics.CODE_RECEIVED, index, train=train)
            self._record_command(index, train, "code_supervision")

    def _listen_to_authorities(self) -> None:
        recording = self.recording
        if not recording.cbtc:
            return
        for index, train in enumerate(recording.trains):
            self._record(recording.radio, topics.RADIO_LINK, index, train=train)
            self._record(recording.atp, topics.ATP_STATE, index, train=train)
            self._record(recording.authority, topics.AUTHORITY, index, train=train)
            self._record_reports(index, train)
            self._record_command(index, train, "atp")
        if recording.threatened:
            self._record(recording.strikes, topics.STRIKES, 0)

        def put(raw: bytes) -> None:
            links = recording.cbtc_links
            stamp_ns, figures = figures_from_cdr(raw, len(recording.trains), links.columns)
            links.put(stamp_ns // self._tick_ns, slice(None), figures)

        self.stream_in(topics.CBTC_LINKS, put)

    def _record_reports(self, index: int, train: str) -> None:
        def put(raw: bytes) -> None:
            table = Table.from_msg(deserialize_message(raw, topics.REPORTS.type))
            self.recording.reports.put(table.stamp_ns // self._tick_ns, index, table.values)

        self.stream_in(topics.REPORTS, put, train=train)

    def _listen_to_positions(self) -> None:
        recording = self.recording
        for index, train in enumerate(recording.trains):
            if recording.references:
                self._record(recording.doppler, topics.DOPPLER_FIX, index, train=train)
            if recording.localizer:
                self._record(recording.located, topics.LOCALIZER_STATE, index, train=train)

    def _record_command(self, index: int, train: str, supervision: str) -> None:
        command = self.recording.command
        self._record(command, topics.COMMAND, index, train=train, supervision=supervision)

    def _record(self, record: Record, topic: Topic, row: int, **parts: object) -> None:
        """Record the one row of each table on a topic."""

        def put(raw: bytes) -> None:
            stamp_ns, figures = figures_from_cdr(raw, 1, record.columns)
            record.put(stamp_ns // self._tick_ns, row, figures[0])

        self.stream_in(topic, put, **parts)

    def _on_state(self, raw: bytes) -> None:
        trains = len(self.recording.trains)
        stamp_ns, state = figures_from_cdr(raw, trains, len(topics.STATE_COLUMNS))
        tick = stamp_ns // self._tick_ns
        now_s = self.steady_s()
        if math.isnan(self.first_tick_s):
            self.first_tick_s = now_s
        self.last_tick_s = now_s
        self.recording.state.put(tick, slice(None), state)
        if tick % (OBSERVER_WINDOW_TICKS // 4) == 0:
            header = Header()
            header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
            self._observed.publish(header)

    def _on_links(self, raw: bytes) -> None:
        trains = len(self.recording.trains)
        stamp_ns, links = figures_from_cdr(raw, trains, len(topics.LINK_COLUMNS))
        self.recording.links.put(stamp_ns // self._tick_ns, slice(None), links)

    def _on_position(self, train: int, raw: bytes) -> None:
        stamp_ns, track, figures = position_from_cdr(raw)
        chainage_m, variance_m2, speed_mps, _ = figures
        self.recording.position.put(
            stamp_ns // self._tick_ns,
            train,
            np.array((self._tracks.get(track, -1), chainage_m, variance_m2, speed_mps)),
        )

    def _on_channel(self, train: int, raw: bytes) -> None:
        stamp_ns, figures = figures_from_cdr(raw, 1, self._width)
        self.recording.channel.put(stamp_ns // self._tick_ns, train, figures[0])

    def _on_failed(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        seen = {
            "node": message.name,
            "reason": message.message,
            "detected_by": values.get("detected_by", ""),
            "time_s": round(self.tick * self._tick_ns * 1e-9, 3),
        }
        if seen["node"] not in {failed["node"] for failed in self.failures}:
            self.failures.append(seen)

    def _on_diagnostics(self, message: Any) -> None:
        for status in message.status:
            if len(self.events) < _MOST_EVENTS:
                self.events.append(
                    {
                        "time_s": to_ns(message.header.stamp) * 1e-9,
                        "level": _LEVELS.get(status.level, "?"),
                        "name": status.name,
                        "message": status.message,
                    }
                )

    def _on_finished(self, message: Any) -> None:
        self.finished_ticks = to_ns(message.stamp) // self._tick_ns + 1
