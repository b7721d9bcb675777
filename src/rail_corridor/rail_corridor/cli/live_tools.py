"""Looking into a running corridor: ``rail topics``, ``rail echo``, ``rail hz``."""

from __future__ import annotations

import math
import os
import sys
import time
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy.task import Future

from .graph import Graph, graph_of, like_publisher, message_class_of, spin_node

if TYPE_CHECKING:
    from .selection import Selection

_WINDOW = 200


def list_topics() -> int:
    """Show the topics of the running corridor; returns the exit code."""
    with graph_of("rail_topics") as graph:
        # Loaded while discovery goes on, which takes about as long.
        from rail_msgs_py.topics import tick

        from .topic_kinds import kind_of

        graph.wait()
        topics = sorted(graph.topics().items())
    rows = [
        (name, ", ".join(types), kind)
        for name, types in topics
        if (kind := kind_of(name)) is not None
    ]
    # The clock and the like may be somebody else's.
    if all(kind in tick.TOPICS for _, _, kind in rows):
        print("no corridor is running on this host and ROS_DOMAIN_ID")
        return 1
    # One line each, whatever the width of the terminal: for grep as well as for the eye.
    widest_name = max(len(name) for name, _, _ in rows)
    widest_type = max(len(types) for _, types, _ in rows)
    lines = [
        f"{name:{widest_name}}  {types:{widest_type}}  {kind.text}" for name, types, kind in rows
    ]
    print_line("\n".join(lines))
    return 0


def echo_topic(topic: str, selection: Selection) -> int:
    """Show messages; returns the exit code.

    Raises
    ------
    UsageError
        If a message has not the fields that are wanted.
    """
    done = Future()

    def write(text: str) -> None:
        if not print_line(text) and not done.done():
            done.set_result(None)

    with graph_of("rail_echo") as graph:
        # Loaded while discovery goes on, which takes about as long.
        from .echo import Echo, column_lines

        echo = Echo(topic, selection, write)

        def begin() -> None:
            # Not among the messages, which may be read by another program.
            if selection.format == "text" and not selection.raw:
                for line in column_lines(topic, selection.fields):
                    print(line, file=sys.stderr)

        return read_topic(graph, topic, echo.take, lambda: echo.complete, done, begin)


def read_topic(
    graph: Graph,
    topic: str,
    take: Callable[[Any], None],
    complete: Callable[[], bool],
    done: Future,
    begin: Callable[[], None] = lambda: None,
) -> int:
    """Hand over the messages of a topic until enough have come; returns the exit code.

    ``begin`` is called before the first, once the topic is known.
    """
    errors: list[Exception] = []
    code = subscribe(graph, topic, take, complete, done, errors)
    if code:
        return code
    begin()
    spin_node(graph.node, done)
    if errors:
        raise errors[0]
    return 0


def subscribe(
    graph: Graph,
    topic: str,
    take: Callable[[Any], None],
    complete: Callable[[], bool],
    done: Future,
    errors: list[Exception],
) -> int:
    """Have the messages of a topic handed over; returns the exit code.

    Parameters
    ----------
    graph : Graph
    topic : str
        Absolute name; if nobody publishes it, that is said.
    take : callable of a message
        What it raises is put into ``errors``, and nothing more is handed over.
    complete : callable
        Whether enough have come.
    done : Future
        Set then.
    errors : list of Exception
    """
    kind = message_class_of(graph, topic)
    if kind is None:
        line = "nobody publishes it; `rail topics` lists what there is"
        print(f"rail: {topic}: {line}", file=sys.stderr)
        return 1

    def on_message(message: Any) -> None:
        if done.done():
            return
        try:
            take(message)
        except Exception as error:  # the executor would print it and go on
            errors.append(error)
        if (errors or complete()) and not done.done():
            done.set_result(None)

    graph.node.create_subscription(kind, topic, on_message, like_publisher(graph.node, topic))
    return 0


def topic_rate(topic: str) -> int:
    """Show how often messages come; returns the exit code."""
    from .fields import stamp_of

    done = Future()
    with graph_of("rail_hz") as graph:
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
            line = "no new messages"
            if counted["all"] != counted["shown"]:
                counted["shown"] = counted["all"]
                line = f"{_rate(arrivals):.1f} Hz of wall time"
                if len(stamps) > 1:
                    line += f", {_rate(stamps):.1f} Hz of simulated time"
            if not print_line(line) and not done.done():
                done.set_result(None)

        graph.node.create_timer(1.0, show)
        return read_topic(graph, topic, count, lambda: False, done)


def _rate(times_s: deque[float]) -> float:
    span_s = times_s[-1] - times_s[0]
    return (len(times_s) - 1) / span_s if span_s > 0.0 else math.nan


def print_line(text: str) -> bool:
    """Print at once; whether somebody reads on: a pipe that has closed is no error."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        # Nor when Python flushes the stream at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return False
    return True
