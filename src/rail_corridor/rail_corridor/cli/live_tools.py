"""Looking into a running corridor: ``rail topics``, ``rail echo``, ``rail hz``."""

from __future__ import annotations

import importlib
import math
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rich.console import Console

from rail_corridor.equipment.registry import kind_of
from rail_corridor.middleware.discovery import discover_on
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.standalone import spin
from rail_msgs_py.topics.qos import LATCHED
from rail_msgs_py.topics.world import STATE

from .decoded import decode, raw_text

#: Wall time for discovery to show what is there.
DISCOVERY_S = 15.0
#: ... and without anything new for this long, that is all.
SETTLED_S = 4.0
_POLL_S = 0.05
_WINDOW = 200


@contextmanager
def _node(name: str) -> Iterator[Node]:
    discover_on("this")
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node(name, start_parameter_services=False, enable_rosout=False)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _spin(node: Node, until: Future | None = None) -> None:
    spin(rclpy.get_default_context(), [node], until)


def _when(node: Node, condition: Callable[[], bool], limit_s: float) -> bool:
    """Spin until a condition holds; False if it did not within the limit."""
    done = Future()
    deadline_s = time.monotonic() + limit_s

    def poll() -> None:
        if not done.done() and (condition() or time.monotonic() > deadline_s):
            done.set_result(None)

    timer = node.create_timer(_POLL_S, poll)
    _spin(node, done)
    node.destroy_timer(timer)
    return condition()


class _Graph:
    """Topics of a corridor, as they become known."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.topics: dict[str, list[str]] = {}
        self._since_s = time.monotonic()

    def is_settled(self) -> bool:
        """Look again: whether there is a corridor, and nothing new for a while."""
        before = len(self.topics)
        self.topics = dict(self._node.get_topic_names_and_types())
        if len(self.topics) != before:
            self._since_s = time.monotonic()
        there = STATE.name() in self.topics  # the clock may be somebody else's
        return there and time.monotonic() - self._since_s > SETTLED_S


def list_topics() -> int:
    """Show the topics of the running corridor; returns the exit code."""
    console = Console()
    with _node("rail_topics") as node:
        known = _Graph(node)
        if not _when(node, known.is_settled, DISCOVERY_S):
            console.print("no corridor is running on this host and ROS_DOMAIN_ID")
            return 1
    rows = [
        (name, ", ".join(types), kind.text)
        for name, types in sorted(known.topics.items())
        if (kind := kind_of(name)) is not None
    ]
    # One line each, whatever the width of the terminal: for grep as well as for the eye.
    wide = [max(len(row[column]) for row in rows) for column in range(2)]
    for name, types, text in rows:
        console.print(
            f"{name:{wide[0]}}  {types:{wide[1]}}  {text}", soft_wrap=True, highlight=False
        )
    return 0


def _find(node: Node, topic: str) -> Any:
    """Message class of a topic, None if nobody publishes it."""
    graph = _Graph(node)

    def published() -> bool:
        return topic in graph.topics and node.count_publishers(topic) > 0

    _when(node, lambda: graph.is_settled() or published(), DISCOVERY_S)
    if not published():
        return None
    matches = graph.topics[topic]
    package, _, name = matches[0].partition("/msg/")
    return getattr(importlib.import_module(f"{package}.msg"), name)


def _like_publisher(node: Node, topic: str) -> QoSProfile:
    """Profile that every publisher of a topic is compatible with, latched if it is."""
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


def echo_topic(topic: str, *, once: bool, raw: bool) -> int:
    """Show messages; returns the exit code."""
    console = Console(soft_wrap=True, highlight=False)
    with _node("rail_echo") as node:
        kind = _find(node, topic)
        if kind is None:
            return _nobody(topic)
        done = Future()

        def show(message: Any) -> None:
            if done.done():
                return
            console.print(raw_text(message) if raw else decode(topic, message), markup=False)
            if once:
                done.set_result(None)

        node.create_subscription(kind, topic, show, _like_publisher(node, topic))
        _spin(node, done)
    return 0


def topic_rate(topic: str) -> int:
    """Show how often messages come; returns the exit code."""
    console = Console(highlight=False)
    with _node("rail_hz") as node:
        kind = _find(node, topic)
        if kind is None:
            return _nobody(topic)
        arrivals: deque[float] = deque(maxlen=_WINDOW)
        stamps: deque[float] = deque(maxlen=_WINDOW)
        counted = {"shown": 0, "all": 0}

        def count(message: Any) -> None:
            arrivals.append(time.monotonic())
            stamp_s = stamp_of(message)
            if stamp_s is not None:
                stamps.append(stamp_s)
            counted["all"] += 1

        def show() -> None:
            if counted["all"] == counted["shown"]:
                console.print("no new messages")
                return
            counted["shown"] = counted["all"]
            line = f"{_rate(arrivals):.1f} Hz of wall time"
            if len(stamps) > 1:
                line += f", {_rate(stamps):.1f} Hz of simulated time"
            console.print(line)

        node.create_subscription(kind, topic, count, _like_publisher(node, topic))
        node.create_timer(1.0, show)
        _spin(node)
    return 0


def stamp_of(message: Any) -> float | None:
    """Simulated time [s] that a message carries, None if it carries none."""
    header = getattr(message, "header", None)
    stamp = getattr(message, "clock", getattr(header, "stamp", getattr(message, "stamp", None)))
    if stamp is not None:
        return to_ns(stamp) * 1e-9
    layout = getattr(message, "layout", None)
    if layout is not None and layout.data_offset > 0 and len(message.data) > 0:
        return float(message.data[0])
    return None


def _rate(times_s: deque[float]) -> float:
    span_s = times_s[-1] - times_s[0]
    return (len(times_s) - 1) / span_s if span_s > 0.0 else math.nan


def _nobody(topic: str) -> int:
    import sys

    print(f"rail: {topic}: nobody publishes it; `rail topics` lists what there is", file=sys.stderr)
    return 1
