"""The ROS graph around a command: a node, and what there is to look at, known within a second."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rail_corridor.middleware.discovery import discover_on
from rail_corridor.middleware.domain import is_held
from rail_corridor.middleware.roll_call import RollCall
from rail_msgs_py.message_definition import message_class
from rail_msgs_py.standalone import spin
from rail_msgs_py.topics.tick import CLOCK

#: Wall time in which participants of this host answer that they are there; each has milliseconds.
ANSWER_S = 0.3
#: ... and after which nothing more comes once everybody who has answered is known.
QUIET_S = 0.15
#: ... or, as there are more nodes than have answered, or on other hosts.
SETTLED_S = 4.0
#: ... and in which a corridor starts.
START_S = 15.0
_POLL_S = 0.01
#: ... before everybody is asked again, a message may be lost; longer from time to time.
_ASK_S = 0.1
#: Name by which DDS knows the topic on which each participant tells its nodes.
_NODES_TOPIC = "ros_discovery_info"


class Graph:
    """What becomes known of a ROS domain, and whether that is all.

    Parameters
    ----------
    node : rclpy node
        Of this process.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self._roll_call = RollCall(node.context.get_domain_id())
        self._begun_s = self._changed_s = time.monotonic()
        self._patience_s = 0.5 * _ASK_S
        self._ask()
        self._known: tuple[int, ...] = ()
        self._corridor_is_here = is_held()
        self._elsewhere = os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] != "LOCALHOST" or bool(
            os.environ.get("ROS_STATIC_PEERS")
        )

    def _ask(self) -> None:
        self._roll_call.ask()
        self._asked_s = time.monotonic()
        self._patience_s *= 2.0

    def close(self) -> None:
        """Ask nobody any more."""
        self._roll_call.close()

    def is_settled(self) -> bool:
        """Look again: whether all that is there is known."""
        now_s = time.monotonic()
        answered = self._roll_call.listen()
        everybody = bool(answered) and self._told() >= answered
        if not everybody and now_s - self._asked_s > self._patience_s:
            self._ask()
        nodes = self.node.get_node_names()
        known = len(nodes), len(self.node.get_topic_names_and_types()), len(answered)
        if known != self._known:
            self._known, self._changed_s = known, now_s
        age_s, quiet_s = now_s - self._begun_s, now_s - self._changed_s
        if self._corridor_is_here and not self.publishes(CLOCK.name()):
            return age_s > START_S  # its nodes are still being made
        if self._elsewhere:
            return quiet_s > SETTLED_S
        if age_s < ANSWER_S or not answered:
            return age_s >= ANSWER_S
        # Each has at least one node, and tells its endpoints before its nodes.
        complete = everybody and len(nodes) > len(answered)
        return quiet_s > (QUIET_S if complete else SETTLED_S)

    def _told(self) -> set[bytes]:
        """Prefixes of the participants whose endpoints are known."""
        infos = self.node.get_publishers_info_by_topic(_NODES_TOPIC, no_mangle=True)
        return {bytes(info.endpoint_gid[:12]) for info in infos}

    def topics(self) -> dict[str, list[str]]:
        """Types of each topic that is known."""
        return dict(self.node.get_topic_names_and_types())

    def publishes(self, topic: str) -> bool:
        """Whether somebody who is known publishes a topic."""
        return bool(self.node.count_publishers(topic))

    def wait(self, found: Callable[[], bool] = lambda: False) -> None:
        """Wait until all is known, or what is looked for is found."""
        while not (found() or self.is_settled()):
            time.sleep(_POLL_S)


@contextmanager
def graph_of(name: str) -> Iterator[Graph]:
    """Yield the ROS graph as a node of this name learns it."""
    discover_on("this")
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, start_parameter_services=False, enable_rosout=False)
    graph = Graph(node)
    try:
        yield graph
    finally:
        graph.close()
        node.destroy_node()
        rclpy.try_shutdown()


def spin_node(node: Node, until: Future | None = None) -> None:
    """Spin a node until something is done or a signal arrives."""
    spin(rclpy.get_default_context(), [node], until)


def message_class_of(graph: Graph, topic: str) -> Any:
    """Message class of a topic, None if nobody publishes it."""
    graph.wait(lambda: graph.publishes(topic))
    types = graph.topics().get(topic)
    return message_class(types[0]) if types and graph.publishes(topic) else None


def like_publisher(node: Node, topic: str) -> QoSProfile:
    """Profile that every publisher of a topic is compatible with, latched if it is."""
    from rail_msgs_py.topics.qos import LATCHED

    from .topic_kinds import kind_of

    offers = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    kind = kind_of(topic)
    # Of estimates only the present is wanted, though their past is kept.
    latched = kind is None or kind.qos is LATCHED
    latched &= all(o.durability == DurabilityPolicy.TRANSIENT_LOCAL for o in offers)
    reliable = all(offer.reliability == ReliabilityPolicy.RELIABLE for offer in offers)
    return QoSProfile(
        depth=100,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
