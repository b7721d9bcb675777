"""The publishers of the corridor: to a recorder, to the nodes of the process, and to the others."""

from __future__ import annotations

from typing import Any

from rclpy.serialization import serialize_message

from rail_msgs_py.topics.qos import ESTIMATE, STREAM
from rail_msgs_py.topics.topic import Topic

from .delivery import Line, LocalDelivery, Send, Sendable, serialised
from .tap import Sink, Tap


class CorridorPublisher:
    """Sends the messages of one topic of one node.

    A recorder is told first, so that a process killed in between has told of whatever others
    have received. A message is serialised at most once, and only if somebody needs it so.

    Parameters
    ----------
    topic : Topic
    publisher : rclpy Publisher
    tap : Tap, optional
    delivery : LocalDelivery, optional
        Of the process; without it everything goes through the middleware.
    """

    def __init__(
        self, topic: Topic, publisher: Any, tap: Tap | None, delivery: LocalDelivery | None
    ) -> None:
        self._publisher = publisher
        self._count = publisher.handle.get_subscription_count
        sink = None if tap is None else tap(topic, publisher.topic_name)
        self._line: Line | None = None
        if delivery is None:
            send = self._sender(sink)
        else:
            self._line = line = delivery.line(publisher.topic_name)
            line.writers += 1
            # What is kept for those who come later is kept by the middleware.
            selective = topic.qos is STREAM or topic.qos is ESTIMATE
            send = self._local_sender(sink, delivery, line, selective=selective)
        #: Sends a message, or its serialised form.
        self.send: Send = send

    def _sender(self, sink: Sink | None) -> Send:
        publish_raw = self._publisher.handle.publish_raw

        def send(message: Sendable) -> None:
            raw = serialised(message)
            if sink is not None:
                sink(raw)
            publish_raw(raw)

        return send

    def _local_sender(
        self, sink: Sink | None, delivery: LocalDelivery, line: Line, *, selective: bool
    ) -> Send:
        publish_raw, count, put = self._publisher.handle.publish_raw, self._count, delivery.put

        def send(message: Sendable) -> None:
            raw = message if type(message) is bytes else None
            if sink is not None:
                raw = serialised(message) if raw is None else raw
                sink(raw)
            if line.readers:
                put(line, message, raw)
            if not selective or count():
                publish_raw(serialised(message) if raw is None else raw)

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
