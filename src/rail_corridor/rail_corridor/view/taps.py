"""Topics read when asked, and never in between.

A tap is a *best-effort* reader that keeps the newest message: the middleware overwrites it without
waking Python, and a writer never waits for it, however slow the viewer is. Only latched topics
are read reliably, since every message of theirs counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from rail_msgs_py.topics.qos import LATCHED

from .wanted import Tap

#: Messages taken from one topic at a time, so that a flood cannot hold up the page.
_MOST_AT_ONCE = 4000


class Taps:
    """The readers of one node; no executor spins it."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._held: dict[str, tuple[Tap, Any]] = {}

    def __contains__(self, name: str) -> bool:
        """Whether a topic is held."""
        return name in self._held

    def hold(self, wanted: Mapping[str, Tap]) -> None:
        """Read these topics and no others."""
        for name in [n for n, (tap, _) in self._held.items() if wanted.get(n) != tap]:
            self._node.destroy_subscription(self._held.pop(name)[1])
        for name, tap in wanted.items():
            if name not in self._held:
                self._held[name] = (tap, self._open(name, tap))

    def writers(self, name: str) -> int:
        """Number of writers that a held topic is connected to."""
        return int(self._held[name][1].get_publisher_count()) if name in self._held else 0

    def take(self) -> Iterator[tuple[str, bytes]]:
        """Name and serialised message of everything that has come."""
        for name, (_, subscription) in list(self._held.items()):
            for _ in range(_MOST_AT_ONCE):
                with subscription.handle:
                    received = subscription.handle.take_message(subscription.msg_type, True)
                if received is None:
                    break
                yield name, received[0]

    def _open(self, name: str, tap: Tap) -> Any:
        qos = (
            LATCHED
            if tap.latched
            else QoSProfile(
                history=HistoryPolicy.KEEP_LAST,
                depth=tap.depth,
                reliability=ReliabilityPolicy.BEST_EFFORT,
                durability=DurabilityPolicy.VOLATILE,
            )
        )
        return self._node.create_subscription(tap.type, name, lambda _: None, qos, raw=True)
