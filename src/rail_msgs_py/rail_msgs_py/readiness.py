"""When a node is ready: what its streams need before the first tick, and who is told."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from std_msgs.msg import String

from rail_msgs_py.topics.tick import READY, WAITING

from .mixin import RosNode

READY_POLL_S = 0.05
#: Wall time without a new connection after which a node says what it waits for.
STALLED_S = 1.0


class Connection(NamedTuple):
    """What a node needs before the first tick.

    Parameters
    ----------
    made : callable
        Whether it is there.
    topic : str
        Name of the topic; empty if it is something else.
    lacks : str
        What is missing as long as it is not there.
    """

    made: Callable[[], bool]
    topic: str = ""
    lacks: str = ""


class ReadinessMixin(RosNode):  # type: ignore[misc]
    """Waits for connections, and says so."""

    def init_readiness(self) -> None:
        """Wait for nothing yet."""
        self._connections: list[Connection] = []
        self._ready_publisher: Any = None
        self._waiting_publisher: Any = None
        self._lacked: tuple[tuple[str, str], ...] = ()
        self._ready_timer: Any = None

    def await_connection(
        self, condition: Callable[[], bool], topic: str = "", lacks: str = ""
    ) -> None:
        """Add a condition to those that `announce_when_connected` waits for; see `Connection`."""
        self._connections.append(Connection(condition, topic, lacks))

    def lacking(self) -> list[Connection]:
        """Connections that are not there yet."""
        self._connections = [one for one in self._connections if not one.made()]
        return list(self._connections)

    def announce_when_connected(self, condition: Callable[[], bool] | None = None) -> None:
        """Publish the node's name on ``/ready`` once all its streams have a counterpart.

        What it waits for in vain is published on ``/waiting``: the world knows whether anybody
        is left who could be that counterpart.
        """
        if condition is not None:
            self.await_connection(condition)
        self._ready_publisher = self.publisher(READY)

        since_s = self.steady_s()

        def poll() -> None:
            nonlocal since_s
            while self._connections and self._connections[-1].made():
                self._connections.pop()
                since_s = self.steady_s()
            if not self._connections:
                self._ready_publisher.publish(String(data=self.get_fully_qualified_name()))
                self._ready_timer.cancel()
            elif self.steady_s() - since_s > STALLED_S:
                self._tell_what_is_lacking()
                since_s = self.steady_s()

        self._ready_timer = self.every(READY_POLL_S, poll)

    def _tell_what_is_lacking(self) -> None:
        """Publish on ``/waiting`` what has no counterpart, if that is something new."""
        lacking = tuple(sorted({(one.topic, one.lacks) for one in self.lacking()}))
        if not lacking or lacking == self._lacked:
            return
        if self._waiting_publisher is None:
            self._waiting_publisher = self.publisher(WAITING)
        self._lacked = lacking
        name = self.get_fully_qualified_name()
        self._waiting_publisher.publish(
            DiagnosticStatus(
                level=DiagnosticStatus.WARN,
                name=name,
                message=f"waits for {len(lacking)} connections",
                hardware_id=name,
                values=[KeyValue(key=topic, value=lacks) for topic, lacks in lacking],
            )
        )
