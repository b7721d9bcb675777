"""Takes an ordinary rclpy node into the delivery of the process: it misses no message.

A node that only listens is waited for by nobody: at the speed of a simulation the middleware's
queues overflow. Adopted, its callbacks are called in the order in which messages were sent, each
before the next tick begins, and what it publishes reaches the corridor at once. The node itself
is not changed and knows nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.qos import DurabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message

from rail_corridor.equipment.registry import kind_of
from rail_msgs_py.delivery import Line, LocalDelivery, LocalReader


class Adoption:
    """One adopted node.

    Parameters
    ----------
    node : rclpy Node
    delivery : LocalDelivery
        Of the corridor, before or after it has started.
    tap : callable, optional
        Of the corridor's context: is told of what the node publishes.
    """

    def __init__(self, node: Any, delivery: LocalDelivery, tap: Any = None) -> None:
        self.node = node
        self._delivery, self._tap = delivery, tap
        self._known: set[int] = set()
        #: What its callbacks have raised, in their order.
        self.errors: list[Exception] = []
        self._readers: dict[int, tuple[Line, LocalReader]] = {}
        self._destroy = node.destroy_subscription
        node.destroy_subscription = self._destroy_subscription
        self.look()

    def look(self) -> None:
        """Take over the subscriptions and publishers that the node has made since the last look."""
        for publisher in [each for each in self.node.publishers if self._is_new(each)]:
            self._take_publisher(publisher)
        for subscription in [each for each in self.node.subscriptions if self._is_new(each)]:
            self._take_subscription(subscription)

    def _is_new(self, entity: Any) -> bool:
        """Whether an entity has not been seen; its id lasts, as it lives as long as its node."""
        new = id(entity) not in self._known
        self._known.add(id(entity))
        return new

    def _take_subscription(self, subscription: Any) -> None:
        profile = subscription.qos_profile
        if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
            return  # it wants what was said before, which the middleware keeps
        name, kind, raw_wanted = subscription.topic_name, subscription.msg_type, subscription.raw
        callback: Callable[..., None] = subscription.callback
        with_info = _positional(callback) > 1

        def take(raw: bytes) -> None:
            message = raw if raw_wanted else deserialize_message(raw, kind)
            callback(message, {}) if with_info else callback(message)

        def forget(_: Any) -> None:
            """What the middleware still brings has been handed over already."""

        line = self._delivery.line(name)
        reader = LocalReader(self.node, self.errors.append, take)
        outside = subscription.callback

        def hear_outside() -> None:
            subscription.callback = self._guarded(outside)

        subscription.callback = forget
        line.readers.append(reader)
        self._readers[id(subscription)] = line, reader
        line.subscriptions.append((self.node, hear_outside))
        self._delivery.when_settled(line.hear_outside)

    def _destroy_subscription(self, subscription: Any) -> bool:
        """In the place of the node's own: what is destroyed hears no more."""
        line, reader = self._readers.pop(id(subscription), (None, None))
        if line is not None and reader in line.readers:
            line.readers = [each for each in line.readers if each is not reader]
        self._known.discard(id(subscription))
        return bool(self._destroy(subscription))

    def _take_publisher(self, publisher: Any) -> None:
        name = publisher.topic_name
        line, delivery, topic = self._delivery.line(name), self._delivery, kind_of(name)
        line.writers.append(self.node)
        line.kind = publisher.msg_type
        sink = None if self._tap is None or topic is None else self._tap(topic, name)
        publish_outside = publisher.publish

        def send_on(raw: bytes) -> None:
            if sink is not None:
                sink(raw)
            delivery.put(line, raw, raw)
            if publisher.get_subscription_count() > 0:
                publish_outside(raw)

        def publish(message: Any) -> None:
            raw = message if isinstance(message, bytes) else bytes(serialize_message(message))
            for each in (raw,) if line.intercept is None else line.intercept(raw):
                send_on(each if isinstance(each, bytes) else each.to_cdr())
            delivery.run()

        publisher.publish = publish

    def _guarded(self, callback: Callable[..., None]) -> Callable[[Any], None]:
        """Callback of the middleware whose errors are the node's, and whose messages go on."""

        def run(message: Any) -> None:
            try:
                callback(message)
            except Exception as error:
                self.errors.append(error)
            self._delivery.run()

        return run


def _positional(callback: Callable[..., None]) -> int:
    """How many arguments a callback takes: the second is what rclpy knows of the message."""
    import inspect

    try:
        return len(inspect.signature(callback).parameters)
    except (TypeError, ValueError):
        return 1
