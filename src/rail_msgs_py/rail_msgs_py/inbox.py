"""What a node still waits for in the tick at hand."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class TickInbox(Generic[Item]):
    """Collects exactly one item per port and tick, whatever the order of arrival.

    A port whose node failed is not waited for; it is again as soon as it is heard. Each port brings
    its items in the order of their ticks: one that has brought a later item has none for the tick
    at hand, be it that it was connected in the midst of a run.

    >>> inbox = TickInbox(["a", "b"])
    >>> inbox.put(0, "b", 2.0)
    >>> inbox.put(0, "a", 1.0)
    >>> inbox.complete, inbox.take()
    (True, (0, {'a': 1.0, 'b': 2.0}))
    """

    def __init__(self, ports: Iterable[str] = ()) -> None:
        self.ports: tuple[str, ...] = tuple(sorted(ports))
        self._awaited = set(self.ports)
        self._ticks: dict[int, dict[str, Item]] = {}
        self._first: dict[str, Item] | None = None
        #: How many awaited ports the earliest tick lacks.
        self._lacking = 0
        self._latest_taken_ns = -1

    def open(self, port: str) -> None:
        """Wait for one more port from now on."""
        self.ports = tuple(sorted({*self.ports, port}))
        self._awaited.add(port)
        self._find_first()

    def put(self, stamp_ns: int, port: str, item: Item) -> bool:
        """Add an item; one of a tick already taken only shows that its port is alive again.

        Returns
        -------
        bool
            Whether nothing more can come for the earliest tick, as `complete`.
        """
        if port not in self._awaited:
            self._awaited.add(port)
            self._find_first()
        items = self._ticks.get(stamp_ns)
        if items is None:
            if stamp_ns <= self._latest_taken_ns:
                return self.complete
            items = self._ticks[stamp_ns] = {}
            self._find_first()
        if items is self._first and port not in items:
            self._lacking -= 1
        items[port] = item
        # Run for every message: this is the usual answer.
        if self._lacking and len(self._ticks) == 1:
            return False
        return self.complete

    @property
    def stamp_ns(self) -> int | None:
        """Earliest tick of which anything has arrived, None if nothing is here."""
        return min(self._ticks) if self._ticks else None

    @property
    def latest_ns(self) -> int:
        """Stamp of the tick at hand, or of the last one taken; 0 before the first."""
        return max(self._latest_taken_ns, 0) if self.stamp_ns is None else self.stamp_ns

    @property
    def complete(self) -> bool:
        """Whether nothing more can come for the earliest tick."""
        items = self._first
        if items is None or self._lacking == 0:
            return items is not None
        if len(self._ticks) == 1:
            return False
        missing = self._awaited - items.keys()
        return all(any(port in items for items in self._ticks.values()) for port in missing)

    @property
    def missing(self) -> tuple[str, ...]:
        """Awaited ports not heard yet in the earliest tick, sorted."""
        return tuple(sorted(self._awaited - (self._first or {}).keys()))

    @property
    def awaits_anything(self) -> bool:
        """Whether any port is still waited for."""
        return bool(self._awaited)

    def drop(self, ports: Iterable[str]) -> None:
        """Wait no longer for these ports."""
        self._awaited.difference_update(ports)
        self._find_first()

    def close(self, stamp_ns: int) -> None:
        """Forget a tick and those before it: what comes late only shows that its port is alive."""
        self._latest_taken_ns = max(self._latest_taken_ns, stamp_ns)
        for old_ns in [one_ns for one_ns in self._ticks if one_ns <= stamp_ns]:
            del self._ticks[old_ns]
        self._find_first()

    def take(self) -> tuple[int, dict[str, Item]]:
        """Stamp and items of the earliest tick, complete or not.

        The items come in the order of the port names, so that sums over them are repeatable.

        Raises
        ------
        LookupError
            If nothing has arrived.
        """
        if not self._ticks:
            raise LookupError("nothing has arrived")
        stamp_ns = min(self._ticks)
        items = self._ticks.pop(stamp_ns)
        self._latest_taken_ns = stamp_ns
        self._find_first()
        return stamp_ns, {port: items[port] for port in self.ports if port in items}

    def reset(self) -> None:
        """Forget everything, as when simulated time jumps back."""
        self._ticks.clear()
        self._latest_taken_ns = -1
        self._awaited = set(self.ports)
        self._find_first()

    def _find_first(self) -> None:
        self._first = self._ticks[min(self._ticks)] if self._ticks else None
        heard = self._first
        self._lacking = len(self._awaited - heard.keys() if heard else self._awaited)
