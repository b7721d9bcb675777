"""Nodes that are not waited for any longer: who says so, in one form."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from rail_msgs_py import topics


def failure(node: str, reason: str, detected_by: str) -> DiagnosticStatus:
    """Message on ``/failed``.

    Parameters
    ----------
    node : str
        Fully qualified name of the node that failed.
    reason, detected_by : str
        For the report.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.ERROR,
        name=node,
        message=reason,
        hardware_id=node,
        values=[KeyValue(key="detected_by", value=detected_by)],
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
        self._publisher = node.publisher(topics.FAILED)
        node.listen(topics.FAILED, self._heard)

    def _heard(self, message: Any) -> None:
        ports = tuple(port for port, owner in self._owners.items() if owner == message.name)
        if ports:
            self._on_failed(ports)

    def give_up(self, ports: Iterable[str], waited_s: float) -> None:
        """Name the owners of overdue ports, and stop waiting for them."""
        overdue = tuple(ports)
        self.name(sorted({self._owners[port] for port in overdue}), waited_s)
        self._on_failed(overdue)

    def name(self, nodes: Iterable[str], waited_s: float) -> None:
        """Publish that nodes did not answer."""
        reason = f"no answer within {waited_s:.1f} s"
        for node in nodes:
            self._publisher.publish(failure(node, reason, self._node.get_fully_qualified_name()))
