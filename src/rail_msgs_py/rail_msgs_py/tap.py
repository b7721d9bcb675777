"""What the nodes of a process publish, told to a recorder as well.

A recorder that subscribes pays for every message a second time in the middleware, and can miss
some. One that is told by the publisher itself does neither: the tap belongs to the context that
the nodes of a process share, and `CorridorMixin.publisher` puts it before every publisher.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.context import Context
from rclpy.serialization import serialize_message

from rail_msgs_py.topics.topic import Topic

#: Takes the serialised messages of one topic.
Sink = Callable[[bytes], None]
#: Opens the sink of a publisher: kind of topic, absolute name; None if it is not to be told.
Tap = Callable[[Topic, str], Sink | None]


class TappedContext(Context):  # type: ignore[misc]
    """Context whose nodes tell a tap of everything they publish."""

    def __init__(self, tap: Tap) -> None:
        super().__init__()
        self.tap = tap


class TappedPublisher:
    """A publisher that tells a sink of each message, just before it is sent.

    Before, so that a process killed in between has told of whatever others have received.
    """

    def __init__(self, publisher: Any, sink: Sink) -> None:
        self._publisher = publisher
        publish_raw: Sink = publisher.handle.publish_raw

        def publish_bytes(raw: bytes) -> None:
            sink(raw)
            publish_raw(raw)

        self.publish_bytes = publish_bytes

    def publish(self, message: Any) -> None:
        """Publish a message, or its serialised form."""
        self.publish_bytes(message if isinstance(message, bytes) else serialize_message(message))

    def get_subscription_count(self) -> int:
        """Number of subscriptions that the publisher is connected to."""
        return int(self._publisher.get_subscription_count())


def tapped(context: Any, topic: Topic, publisher: Any) -> Any:
    """The publisher as it is, or with the tap of the context before it."""
    tap: Tap | None = getattr(context, "tap", None)
    sink = None if tap is None else tap(topic, publisher.topic_name)
    return publisher if sink is None else TappedPublisher(publisher, sink)


def raw_publish(publisher: Any) -> Sink:
    """Function that publishes serialised messages, without the checks of ``Publisher.publish``."""
    if isinstance(publisher, TappedPublisher):
        return publisher.publish_bytes
    publish: Sink = publisher.handle.publish_raw
    return publish
