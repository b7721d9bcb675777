"""One node to a name: a second one of the same full name would be taken for the first.

Two questions are asked when a node starts on its own. Of this host the kernel answers at once and
for sure: each such node holds a socket that bears its name, which is free again the moment its
process ends, however that ends. Of other hosts, and of nodes that share a process, the ROS graph
answers. It still shows for some time a node that was killed, so a namesake only counts if it
answers a request: the one service that every node of rclpy has is asked, whatever it says.
"""

from __future__ import annotations

import hashlib
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from type_description_interfaces.srv import GetTypeDescription

#: Wall time in which discovery shows a namesake: an announcement may be three seconds away.
LOOK_S = 3.5
#: ... and once it has shown anybody.
SETTLED_S = 1.0
#: ... and in which one that is alive answers.
ANSWER_S = 2.0
_QUESTIONS = 10


class NameTakenError(ValueError):
    """A node of the same full name is there already; one line."""

    def __init__(self, name: str, domain: int) -> None:
        super().__init__(f"{name}: a node of this name is running in ROS domain {domain} already")


@contextmanager
def sole_bearer(node: Any) -> Iterator[None]:
    """Hold the name of a node that nobody spins yet against others of the same full name.

    Raises
    ------
    NameTakenError
        If there is one.
    """
    name, domain = node.get_fully_qualified_name(), node.context.get_domain_id()
    digest = hashlib.sha256(f"{domain} {name}".encode()).hexdigest()[:32]
    with socket.socket(socket.AF_UNIX) as held:
        try:
            held.bind(f"\0ros_node_{digest}")
        except OSError:
            raise NameTakenError(name, domain) from None
        if _answers(node.context, name):
            raise NameTakenError(name, domain)
        yield


def _answers(context: Any, name: str) -> bool:
    """Whether a node of this name, beside the silent one of this process, is there and alive."""
    asker = Node(
        f"_namesakes_{os.getpid()}",
        context=context,
        use_global_arguments=False,
        start_parameter_services=False,
        enable_rosout=False,
    )
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(asker)

    def when(condition: Callable[[], bool], limit_s: float) -> bool:
        deadline_s = time.monotonic() + limit_s
        while not condition() and time.monotonic() < deadline_s:
            executor.spin_once(timeout_sec=0.05)
        return condition()

    try:
        begun_s = time.monotonic()

        def seen() -> bool:
            names = asker.get_fully_qualified_node_names()
            company = len({*names} - {name, asker.get_fully_qualified_name()}) > 0
            enough = company and time.monotonic() - begun_s > SETTLED_S
            return enough or names.count(name) > 1

        when(seen, LOOK_S)
        if asker.get_fully_qualified_node_names().count(name) < 2:
            return False
        client = asker.create_client(GetTypeDescription, f"{name}/get_type_description")
        anything = GetTypeDescription.Request(type_name="none", type_hash=f"RIHS01_{0:064x}")
        # Again and again: of two servers of one name nothing tells when the other is connected.
        answers: list[Any] = []
        for _ in range(_QUESTIONS):
            answers.append(client.call_async(anything))
            if when(lambda: any(answer.done() for answer in answers), ANSWER_S / _QUESTIONS):
                return True
        return False
    finally:
        executor.shutdown()
        asker.destroy_node()
