"""The publishers of the corridor: to a recorder, to the nodes of the process, and to the others."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import serialize_message

from rail_msgs_py.topics.qos import ESTIMATE, STREAM
from rail_msgs_py.topics.topic import Topic

from .delivery import LocalDelivery, Send, Sendable, serialised
from .tap import Sink, Tap


class CorridorPublisher:
    """Sends the messages of one topic of one node.

    A recorder is told first, so that a process killed in between has told of whatever others
    have received. A message is serialised at most once, and only if somebody needs it so.

    Parameters
    ----------
    node : node
        The sender.
    topic : Topic
    publisher : rclpy Publisher
    tap : Tap, optional
    delivery : LocalDelivery, optional
        Of the process; without it everything goes through the middleware.
    """

    def __init__(
        self,
        node: Any,
        topic: Topic,
        publisher: Any,
        tap: Tap | None,
        delivery: LocalDelivery | None,
    ) -> None:
        self._publisher = publisher
        self._count = publisher.handle.get_subscription_count
        sink = None if tap is None else tap(topic, publisher.topic_name)
        self._line = None if delivery is None else delivery.line(publisher.topic_name)
        if self._line is not None:
            self._line.writers.append(node)
        #: Sends a message, or its serialised form.
        self.send: Send = self._sender(sink, delivery)
        # Whether the middleware has to carry it: until more is known it has.
        self._carried = True
        # What is kept for those who come later is kept by the middleware.
        self._selective = delivery is not None and (topic.qos is STREAM or topic.qos is ESTIMATE)
        if delivery is not None:
            delivery.when_settled(self.look_outside)

    def look_outside(self) -> None:
        """Note whether somebody outside listens; to be called whenever that has changed."""
        self._carried = not self._selective or self._count() > 0

    def _sender(self, sink: Sink | None, delivery: LocalDelivery | None) -> Send:
        publish_raw, line = self._publisher.handle.publish_raw, self._line
        put = None if delivery is None else delivery.put

        def send_on(message: Sendable) -> None:
            raw = message if type(message) is bytes else None
            if sink is not None:
                raw = serialised(message) if raw is None else raw
                sink(raw)
            if put is not None and line is not None and line.readers:
                put(line, message, raw)
            if self._carried:
                publish_raw(serialised(message) if raw is None else raw)

        if line is None or delivery is None or not delivery.intercepts:
            return send_on

        def send(message: Sendable) -> None:
            for each in (message,) if line.intercept is None else line.intercept(message):
                if line.gathers:
                    line.early.append(each)
                send_on(each)

        return send

    def publish(self, message: Any) -> None:
        """Publish a message of ROS, or its serialised form."""
        self.send(message if isinstance(message, bytes) else serialize_message(message))

    @property
    def topic_name(self) -> str:
        """Absolute name of the topic, after the node's remapping rules."""
        name: str = self._publisher.topic_name
        return name

    def get_subscription_count(self) -> int:
        """Number of subscriptions that the publisher is connected to, here and outside."""
        here = 0 if self._line is None else len(self._line.readers)
        return here + int(self._count())
