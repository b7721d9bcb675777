"""Delivery between the nodes of one process, past the middleware.

What a node sends goes to the readers of the same process as it is: no serialising, no copy, in a
fixed order, one callback after the other. The middleware carries it as well while somebody outside
listens. rclpy has no such delivery of its own (ADR 0014).

Messages handed over are shared: neither the sender nor a reader may change one.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
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
    fail : callable
        Told of what a callback raises.
    take_raw : callable
        Takes serialised messages.
    take_view : callable, optional
        Takes views; a reader without it is given them serialised.
    """

    node: Any
    fail: Callable[[Exception], None]
    take_raw: Callable[[bytes], None]
    take_view: Callable[[Any], None] | None = None


@dataclass(eq=False)
class Line:
    """One topic within a process: the nodes that send on it, and who reads it."""

    writers: list[Any] = field(default_factory=list)
    readers: list[LocalReader] = field(default_factory=list)
    #: Message class, where it is no topic of the corridor's table.
    kind: Any = None
    #: What becomes of each message before anybody is told of it; as it is, if there is none.
    intercept: Callable[[Sendable], Iterable[Sendable]] | None = None
    #: On a bench: what was sent before somebody kept it, and whether that is wanted.
    early: list[Sendable] = field(default_factory=list)
    gathers: bool = True
    #: Subscriptions to the outside that nobody has needed yet, and whose they would be.
    subscriptions: list[tuple[Any, Callable[[], None]]] = field(default_factory=list)

    def hear_outside(self) -> None:
        """Subscribe outside, if nobody here sends."""
        if self.writers:
            return
        for _, subscribe in self.subscriptions:
            subscribe()
        self.subscriptions.clear()

    def from_outside(self, take: Callable[[Any], None]) -> Callable[[Any], None]:
        """Reader of what comes from outside, for as long as nobody here sends.

        A sender that was ended and started anew in this process is heard here and outside.
        """

        def take_if_outside(message: Any) -> None:
            if not self.writers:
                take(message)

        return take_if_outside


@dataclass(frozen=True, eq=False)
class Listener:
    """A node that listens to a topic of many publishers, or to a timer.

    Parameters
    ----------
    node : node
    subscribe : callable of a callback
        Makes its subscription, should it be the one that has it.
    take : callable
        Takes messages; of a timer None.
    """

    node: Any
    subscribe: Callable[[Callable[[Any], None]], None]
    take: Callable[[Any], None]


class Ear:
    """The one subscription of a process to a topic, or its one timer, that of its first listener.

    Many nodes publish on it: that each of them heard each of the others by itself would take the
    square of their number in memory and in time.
    """

    def __init__(self) -> None:
        self._listeners: list[Listener] = []

    def add(self, listener: Listener) -> None:
        """Tell one more listener."""
        self._listeners.append(listener)
        if len(self._listeners) == 1:
            listener.subscribe(self._hear)

    def remove(self, node: Any) -> None:
        """Tell a node no longer; if the subscription was its own, the next one makes another."""
        first = self._listeners[:1]
        self._listeners = [each for each in self._listeners if each.node is not node]
        if self._listeners and self._listeners[:1] != first:
            self._listeners[0].subscribe(self._hear)

    def _hear(self, message: Any) -> None:
        for listener in self._listeners:
            listener.take(message)


