"""Delivery between the nodes of one process, past the middleware.

What a node sends goes to the readers of the same process as it is: no serialising, no copy, in a
fixed order, one callback after the other. The middleware carries it as well while somebody outside
listens. rclpy has no such delivery of its own (ADR 0014).

Messages handed over are shared: neither the sender nor a reader may change one.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Generic, Protocol, TypeVar

Item = TypeVar("Item")


class View(Protocol):
    """A message that is not serialised yet."""

    @property
    def stamp_ns(self) -> int:
        """Simulated time of the tick."""

    def to_cdr(self) -> bytes:
        """Serialised form."""


#: What is sent on a stream: serialised, or a view that is serialised when somebody needs it.
Sendable = bytes | View
Send = Callable[[Sendable], None]

#: Stamp [ns] and item of a serialised message.
Decoder = Callable[[bytes], tuple[int, Item]]


class ViewDecoder(Generic[Item]):
    """Decoder that can also take the view that a node of the same process has sent.

    Parameters
    ----------
    of_raw, of_view : callable
        Stamp [ns] and item of a serialised message, and of a view; the same for both.
    """

    def __init__(
        self,
        of_raw: Decoder[Item],
        of_view: Callable[[Any], tuple[int, Item]],
    ) -> None:
        self.of_raw, self.of_view = of_raw, of_view

    def __call__(self, raw: bytes) -> tuple[int, Item]:
        """Stamp [ns] and item of a serialised message."""
        return self.of_raw(raw)


def view_reader(decode: Decoder[Item]) -> Callable[[Any], tuple[int, Item]] | None:
    """How a decoder takes views, None if it does not."""
    return decode.of_view if isinstance(decode, ViewDecoder) else None


#: After so long a turn the executor looks after timers and the outside [s].
_TURN_S: Final = 0.004
_LOOK_EVERY: Final = 16


def serialised(message: Sendable) -> bytes:
    """A message as bytes."""
    return message if isinstance(message, bytes) else message.to_cdr()


@dataclass(eq=False)
class LocalReader:
    """One subscription to messages of this process.

    Parameters
    ----------
    node : node
        Whose it is.
    take_raw : callable
        Takes serialised messages.
    take_view : callable, optional
        Takes views; a reader without it is given them serialised.
    """

    node: Any
    take_raw: Callable[[bytes], None]
    take_view: Callable[[Any], None] | None = None


@dataclass(eq=False)
class Line:
    """One topic within a process."""

    writers: int = 0
    readers: list[LocalReader] = field(default_factory=list)


class LocalDelivery:
    """Hands the messages of one process from node to node."""

    def __init__(self) -> None:
        self._lines: dict[str, Line] = {}
        self._queue: deque[tuple[Callable[[Any], None], Any]] = deque()
        self._under_way = False
        self._executor: Any = None
        self._unsettled: list[tuple[Line, Callable[[], None]]] = []

    def line(self, name: str) -> Line:
        """Line of the topic of an absolute name."""
        return self._lines.setdefault(name, Line())

    @property
    def lines(self) -> Mapping[str, Line]:
        """Lines by the absolute names of their topics."""
        return self._lines

    def read(self, name: str, reader: LocalReader, subscribe: Callable[[], None]) -> Line:
        """Add a reader; ``subscribe`` connects it to the outside if nobody here sends to it."""
        line = self.line(name)
        line.readers.append(reader)
        self._unsettled.append((line, subscribe))
        return line

    def settle(self, executor: Any) -> None:
        """All nodes are made: subscribe outside to what nobody here sends.

        Parameters
        ----------
        executor : EventsExecutor
            Spins the nodes.
        """
        self._executor = executor
        for line, subscribe in self._unsettled:
            if not line.writers:
                subscribe()
        self._unsettled.clear()

    def put(self, line: Line, message: Sendable, raw: bytes | None) -> None:
        """Hand a message to the readers of a line once the present callback has returned.

        Parameters
        ----------
        raw : bytes or None
            Its serialised form, if there is one already.
        """
        put = self._queue.append
        if isinstance(message, bytes):
            for reader in line.readers:
                put((reader.take_raw, message))
            return
        for reader in line.readers:
            if reader.take_view is not None:
                put((reader.take_view, message))
                continue
            if raw is None:
                raw = message.to_cdr()
            put((reader.take_raw, raw))

    def remove(self, node: Any) -> None:
        """Hand nothing any longer to a node."""
        gone: set[Any] = set()
        for line in self._lines.values():
            for reader in line.readers:
                if reader.node is node:
                    gone.update((reader.take_raw, reader.take_view))
            line.readers = [reader for reader in line.readers if reader.node is not node]
        self._queue = deque(entry for entry in self._queue if entry[0] not in gone)

    def run(self) -> None:
        """Hand over what waits, and what comes of it; long work is done in turns."""
        if self._under_way:
            return
        self._under_way = True
        until_s = time.monotonic() + _TURN_S
        handed_over = 0
        try:
            while self._queue:
                take, message = self._queue.popleft()
                take(message)
                handed_over += 1
                if handed_over % _LOOK_EVERY == 0 and time.monotonic() > until_s:
                    break
        finally:
            self._under_way = False
            if self._queue and self._executor is not None:
                self._executor.create_task(self.run)
