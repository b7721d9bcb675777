"""What the tests are built from: a line, a train, and a ROS graph of its own."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from rail_msgs_py.topics.topic import Topic
from rail_world.line.description import TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.trains.description import TrainDescription

#: Only ever reached by a test that fails.
PATIENCE_S = 30.0

LINE: dict[str, Any] = {
    "name": "line",
    "seed": 3,
    "duration_s": 30.0,
    "tick_s": 0.1,
    "tracks": {"main": {"elements": [{"straight_m": 1300}], "speed_limits": [[0, 80]]}},
    "stations": {"zone_length_m": 200.0},
    "axle_counters": {"length_m": 450, "margin_m": 200},
    "trains": [{"name": "a", "route": ["main"], "start_m": 130, "speed_kmh": 80}],
}


def straight(length_m: float) -> Network:
    """Return a network of one straight track."""
    described = TrackDescription.model_validate({"elements": [{"straight_m": length_m}]})
    return build_network({"main": described})


def train(length_m: float = 60.0, direction: int = 1, **fields: Any) -> TrainDescription:
    """Return a train on that track."""
    return TrainDescription.model_validate(
        {
            "name": "a",
            "route": ["main"],
            "direction": direction,
            "vehicle": {"length_m": length_m},
            **fields,
        }
    )


class Graph:
    """Nodes under test, and a bystander that talks to them."""

    def __init__(self, domain: int) -> None:

        self.context = rclpy.Context()
        rclpy.init(
            context=self.context, domain_id=domain, signal_handler_options=SignalHandlerOptions.NO
        )
        self.bystander = Node("bystander", context=self.context, enable_rosout=False)
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.bystander)
        self._nodes: list[Any] = []

    def add(self, node: Any) -> Any:
        """Spin a node, switched on if it is equipment."""
        self._nodes.append(node)
        if hasattr(node, "switch_on"):
            node.switch_on()
        self._executor.add_node(node)
        return node

    def mailbox(self, topic: Topic, **parts: object) -> list[Any]:
        """Return the list that every message of a topic is put into."""
        box: list[Any] = []
        name = topic.name(**parts)
        self.bystander.create_subscription(topic.type, name, box.append, topic.qos)
        self.wait(lambda: self.bystander.count_publishers(name) > 0)
        return box

    def sender(self, topic: Topic, **parts: object) -> Callable[[Any], None]:
        """Return the function that publishes a message, or its bytes, to who reads it."""
        publisher = self.bystander.create_publisher(topic.type, topic.name(**parts), topic.qos)
        self.wait(lambda: publisher.get_subscription_count() > 0)
        publish: Callable[[Any], None] = publisher.publish
        return publish

    def wait(self, predicate: Callable[[], object]) -> None:
        """Spin until the predicate holds; fail when it does not within `PATIENCE_S`."""
        deadline_s = time.monotonic() + PATIENCE_S
        while not predicate():
            assert time.monotonic() < deadline_s, "did not come true in time"
            self._executor.spin_once(timeout_sec=0.01)

    def close(self) -> None:

        self._executor.shutdown()
        for node in (*self._nodes, self.bystander):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)
