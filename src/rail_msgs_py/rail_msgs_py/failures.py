"""Nodes that are not waited for any longer: who says so, in one form."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from rail_msgs_py.topics.tick import FAILED

from .inbox import TickInbox
from .stamps import NANOSECONDS

WATCH_PERIOD_S = 0.1


def failure(node: str, reason: str, detected_by: str, stamp_ns: int = 0) -> DiagnosticStatus:
    """Message on ``/failed``.

    Parameters
    ----------
    node : str
        Fully qualified name of the node that failed.
    reason, detected_by : str
        For the report.
    stamp_ns : int
        Simulated time of the tick in which it was noticed.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.ERROR,
        name=node,
        message=reason,
        hardware_id=node,
        values=[
            KeyValue(key="detected_by", value=detected_by),
            KeyValue(key="time_s", value=repr(stamp_ns / NANOSECONDS)),
        ],
    )


class FailureWatch:
    """Names the nodes whose blocks of a tick are overdue, and hears of those others named.

    Parameters
    ----------
    node : CorridorNode
        The node that waits.
    owners : dict
        Port to the fully qualified name of the node that sends it.
    on_failed : callable of the ports of a failed node
        Drops them; may complete the tick at hand.
    """

    def __init__(
        self, node: Any, owners: dict[str, str], on_failed: Callable[[tuple[str, ...]], None]
    ) -> None:
        self._node = node
        self._owners = owners
        self._on_failed = on_failed
        self._publisher = node.publisher(FAILED)
        node.listen(FAILED, self._on_failure)

    def _on_failure(self, message: Any) -> None:
        ports = tuple(port for port, owner in self._owners.items() if owner == message.name)
        if ports:
            self._on_failed(ports)

    def give_up(self, ports: Iterable[str], waited_s: float, stamp_ns: int) -> None:
        """Name the owners of ports overdue in a tick, and stop waiting for them."""
        overdue = tuple(ports)
        self.name(sorted({self._owners[port] for port in overdue}), waited_s, stamp_ns)
        self._on_failed(overdue)

    def name(self, nodes: Iterable[str], waited_s: float, stamp_ns: int = 0) -> None:
        """Publish that nodes did not answer."""
        reason = f"no answer within {waited_s:.1f} s"
        by = self._node.get_fully_qualified_name()
        for node in nodes:
            self._publisher.publish(failure(node, reason, by, stamp_ns))


class HeldUp:
    """Tells for how long this process could not look: then nobody else was late.

    A debugger, or equipment under test that computes for long, holds up every node of its process.

    Parameters
    ----------
    period_s : float
        Wall time between two looks.

    Examples
    --------
    >>> held_up = HeldUp(0.1)
    >>> [round(held_up.look(now_s), 3) for now_s in (5.0, 5.1, 5.25, 8.25)]
    [0.0, 0.0, 0.0, 2.8]
    """

    def __init__(self, period_s: float) -> None:
        self._period_s, self._looked_s = period_s, float("nan")

    def look(self, now_s: float) -> float:
        """Wall time since the look before in which there was none, though two were due [s]."""
        late_s = now_s - self._looked_s - 2.0 * self._period_s
        self._looked_s = now_s
        return max(0.0, late_s) if late_s == late_s else 0.0


class TickWatch(FailureWatch):
    """Gives up the ports that one inbox waits for too long in a tick.

    Parameters
    ----------
    node : CorridorNode
        The node that waits.
    inbox : TickInbox
    owners : dict
        Port to the fully qualified name of the node that sends it. A port that is missing here,
        such as the clock, is waited for indefinitely.
    timeout_s : float
        Wall time from `begin` until ports are given up.
    advance : callable
        Takes what is complete; called when ports have been dropped.
    """

    def __init__(
        self,
        node: Any,
        inbox: TickInbox[Any],
        owners: dict[str, str],
        timeout_s: float,
        advance: Callable[[], None],
    ) -> None:
        super().__init__(node, owners, self._drop)
        self._inbox, self._timeout_s, self._advance = inbox, timeout_s, advance
        self._begun_s = float("inf")
        self._held_up = HeldUp(WATCH_PERIOD_S)
        node.look_every(WATCH_PERIOD_S, self._check)

    def begin(self) -> None:
        """Start the clock: a tick is under way."""
        self._begun_s = self._node.steady_s()

    def end(self) -> None:
        """Stop the clock: the tick has been taken."""
        self._begun_s = float("inf")

    def _check(self) -> None:
        now_s = self._node.steady_s()
        self._begun_s += self._held_up.look(now_s)
        if now_s - self._begun_s > self._timeout_s:
            overdue = [port for port in self._inbox.missing if port in self._owners]
            self.give_up(overdue, self._timeout_s, self._inbox.latest_ns)

    def _drop(self, ports: tuple[str, ...]) -> None:
        self._inbox.drop(ports)
        self._advance()
