"""What the nodes of a process share: who is told of their messages, and how they get them."""

from __future__ import annotations

from rclpy.context import Context

from .delivery import LocalDelivery
from .tap import Tap


class CorridorContext(Context):  # type: ignore[misc]
    """Context of the nodes of one process of a corridor.

    Parameters
    ----------
    tap : Tap, optional
        Is told of everything that they publish.
    report_reads : frozenset of str
        Names of the topics that a report in another process reads: its ear must be open before
        their nodes are ready.
    """

    def __init__(self, tap: Tap | None = None, report_reads: frozenset[str] = frozenset()) -> None:
        super().__init__()
        self.tap = tap
        self.report_reads = report_reads
        self.delivery = LocalDelivery()
