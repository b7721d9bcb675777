"""The three quality-of-service profiles of the corridor.

All are *reliable*, so that a subscriber with ROS defaults is compatible with every topic.
"Reliable" alone is not lossless: with keep-last history a burst overwrites. What makes it so
is the synchronous tick: a stream has at most one message in flight, and the world never runs
more than :data:`OBSERVER_WINDOW_TICKS` ahead of the report, so the depths below cannot
overflow (``tests/system/test_losslessness.py``).
"""

from __future__ import annotations

from typing import Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

#: How many ticks the world may run ahead of what the observer has acknowledged.
OBSERVER_WINDOW_TICKS: Final = 200

#: Blocks and readings of a tick: consumed by nodes that the tick waits for.
STREAM: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=8,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)

#: Estimates and truth, once a tick: also read by the report, which may lag by the window; the
#: first tick waits for it. Who joins later begins with the newest: the depth is for what is under
#: way, and a writer that kept its history for late joiners would give them the oldest first.
ESTIMATE: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    depth=2 * OBSERVER_WINDOW_TICKS,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.VOLATILE,
)

#: State that late joiners must learn: the last messages of each publisher are kept for them.
LATCHED: Final = QoSProfile(
    history=HistoryPolicy.KEEP_LAST,
    # More than nodes can announce at once: the reader of /ready must not lose one of them.
    depth=2000,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)

NAMES: Final[dict[int, str]] = {
    id(STREAM): "stream",
    id(ESTIMATE): "estimate",
    id(LATCHED): "latched",
}


def name_of(profile: QoSProfile) -> str:
    """Name of one of the three profiles, as the documentation prints it."""
    return NAMES[id(profile)]
