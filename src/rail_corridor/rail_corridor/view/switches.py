"""Switching equipment off and on, by the standard lifecycle service."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterable, Sequence
from typing import Any

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

SERVICE_TYPE = "lifecycle_msgs/srv/ChangeState"
_SUFFIX = "/change_state"
ANSWER_S = 5.0


def equipment_of(services: Iterable[tuple[str, Sequence[str]]]) -> tuple[str, ...]:
    """Full names of the nodes that can be switched, from the services that are offered.

    >>> equipment_of((f"/wrs{n}/change_state", [SERVICE_TYPE]) for n in (10, 9))
    ('/wrs9', '/wrs10')
    """
    names = (
        name.removesuffix(_SUFFIX)
        for name, types in services
        if name.endswith(_SUFFIX) and SERVICE_TYPE in types
    )
    return tuple(sorted(names, key=natural))


def natural(name: str) -> list[tuple[int, str]]:
    """Key that sorts numbers within names by their size."""
    parts = re.split(r"(\d+)", name)
    return [(int(part) if part.isdecimal() else -1, part) for part in parts]


class Switches:
    """Asks equipment to change its state; one request at a time."""

    def __init__(self, context: Any, name: str) -> None:
        self._context = context
        self._node = Node(
            name, context=context, start_parameter_services=False, enable_rosout=False
        )
        self._lock = threading.Lock()

    def set(self, equipment: str, *, on: bool) -> str:
        """Switch; returns why it did not work, empty if it did. Waits for the answer."""
        transition = Transition.TRANSITION_ACTIVATE if on else Transition.TRANSITION_DEACTIVATE
        with self._lock:
            client = self._node.create_client(ChangeState, equipment + _SUFFIX)
            executor = SingleThreadedExecutor(context=self._context)
            executor.add_node(self._node)
            try:
                if not client.wait_for_service(timeout_sec=ANSWER_S):
                    return "it offers no switch"
                request = ChangeState.Request(transition=Transition(id=transition))
                answer = client.call_async(request)
                executor.spin_until_future_complete(answer, timeout_sec=ANSWER_S)
                if not answer.done():
                    return f"no answer within {ANSWER_S:.0f} s"
                if not answer.result().success:
                    return f"it is {'on' if on else 'off'} already, or refuses"
                return ""
            finally:
                executor.remove_node(self._node)
                executor.shutdown()
                self._node.destroy_client(client)

    def close(self) -> None:
        """End; a request under way is waited for."""
        with self._lock:
            self._node.destroy_node()
