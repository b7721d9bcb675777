"""The nodes of a process: made until somebody says stop, destroyed as long as there is time."""

from __future__ import annotations

import pytest

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.run import host


class Node:
    """Says that it is destroyed."""

    def __init__(self, gone: list[Node]) -> None:
        self._gone = gone

    def destroy_node(self) -> None:
        self._gone.append(self)


def test_no_more_nodes_are_made_once_it_is_to_end(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    monkeypatch.setattr(host, "make_node", lambda spec, *_: made.append(spec.name))
    specs = [NodeSpec("wrs", f"/wayside/wrs{number}", "wayside", {}) for number in range(4)]
    host.make_nodes(specs, None, until=lambda: len(made) == 2)
    assert made == ["/wayside/wrs0", "/wayside/wrs1"]
    host.make_nodes(specs, None)
    assert len(made) == 6


def test_nodes_are_destroyed_as_long_as_there_is_time() -> None:
    gone: list[Node] = []
    nodes = [Node(gone) for _ in range(3)]
    assert not host.destroy_nodes(nodes, -1.0)
    assert gone == []
    assert host.destroy_nodes(nodes, 60.0)
    assert gone == nodes
