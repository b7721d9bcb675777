"""Messages that the nodes of a process hand to each other, recorded, and handed over again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from typing import Any, Final

from rail_msgs_py.delivery import Line, LocalDelivery, LocalReader, Sendable

#: So many messages are put before they are handed over: as many as a node sends in a turn.
_TURN: Final = 16


class MessageRecorder:
    """Reads along what a delivery hands over.

    Parameters
    ----------
    delivery : LocalDelivery
        With all of its readers.
    """

    def __init__(self, delivery: LocalDelivery) -> None:
        self._delivery = delivery
        self.messages: list[tuple[str, Sendable]] = []
        #: By the name of the topic, whether each of its readers takes views.
        self.readers = {
            name: [reader.take_view is not None for reader in line.readers]
            for name, line in delivery.lines.items()
            if line.readers
        }

    def start(self) -> None:
        """Record from now on."""
        for name in self.readers:
            take = self._taker(name)
            self._delivery.read(name, LocalReader(self, take, take), lambda: None)

    def _taker(self, name: str) -> Callable[[Sendable], None]:
        note = self.messages.append
        return lambda message: note((name, message))

    def stop(self) -> None:
        """Record no longer."""
        self._delivery.remove(self)

    @property
    def handed_over(self) -> int:
        """How often a reader was given one of the messages."""
        return sum(len(self.readers[name]) for name, _ in self.messages)


def hand_over_s(messages: Iterable[tuple[str, Sendable]], readers: dict[str, list[bool]]) -> float:
    """Wall time to hand messages to as many readers that do nothing [s].

    Parameters
    ----------
    messages : iterable of names of topics and messages
    readers : dict
        By the name of the topic, whether each of its readers takes views.
    """
    delivery = LocalDelivery()
    for name, kinds in readers.items():
        for takes_views in kinds:
            reader = LocalReader(None, _ignore, _ignore if takes_views else None)
            delivery.line(name).readers.append(reader)
    put, run = delivery.put, delivery.run
    turns: list[list[tuple[Line, Sendable]]] = [[]]
    for name, message in messages:
        if len(turns[-1]) == _TURN:
            turns.append([])
        turns[-1].append((delivery.line(name), message))
    begin_s = time.perf_counter()
    for turn in turns:
        for line, message in turn:
            put(line, message, None)
        run()
    return time.perf_counter() - begin_s


def _ignore(_: Any) -> None:
    """Reader that does nothing."""
