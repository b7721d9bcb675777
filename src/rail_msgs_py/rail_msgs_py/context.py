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
    alone : bool
        As of `LocalDelivery`.
    """

    def __init__(self, tap: Tap | None = None, *, alone: bool = False) -> None:
        super().__init__()
        self.tap = tap
        self.delivery = LocalDelivery(alone=alone)
