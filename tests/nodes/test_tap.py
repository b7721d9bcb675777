"""A tap is told exactly what goes out; a bystander tells what others send."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import String

from rail_corridor.run.external_traffic import FULL_NAME, ExternalTrafficRecorder
from rail_msgs_py.context import CorridorContext
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.node import CorridorNode
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.topics.tick import CLOCK, DONE, FAILED, FINISHED, READY
from rail_msgs_py.topics.topic import Topic


class Told:
    """A tap that keeps what it is told, by topic."""

    def __init__(self, *besides: str) -> None:
        self.messages: dict[str, list[bytes]] = {}
        self._besides = besides

    def __call__(self, topic: Topic, name: str) -> Callable[[bytes], None] | None:
        return None if name in self._besides else self.open(topic, name)

    def open(self, topic: Topic, name: str) -> Callable[[bytes], None]:
        return self.messages.setdefault(name, []).append


@pytest.fixture
def told() -> Told:
    return Told("/failed")


@pytest.fixture
def context(told: Told, ros_domain: int) -> Iterator[Any]:
    """Return a context with a tap, in the domain of the graph."""
    made = CorridorContext(told)
    rclpy.init(context=made, domain_id=ros_domain, signal_handler_options=SignalHandlerOptions.NO)
    yield made
    rclpy.try_shutdown(context=made)


def test_what_is_told_is_what_others_receive(graph: Any, context: Any, told: Told) -> None:
    node = CorridorNode("world", "/", context=context, services=False)
    heard = graph.mailbox(DONE, raw=True, node="/world/radio_medium")
    clock = graph.mailbox(CLOCK, raw=True)
    finished = graph.mailbox(FINISHED)
    done = node.stream_out(DONE, node="/world/radio_medium")
    tick, end = node.publisher(CLOCK), node.publisher(FINISHED)
    failed = node.publisher(FAILED)
    graph.wait(lambda: tick.get_subscription_count() and not node.lacking())
    for stamp_ns in (0, 100_000_000):
        tick.publish(clock_to_cdr(stamp_ns))
        done(header_to_cdr(stamp_ns))
    message = FINISHED.type(frame_id="world")
    end.publish(message)
    failed.publish(FAILED.type(name="/somebody"))
    graph.wait(lambda: len(heard) == 2 and len(clock) == 2 and finished and graph.failed)
    assert told.messages["/world/radio_medium/done"] == heard
    assert told.messages["/clock"] == clock
    (raw,) = told.messages["/world/finished"]
    assert deserialize_message(raw, FINISHED.type) == message == finished[0]
    assert "/failed" not in told.messages
    node.destroy_node()


def test_a_bystander_tells_what_a_stranger_publishes(graph: Any) -> None:
    told = Told()
    shared = (READY, FAILED)
    graph.add(ExternalTrafficRecorder(["/theirs"], told.open, shared, context=graph.context))
    stranger = CorridorNode("theirs", "/", context=graph.context, services=False)
    tick = stranger.publisher(CLOCK)
    own = stranger.create_publisher(String, "/theirs/own", 10)
    stranger.announce_when_connected()
    graph.add(stranger)
    graph.connect("/theirs", FULL_NAME)
    stamps = [clock_to_cdr(n * 100_000_000) for n in range(50)]
    for raw in stamps:
        tick.publish(raw)
    own.publish(String(data="mine"))
    graph.wait(lambda: len(told.messages["/clock"]) == 50 and told.messages["/theirs/own"])
    assert told.messages["/clock"] == stamps
    said = [deserialize_message(raw, String).data for raw in told.messages["/ready"]]
    assert "/theirs" in said
