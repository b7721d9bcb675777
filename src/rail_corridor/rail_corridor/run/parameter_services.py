"""Parameter services for who asks for them, where many nodes share a process.

Six services to each node cost little for twenty nodes and a minute for six hundred: the middleware
matches every end with every other. So in a large process a node gets its services when somebody
from outside makes a client of one of them, as every tool does that reads parameters; the client
waits for the service, and finds it (docs/adr/0013).
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from itertools import islice
from typing import Any, Final

from rclpy.node import NodeNameNonExistentError
from rclpy.parameter_service import ParameterService

POLL_S: Final = 0.1
#: Looking takes longer the more nodes there are: the rest after it is so many times as long.
_REST: Final = 250
_LONGEST_REST_S: Final = 1.0
_OWN_TOOLS: Final = ("/rail_",)


class ParameterServicesOnDemand:
    """Gives nodes of this process their parameter services once somebody asks for them.

    Parameters
    ----------
    nodes : iterable of nodes
        Those of this process; the first one looks at the graph.
    known : iterable of str
        Full names of nodes that never ask: those of the corridor.
    """

    def __init__(self, nodes: Iterable[Any], known: Iterable[str]) -> None:
        everyone = {node.get_fully_qualified_name(): node for node in nodes}
        self._watcher = next(iter(everyone.values()))
        self._known = {*known, *everyone}
        self._without = {name: node for name, node in everyone.items() if not _has_services(node)}
        self._order = list(everyone)
        self._asked: set[str] = set()
        self._made: list[ParameterService] = []
        self._rest_until_s = 0.0
        if self._without:
            self._watcher.every(POLL_S, self._look)

    def _look(self) -> None:
        """Look at the graph, unless that was just done."""
        begun_s = time.monotonic()
        if begun_s < self._rest_until_s:
            return
        made = len(self._made)
        self._look_for_clients()
        if len(self._made) == made:
            ended_s = time.monotonic()
            self._rest_until_s = ended_s + min(_REST * (ended_s - begun_s), _LONGEST_REST_S)

    def _look_for_clients(self) -> None:
        for name in {*self._watcher.get_fully_qualified_node_names()} - self._known:
            if name.startswith(_OWN_TOOLS):
                continue
            for asked in sorted(self._asked_by(name) - self._asked):
                self._make_from(asked)
                self._asked.add(asked)

    def _make_from(self, asked: str) -> None:
        """Make those of a node, and of as many after it as others have been asked before.

        Who has asked many will ask all, one after the other.
        """
        if asked not in self._order:
            return
        start = self._order.index(asked)
        later = (name for name in self._order[start:] if name in self._without)
        for name in list(islice(later, 1 + len(self._asked))):
            self._made.append(ParameterService(self._without.pop(name)))

    def _asked_by(self, name: str) -> set[str]:
        """Full names of nodes whose parameters somebody is a client of."""
        namespace, _, base = name.rpartition("/")
        try:
            clients = self._watcher.get_client_names_and_types_by_node(base, namespace or "/")
        except NodeNameNonExistentError:  # it has just ended
            return set()
        return {
            service.rpartition("/")[0]
            for service, types in clients
            if types[0].startswith("rcl_interfaces/srv/")
        }


def _has_services(node: Any) -> bool:
    return hasattr(node, "_parameter_service")
