"""Messages of some ticks, recorded where they are delivered: here, or by the middleware."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message

from rail_msgs_py.delivery import LocalDelivery, LocalReader, Sendable, serialised
from rail_msgs_py.topics.tick import CLOCK


class Carried(NamedTuple):
    """What the middleware carries on one topic."""

    type: Any
    qos: Any
    #: Subscriptions of this process to it.
    readers: int


class TickMessages(NamedTuple):
    """Messages of one tick with the names of their topics, in the order in which they were sent."""

    #: Handed from node to node.
    local: list[tuple[str, Sendable]]
    #: Given to the middleware, which also brings back what this process subscribes to.
    carried: list[tuple[str, bytes]]


class MessageRecorder:
    """Reads along what the nodes of a process send.

    Parameters
    ----------
    delivery : LocalDelivery
        With all of its readers.
    nodes : iterable of nodes
        All nodes of the process.
    """

    def __init__(self, delivery: LocalDelivery, nodes: Iterable[Any]) -> None:
        self._delivery, nodes = delivery, list(nodes)
        self.ticks: list[TickMessages] = []
        #: By the name of the topic, whether each of its readers takes views.
        self.readers = {
            name: [reader.take_view is not None for reader in line.readers]
            for name, line in delivery.lines.items()
        }
        self._subscriptions: dict[str, list[Any]] = {}
        for subscription in (each for node in nodes for each in node.subscriptions):
            self._subscriptions.setdefault(subscription.topic_name, []).append(subscription)
        #: By the name of the topic, what the middleware carries.
        self.carried = {
            each.topic_name: Carried(
                each.msg_type, each.qos_profile, len(self._subscriptions.get(each.topic_name, ()))
            )
            for node in nodes
            for each in node.publishers
            if is_carried(each)
        }

    def start(self) -> None:
        """Record from now on; the first message is that which begins a tick."""
        for name in self.readers:
            take = self._taker(name)
            self._delivery.read(name, LocalReader(self, fail_aloud, take, take), lambda: None)
        # What nodes of several processes send comes by the middleware alone.
        self._told = {
            name: self._subscriptions[name][0]
            for name in self.carried.keys() & self._subscriptions.keys() - self.readers.keys()
        }
        self._callbacks = {name: each.callback for name, each in self._told.items()}
        for name, subscription in self._told.items():
            subscription.callback = self._listener(name, subscription.callback)

    def stop(self) -> None:
        """Record no longer."""
        self._delivery.remove(self)
        for name, subscription in self._told.items():
            subscription.callback = self._callbacks[name]

    @property
    def handed_over(self) -> int:
        """How often a reader was given one of the messages, past the middleware."""
        return sum(len(self.readers[name]) for tick in self.ticks for name, _ in tick.local)

    def _taker(self, name: str) -> Callable[[Sendable], None]:
        carried, begins_a_tick = name in self.carried, name == CLOCK.name()
        read_here = bool(self.readers[name])

        def take(message: Sendable) -> None:
            if begins_a_tick or not self.ticks:
                self.ticks.append(TickMessages([], []))
            if read_here:
                self.ticks[-1].local.append((name, message))
            if carried:
                self.ticks[-1].carried.append((name, serialised(message)))

        return take

    def _listener(self, name: str, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        def take(message: Any) -> None:
            raw = message if isinstance(message, bytes) else serialize_message(message)
            if self.ticks:
                self.ticks[-1].carried.append((name, raw))
            callback(message)

        return take


def fail_aloud(error: Exception) -> None:
    """Let what a reader raises end the run."""
    raise error


def is_carried(publisher: Any) -> bool:
    """Whether what a publisher of the corridor sends goes to the middleware, as things are.

    What is kept for those who come later always does, the rest as soon as somebody subscribes.
    """
    kept = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
    return bool(kept or publisher.get_subscription_count())
