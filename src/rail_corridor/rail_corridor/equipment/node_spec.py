"""Kinds of nodes, and one node of a plan."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import Any, Literal

from rail_msgs_py.topics.topic import Topic

Side = Literal["world", "wayside", "onboard"]


@dataclass(frozen=True)
class NodeKind:
    """One kind of node.

    Parameters
    ----------
    name : str
        Of the kind, and of its command in the ament packages.
    target : str
        ``module:Class``.
    clocked : bool
        Whether it acts on ``/clock``, so that the world waits for its subscription.
    sink : bool
        Whether the tick ends only when it is done.
    waits : bool
        Whether it waits for others, so that it names on ``/failed`` who is missing.
    reads : tuple of Topic
        What it reads of the topics of the world, which know none of their readers by name.
    """

    name: str
    target: str
    clocked: bool = False
    sink: bool = False
    waits: bool = False
    reads: tuple[Topic, ...] = ()

    def load(self) -> Any:
        """Its class."""
        module, _, name = self.target.partition(":")
        return getattr(importlib.import_module(module), name)


@dataclass(frozen=True)
class NodeSpec:
    """One node: its kind, its full name, where it belongs, its parameters."""

    kind: str
    name: str
    side: Side
    parameters: dict[str, Any] = field(default_factory=dict)

    @property
    def site(self) -> str:
        """What it shares a process with: its wayside site or train."""
        if self.side == "world":
            return "world"
        parts = self.name.strip("/").split("/")
        return parts[1] if parts[0] == "wayside" else parts[0]
