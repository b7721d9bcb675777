"""A log of messages in words, of bounded length."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from typing import Any

from rail_corridor.equipment.live_elements import LogEntry

MOST_LINES = 400


class MessageLog:
    """The last messages of one panel, numbered from 1 on."""

    def __init__(self) -> None:
        self._lines: deque[dict[str, Any]] = deque(maxlen=MOST_LINES)
        self._count = 0

    def put(self, entries: Iterable[LogEntry]) -> None:
        """Add entries."""
        for entry in entries:
            self._count += 1
            self._lines.append({"id": self._count} | entry.shown())

    def since(self, count: int) -> list[dict[str, Any]]:
        """Lines that a reader lacks who has the first ``count`` of all."""
        return [line for line in self._lines if line["id"] > count]
