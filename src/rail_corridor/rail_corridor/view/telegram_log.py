"""Telegrams of the train radio in words, newest first."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from typing import Any

from rail_msgs_py.topics.train_radio import (
    DOWN_TELEGRAMS,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.train_radio.movement_authority import AUTHORITY_BYTES, MovementAuthority
from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES, Kind, payload_of, read_header
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY
from rail_msgs_py.train_radio.train_report import REPORT_BYTES, LocationReport

from .wanted import kind_of

MOST_LINES = 400
#: Kind of topic -> what happens to a frame there.
_STAGES = {
    TRAIN_TELEGRAMS.pattern: "sent by train",
    UP_TELEGRAMS.pattern: "received at base",
    DOWN_TELEGRAMS.pattern: "sent to base",
    RADIO_TELEGRAMS.pattern: "received on board",
}


class TelegramLog:
    """The last telegrams.

    Parameters
    ----------
    trains : sequence of str
        Names; in telegrams they are numbered from 1 on in this order.
    tracks : sequence of str
        Names; in telegrams they are numbered from 0 on in this order.
    """

    def __init__(self, trains: Sequence[str] = (), tracks: Sequence[str] = ()) -> None:
        self._trains, self._tracks = tuple(trains), tuple(tracks)
        self._lines: deque[dict[str, Any]] = deque(maxlen=MOST_LINES)
        self._count = 0

    def put(self, topic: str, raw: bytes) -> None:
        """Add the telegrams of one message; bytes that are none are passed over."""
        kind = kind_of(topic)
        try:
            batch = Telegrams.from_cdr(raw)
        except ValueError:
            return
        for _, frame in batch.frames:
            self._count += 1
            self._lines.append(
                {
                    "id": self._count,
                    "t": round(batch.stamp_ns * 1e-9, 3),
                    "stage": _STAGES.get(kind.pattern if kind else "", ""),
                    "place": topic.split("/")[3 if kind is DOWN_TELEGRAMS else 2]
                    if topic.startswith("/wayside/")
                    else topic.split("/")[1],
                    **self.describe(frame),
                }
            )

    def since(self, count: int) -> list[dict[str, Any]]:
        """Lines that a reader lacks who has the first ``count`` of all."""
        return [line for line in self._lines if line["id"] > count]

    def describe(self, frame: bytes) -> dict[str, Any]:
        """From, to, kind, sequence number and contents of a frame.

        Nothing of it is checked: the viewer has no keys, and shows forged frames too.
        """
        if len(frame) != FRAME_BYTES:
            return {"from": "?", "to": "?", "kind": "unreadable", "seq": 0, "text": ""}
        header = read_header(frame)
        kinds = {int(kind): kind.name.lower().replace("_", " ") for kind in Kind}
        payload = payload_of(frame, min(header.length, 32))
        try:
            text = self._contents(header.kind, payload)
        except ValueError as error:
            text = str(error)
        return {
            "from": self._end(header.source),
            "to": self._end(header.destination),
            "kind": kinds.get(header.kind, f"kind {header.kind}"),
            "seq": header.sequence,
            "text": text,
        }

    def _contents(self, kind: int, payload: bytes) -> str:
        if kind == Kind.LOCATION_REPORT and len(payload) == REPORT_BYTES:
            report = LocationReport.from_bytes(payload)
            if not report.position_valid:
                return "position not known"
            integrity = "" if report.integrity_confirmed else ", integrity not confirmed"
            return (
                f"front at {report.offset_m:.1f} m on {self._track(report.segment)}"
                f" ± {report.uncertainty_m:.1f} m, {3.6 * report.speed_mps:.0f} km/h{integrity}"
            )
        if kind == Kind.MOVEMENT_AUTHORITY and len(payload) == AUTHORITY_BYTES:
            authority = MovementAuthority.from_bytes(payload)
            if authority.emergency_stop:
                return "stop at once"
            return (
                f"up to {authority.end_of_authority_m:.1f} m on {self._track(authority.segment)},"
                f" {3.6 * authority.limit_mps:.0f} km/h, valid {authority.validity_s:.1f} s"
            )
        if kind == Kind.GREETING:
            return "offer of a session"
        return f"{len(payload)} bytes"

    def _end(self, identity: int) -> str:
        if identity == CONTROLLER_IDENTITY:
            return "zone controller"
        known = 1 <= identity <= len(self._trains)
        return self._trains[identity - 1] if known else f"number {identity}"

    def _track(self, segment: int) -> str:
        return self._tracks[segment] if segment < len(self._tracks) else f"segment {segment}"
