"""One node of a plan."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

Side = Literal["world", "wayside", "onboard"]


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
