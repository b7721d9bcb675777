"""The floor of transport: recorded messages brought again to as many readers that do nothing."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from types import TracebackType
from typing import Any, Final

import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rail_msgs_py.delivery import Line, LocalDelivery, LocalReader, Sendable

from .recorded_messages import Carried, fail_aloud

#: So many messages are put before they are handed over: as many as a node sends in a turn.
_TURN: Final = 16
_NAMESPACE: Final = "/transport_floor"
#: Wall time for readers to be connected, and for messages to come [s].
_CONNECTION_S: Final = 10.0
_LOST_S: Final = 1.0


def hand_over_s(
    messages: Iterable[tuple[str, Sendable]], readers: Mapping[str, list[bool]]
) -> float:
    """CPU time to hand messages to as many readers that do nothing, past the middleware [s].

    Parameters
    ----------
    messages : iterable of names of topics and messages
    readers : mapping
        By the name of the topic, whether each of its readers takes views.
    """
    delivery = LocalDelivery()
    for name, kinds in readers.items():
        for takes_views in kinds:
            reader = LocalReader(None, fail_aloud, _ignore, _ignore if takes_views else None)
            delivery.line(name).readers.append(reader)
    put, run = delivery.put, delivery.run
    turns: list[list[tuple[Line, Sendable]]] = [[]]
    for name, message in messages:
        if len(turns[-1]) == _TURN:
            turns.append([])
        turns[-1].append((delivery.line(name), message))
    begin_s = time.thread_time()
    for turn in turns:
        for line, message in turn:
            put(line, message, None)
        run()
    return time.thread_time() - begin_s


class MiddlewareLoop:
    """Publishers and subscriptions of one node that does nothing but carry messages.

    One publisher to a topic, however many nodes send on it: that is the least.

    Parameters
    ----------
    topics : mapping
        By the name of the topic, what is carried.
    """

    def __init__(self, topics: Mapping[str, Carried]) -> None:
        self._topics = topics
        self._to_come = 0
        self._all_came = Future()

    def __enter__(self) -> MiddlewareLoop:
        """Connect the readers."""
        self._context = rclpy.Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node(
            "transport_floor",
            context=self._context,
            start_parameter_services=False,
            enable_rosout=False,
        )
        self._publishers: dict[str, Any] = {}
        for name, topic in self._topics.items():
            own = _NAMESPACE + name
            self._publishers[name] = self._node.create_publisher(topic.type, own, topic.qos)
            for _ in range(topic.readers):
                self._node.create_subscription(topic.type, own, self._take, topic.qos, raw=True)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self._node)
        until_s = time.monotonic() + _CONNECTION_S
        while time.monotonic() < until_s and not self._connected():
            self._executor.spin_until_future_complete(Future(), timeout_sec=0.01)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the middleware."""
        self._executor.shutdown()
        self._node.destroy_node()
        rclpy.try_shutdown(context=self._context)

    def carry_s(self, messages: Iterable[tuple[str, bytes]]) -> float:
        """CPU time of this thread to publish messages and to take them where they are read [s]."""
        ready = [(self._publishers[name].handle.publish_raw, raw) for name, raw in messages]
        self._to_come = sum(self._topics[name].readers for name, _ in messages)
        self._all_came = Future()
        begin_s = time.thread_time()
        for publish, raw in ready:
            publish(raw)
        if self._to_come:
            self._executor.spin_until_future_complete(self._all_came, timeout_sec=_LOST_S)
        return time.thread_time() - begin_s

    def _connected(self) -> bool:
        return all(
            self._publishers[name].get_subscription_count() >= topic.readers
            for name, topic in self._topics.items()
        )

    def _take(self, _: bytes) -> None:
        self._to_come -= 1
        if self._to_come == 0:
            self._all_came.set_result(None)


def _ignore(_: Any) -> None:
    """Reader that does nothing."""
