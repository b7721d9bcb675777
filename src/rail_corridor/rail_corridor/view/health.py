"""What nodes say of themselves, and which of them have failed."""

from __future__ import annotations

from collections import deque
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus

from rail_msgs_py.stamps import to_ns

_LEVELS = {
    DiagnosticStatus.OK: "ok",
    DiagnosticStatus.WARN: "warn",
    DiagnosticStatus.ERROR: "error",
    DiagnosticStatus.STALE: "stale",
}
MOST_EVENTS = 200
_SWITCH = ": equipment"


class Health:
    """The newest of each status; ``version`` grows with every change."""

    def __init__(self) -> None:
        self.version = 0
        self._status: dict[str, dict[str, Any]] = {}
        self._failed: dict[str, dict[str, Any]] = {}
        self._events: deque[dict[str, Any]] = deque(maxlen=MOST_EVENTS)

    def clear(self) -> None:
        """Forget everything: another run."""
        self._status.clear()
        self._failed.clear()
        self._events.clear()
        self.version += 1

    def on_diagnostics(self, message: Any, now_s: float) -> None:
        """Take a ``DiagnosticArray``; one that carries no time is of ``now_s``."""
        stamp_s = to_ns(message.header.stamp) * 1e-9
        for status in message.status:
            self._put(status, stamp_s if stamp_s > 0.0 else now_s)

    def on_failed(self, message: Any, now_s: float) -> None:
        """Take a node that is not waited for any longer."""
        values = {pair.key: pair.value for pair in message.values}
        if message.name in self._failed:
            return
        self._failed[message.name] = {
            "node": message.name,
            "reason": message.message,
            "by": values.get("detected_by", ""),
            "t": round(now_s, 2),
        }
        text = f"given up: {message.message}"
        self._event(now_s, "error", message.name, text)

    def switched_off(self, node: str) -> bool:
        """Whether equipment says that it is switched off."""
        status = self._status.get(node + _SWITCH)
        return status is not None and status["level"] == "warn"

    def of(self, namespace: str) -> list[dict[str, Any]]:
        """Statuses of the nodes below a namespace."""
        start = namespace.rstrip("/") + "/"
        return [s for s in self._status.values() if s["name"].startswith(start)]

    def failed(self) -> set[str]:
        """Nodes that are not waited for."""
        return set(self._failed)

    def shown(self) -> dict[str, Any]:
        """All of it, the worst first."""
        order = {"error": 0, "stale": 1, "warn": 2, "ok": 3}
        status = sorted(self._status.values(), key=lambda s: (order.get(s["level"], 0), s["name"]))
        return {
            "version": self.version,
            "status": status,
            "failed": list(self._failed.values()),
            "events": sorted(reversed(self._events), key=lambda event: -event["t"]),
        }

    def counts(self) -> dict[str, int]:
        """How many statuses of each level there are, and failed nodes."""
        counts = {"ok": 0, "warn": 0, "error": 0, "stale": 0}
        for status in self._status.values():
            counts[status["level"]] = counts.get(status["level"], 0) + 1
        return counts | {"failed": len(self._failed)}

    def _put(self, status: Any, stamp_s: float) -> None:
        level = _LEVELS.get(status.level, "error")
        before = self._status.get(status.name)
        if before is not None and (before["level"], before["message"]) == (level, status.message):
            return
        self._status[status.name] = {
            "name": status.name,
            "level": level,
            "message": status.message,
            "values": [f"{pair.key}: {pair.value}" for pair in status.values if pair.value],
            "t": round(stamp_s, 2),
        }
        if before is not None or level != "ok":
            self._event(stamp_s, level, status.name, status.message)
        self.version += 1

    def _event(self, time_s: float, level: str, name: str, message: str) -> None:
        self._events.append({"t": round(time_s, 2), "level": level, "name": name, "text": message})
        self.version += 1
