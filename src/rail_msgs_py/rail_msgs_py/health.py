"""The health of a node on ``/diagnostics``: what changes at once, and all of it every second."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import deserialize_message, serialize_message

from rail_msgs_py.topics.tick import DIAGNOSTICS

from .mixin import RosNode
from .stamps import NANOSECONDS, clock_to_cdr

# Of a serialised DiagnosticArray: what stands before the name of its frame.
_STAMP_BYTES = 12


class HealthMixin(RosNode):  # type: ignore[misc]
    """Tells the health of a node, by aspects of it."""

    def init_health(self) -> None:
        """Have nothing to say yet."""
        self._publish_health = self.publisher(DIAGNOSTICS).send
        self._health: dict[str, DiagnosticStatus] = {}
        self._health_cdr: bytes | None = None
        self._now_ns = 0
        self._second = -1

    def report(
        self,
        level: bytes,
        what: str,
        message: str,
        values: Iterable[tuple[str, str]] = (),
        stamp_ns: int | None = None,
    ) -> None:
        """Publish the health of one aspect of the node, if it changed.

        Without a stamp it is of the tick at hand.
        """
        before = self._health.get(what)
        if before is not None and (before.level, before.message) == (level, message):
            return
        status = self._status(what, level, message, values)
        self._health[what] = status
        self._health_cdr = None
        now_ns = self._now_ns if stamp_ns is None else stamp_ns
        self._tell_health(now_ns, _without_stamp([status]))

    def health_of(self, what: str) -> DiagnosticStatus | None:
        """What the node has last said of one aspect of its health; None if nothing."""
        return self._health.get(what)

    def at_tick(self, stamp_ns: int) -> None:
        """Take the simulated time; tell the health of the node in the first tick of each second."""
        self._now_ns = stamp_ns
        second = stamp_ns // NANOSECONDS
        if second == self._second:
            return
        self._second = second
        if self._health_cdr is None:
            alive = self._status("node", DiagnosticStatus.OK, "running")
            self._health_cdr = _without_stamp([*self._health.values()] or [alive])
        self._tell_health(stamp_ns, self._health_cdr)

    def _keeping_time(self, callback: Callable[[int, Any], None]) -> Callable[[int, Any], None]:
        """Callback of what begins a tick."""
        at_tick = self.at_tick

        def run(stamp_ns: int, item: Any) -> None:
            at_tick(stamp_ns)
            callback(stamp_ns, item)

        return run

    def _status(
        self, what: str, level: bytes, message: str, values: Iterable[tuple[str, str]] = ()
    ) -> DiagnosticStatus:
        name = self.get_fully_qualified_name()
        return DiagnosticStatus(
            level=level,
            name=f"{name}: {what}",
            message=message,
            hardware_id=name,
            values=[KeyValue(key=key, value=value) for key, value in values],
        )

    def _tell_health(self, stamp_ns: int, without_stamp: bytes) -> None:
        self._publish_health(clock_to_cdr(stamp_ns) + without_stamp)


def node_of_health(raw: bytes) -> str:
    """Full name of the node that a serialised message of ``/diagnostics`` is about."""
    message = deserialize_message(raw, DiagnosticArray)
    return str(message.status[0].hardware_id) if message.status else ""


def _without_stamp(statuses: list[DiagnosticStatus]) -> bytes:
    """Serialised ``DiagnosticArray`` without what `clock_to_cdr` writes before it."""
    return bytes(serialize_message(DiagnosticArray(status=statuses))[_STAMP_BYTES:])
