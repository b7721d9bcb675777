"""Telegrams of the train radio in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rail_corridor.equipment.live_elements import LogEntry
from rail_msgs_py.topics.train_radio import (
    DOWN_TELEGRAMS,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.movement_authority import AUTHORITY_BYTES, MovementAuthority
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES, FrameKind, payload_of, read_header
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY
from rail_msgs_py.train_radio.train_report import REPORT_BYTES, LocationReport

#: Kind of topic, and what happens to a frame there.
_STAGES: Final = (
    (TRAIN_TELEGRAMS, "sent by train"),
    (UP_TELEGRAMS, "received at base"),
    (DOWN_TELEGRAMS, "sent to base"),
    (RADIO_TELEGRAMS, "received on board"),
)
_PAYLOAD_MOST: Final = 32


class TelegramReader:
    """Puts telegrams into words.

    Parameters
    ----------
    trains : sequence of str
        Names; in telegrams they are numbered from 1 on in this order.
    tracks : sequence of str
        Names; in telegrams they are numbered from 0 on in this order.
    """

    def __init__(self, trains: Sequence[str] = (), tracks: Sequence[str] = ()) -> None:
        self._trains, self._tracks = tuple(trains), tuple(tracks)

    def entries(self, topic: str, raw: bytes) -> Iterator[LogEntry]:
        """Telegrams of one message; none if its bytes are not telegrams."""
        try:
            batch = Telegrams.from_cdr(raw)
        except ValueError:
            return
        stage, place = _seen_at(topic)
        for _, frame in batch.frames:
            yield self.describe(frame, batch.stamp_ns * 1e-9, stage, place)

    def describe(
        self, frame: bytes, time_s: float = 0.0, stage: str = "", place: str = ""
    ) -> LogEntry:
        """From, to, kind, sequence number and contents of a frame.

        Nothing of it is checked: the viewer has no keys, and shows forged frames too.
        """
        if len(frame) != FRAME_BYTES:
            return LogEntry(time_s, stage, place, "?", "?", "unreadable", 0, "")
        header = read_header(frame)
        kinds = {int(kind): kind.name.lower().replace("_", " ") for kind in FrameKind}
        payload = payload_of(frame, min(header.length, _PAYLOAD_MOST))
        try:
            text = self._contents(header.kind, payload)
        except ValueError as error:
            text = str(error)
        return LogEntry(
            time_s,
            stage,
            place,
            self._end(header.source),
            self._end(header.destination),
            kinds.get(header.kind, f"kind {header.kind}"),
            header.sequence,
            text,
        )

    def _contents(self, kind: int, payload: bytes) -> str:
        if kind == FrameKind.LOCATION_REPORT and len(payload) == REPORT_BYTES:
            report = LocationReport.from_bytes(payload)
            if not report.position_valid:
                return "position not known"
            integrity = "" if report.integrity_confirmed else ", integrity not confirmed"
            return (
                f"front at {report.offset_m:.1f} m on {self._track(report.segment)}"
                f" ± {report.uncertainty_m:.1f} m, {3.6 * report.speed_mps:.0f} km/h{integrity}"
            )
        if kind == FrameKind.MOVEMENT_AUTHORITY and len(payload) == AUTHORITY_BYTES:
            authority = MovementAuthority.from_bytes(payload)
            if authority.emergency_stop:
                return "stop at once"
            return (
                f"up to {authority.end_of_authority_m:.1f} m on {self._track(authority.segment)},"
                f" {3.6 * authority.limit_mps:.0f} km/h, valid {authority.validity_s:.1f} s"
            )
        if kind == FrameKind.GREETING:
            return "offer of a session"
        return f"{len(payload)} bytes"

    def _end(self, identity: int) -> str:
        if identity == CONTROLLER_IDENTITY:
            return "zone controller"
        known = 1 <= identity <= len(self._trains)
        return self._trains[identity - 1] if known else f"number {identity}"

    def _track(self, segment: int) -> str:
        return self._tracks[segment] if segment < len(self._tracks) else f"segment {segment}"


def _seen_at(topic: str) -> tuple[str, str]:
    """What happens to a frame on a topic, and the train or base station where that is."""
    for kind, stage in _STAGES:
        if parts := kind.parts(topic):
            (place,) = parts.values()
            return stage, place
    return "", ""
