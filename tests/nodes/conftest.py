"""A ROS graph of its own for each test: context, domain, executor, and a mailbox per topic."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
import rclpy
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rail_msgs_py.topics.qos import LATCHED
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, READY
from rail_msgs_py.topics.topic import Topic

#: Only ever reached by a test that fails.
PATIENCE_S = 30.0


class Graph:
    """Nodes under test, and a bystander that talks to them."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(
            context=self.context,
            domain_id=domain,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.bystander = Node(
            "bystander", context=self.context, start_parameter_services=False, enable_rosout=False
        )
        self._executor = EventsExecutor(context=self.context)
        self._executor.add_node(self.bystander)
        self._nodes: list[Any] = []
        self._publishers: dict[str, Any] = {}
        self._mailboxes: dict[str, list[Any]] = {}
        self._streams: list[str] = []
        self._predicate: Callable[[], object] = lambda: False
        self._reached = Future()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.bystander.create_timer(0.002, self._look, clock=steady)
        self.ready = self.mailbox(READY)
        self.failed = self.mailbox(FAILED)
        self.diagnostics = self.mailbox(DIAGNOSTICS)

    def add(self, node: Any) -> Any:
        """Spin a node, switched on if it is equipment; it ends with the test."""
        self._nodes.append(node)
        if not getattr(node, "switched_on", True):
            node.switch_on()
        self._executor.add_node(node)
        return node

    def mailbox(self, topic: Topic, *, raw: bool = False, **parts: object) -> list[Any]:
        """Return the list that every message of a topic is put into."""
        name = topic.name(**parts)
        if name not in self._mailboxes:
            box: list[Any] = []
            self._mailboxes[name] = box
            if topic.qos is not LATCHED:
                self._streams.append(name)
            self.bystander.create_subscription(topic.type, name, box.append, topic.qos, raw=raw)
        return self._mailboxes[name]

    def sender(self, topic: Topic, **parts: object) -> Callable[[Any], None]:
        """Return the function that publishes a message, or its bytes, on a topic."""
        name = topic.name(**parts)
        if name not in self._publishers:
            self._publishers[name] = self.bystander.create_publisher(topic.type, name, topic.qos)
        publish: Callable[[Any], None] = self._publishers[name].publish
        return publish

    def connect(self, *names: str) -> None:
        """Wait until nodes say that they are connected, and the bystander is as well."""
        self.wait(lambda: set(names) <= {message.data for message in self.ready})
        self.wait(
            lambda: (
                all(p.get_subscription_count() for p in self._publishers.values())
                and all(self.bystander.count_publishers(name) for name in self._streams)
            )
        )

    def wait(self, predicate: Callable[[], object]) -> None:
        """Spin until the predicate holds; fail when it does not within `PATIENCE_S`."""
        self._predicate, self._reached = predicate, Future()
        if not predicate():
            self._executor.spin_until_future_complete(self._reached, timeout_sec=PATIENCE_S)
        assert predicate(), "did not come true in time"

    def told(self, aspect: str) -> list[tuple[bytes, str]]:
        """Return level and message of an aspect, by the end of its name, as they changed."""
        said = [
            (status.level, status.message)
            for message in self.diagnostics
            for status in message.status
            if status.name.endswith(aspect)
        ]
        return [each for n, each in enumerate(said) if n == 0 or each != said[n - 1]]

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Return the answer of a service."""
        client = self.bystander.create_client(kind, name)
        self.wait(client.service_is_ready)
        answer = client.call_async(request)
        self.wait(answer.done)
        return answer.result()

    def switch(self, name: str, *, on: bool) -> None:
        """Switch a node off or on by its lifecycle service."""
        kind = Transition.TRANSITION_ACTIVATE if on else Transition.TRANSITION_DEACTIVATE
        request = ChangeState.Request(transition=Transition(id=kind))
        assert self.call(ChangeState, f"{name}/change_state", request).success

    def close(self) -> None:
        self._executor.shutdown()
        for node in (*self._nodes, self.bystander):
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)

    def _look(self) -> None:
        if not self._reached.done() and self._predicate():
            self._reached.set_result(None)


@pytest.fixture
def graph(ros_domain: int) -> Iterator[Graph]:
    """Return a graph that no other test can hear."""
    made = Graph(ros_domain)
    try:
        yield made
    finally:
        made.close()