class LocalDelivery:
    """Hands the messages of one process from node to node."""

    def __init__(self) -> None:
        #: Whether messages may be intercepted on their lines; known before publishers are made.
        self.intercepts = False
        #: Steady wall time after which long work is not gone on with.
        self.until_s = math.inf
        self._ears: dict[str, Ear] = {}
        self._lines: dict[str, Line] = {}
        self._queue: deque[tuple[Callable[[Any], None], Any, LocalReader]] = deque()
        self._under_way = False
        self._to_go_on = False
        self._executor: Any = None
        self._unsettled: list[Callable[[], None]] = []
        self._when_idle: list[Callable[[], None]] = []

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
        line.subscriptions.append((reader.node, subscribe))
        self.when_settled(line.hear_outside)
        return line

    @property
    def settled(self) -> bool:
        """Whether all nodes are made."""
        return self._executor is not None

    def when_settled(self, callback: Callable[[], None]) -> None:
        """Call back once all nodes are made, at once if they are."""
        if self.settled:
            callback()
        else:
            self._unsettled.append(callback)

    def listen(self, name: str, listener: Listener) -> None:
        """Listen to a topic of many publishers, or a timer, by the one that the process has."""
        self._ears.setdefault(name, Ear()).add(listener)

    def settle(self, executor: Any) -> None:
        """All nodes are made: what is sent and heard outside is known from now on.

        Parameters
        ----------
        executor : EventsExecutor
            Spins the nodes.
        """
        self._executor = executor
        for callback in self._unsettled:
            callback()
        self._unsettled.clear()

    def put(self, line: Line, message: Sendable, raw: bytes | None) -> None:
        """Hand a message to the readers of a line once the present callback has returned.

        Parameters
        ----------
        raw : bytes or None
            Its serialised form, if there is one already.
        """
        put = self._queue.append
        if message is raw:
            for reader in line.readers:
                put((reader.take_raw, raw, reader))
            return
        for reader in line.readers:
            if reader.take_view is not None:
                put((reader.take_view, message, reader))
                continue
            if raw is None:
                raw = serialised(message)
            put((reader.take_raw, raw, reader))

    def when_idle(self, callback: Callable[[], None]) -> None:
        """Call back once everything that waits has been handed over, and what comes of it."""
        self._when_idle.append(callback)

    def remove(self, node: Any) -> None:
        """Hand nothing any longer to a node; what it sent may come from outside from now on.

        The executor may be about to forget the node: subscriptions in its place come after that.
        """
        for ear in self._ears.values():
            self._later(partial(ear.remove, node))
        for line in self._lines.values():
            line.readers = [reader for reader in line.readers if reader.node is not node]
            line.subscriptions = [each for each in line.subscriptions if each[0] is not node]
            if node in line.writers:
                line.writers = [writer for writer in line.writers if writer is not node]
                self._later(line.hear_outside)
        waiting = [entry for entry in self._queue if entry[2].node is not node]
        self._queue.clear()
        self._queue.extend(waiting)

    def _later(self, task: Callable[[], None]) -> None:
        if self._executor is None:
            task()
        else:
            self._executor.create_task(task)

    def run(self) -> None:
        """Hand over what waits, and what comes of it; long work is done in turns.

        Between two turns the executor serves the outside: what it calls must not begin a turn of
        its own, or a message from there would have to wait a turn for each one before it.
        """
        if self._under_way or self._to_go_on:
            return
        self._under_way = True
        until_s = time.monotonic() + _TURN_S
        handed_over = 0
        queue = self._queue
        try:
            while queue:
                take, message, reader = queue.popleft()
                try:
                    take(message)
                except Exception as error:
                    reader.fail(error)
                handed_over += 1
                if handed_over % _LOOK_EVERY == 0 and time.monotonic() > until_s:
                    break
        finally:
            self._under_way = False
            if queue and self._executor is not None:
                self._to_go_on = True
                self._executor.create_task(self._go_on)
        if not queue and self._when_idle:
            callbacks, self._when_idle = self._when_idle, []
            for callback in callbacks:
                callback()

    def _go_on(self) -> None:
        self._to_go_on = False
        if time.monotonic() < self.until_s:
            self.run()

    def close(self) -> None:
        """Forget nodes and executor; harmless when called again.

        The executor holds what it calls where the collector cannot see it: what knew both would
        never be freed, and a process could not make run after run.
        """
        self._executor = None
        for kept in (self._ears, self._lines, self._queue, self._unsettled, self._when_idle):
            kept.clear()

    def going_round(self) -> str:
        """What still waits, in words; nothing if nothing does."""
        lines = {id(r): name for name, line in self._lines.items() for r in line.readers}
        waiting = Counter(lines.get(id(reader), "?") for _, _, reader in self._queue)
        return "".join(
            f": {count} messages wait on {name}" for name, count in waiting.most_common(1)
        )
