"""Running one node, or many, on one events executor until told to stop."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterable
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from rail_msgs_py.parameters import ParameterError

# In these wheels the events executor fires no callback without a finite time-out.
FOREVER_S = 1e6


def spin(context: Any, nodes: Iterable[Any], until: Future | None = None) -> None:
    """Spin nodes on one events executor until ``until`` is done or a signal arrives."""
    executor = EventsExecutor(context=context)
    stop = until if until is not None else Future()

    def on_signal(number: int, frame: Any) -> None:
        if not stop.done():
            stop.set_result(None)
        executor.wake()

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, on_signal)
    for node in nodes:
        executor.add_node(node)
    try:
        executor.spin_until_future_complete(stop, timeout_sec=FOREVER_S)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.shutdown()


def run_node(make: Callable[[], Any]) -> None:
    """Entry point of a node on its own: arguments, spinning, a clean end.

    Wrong parameters end with one line and exit code 2.
    """
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = make()
    except (ParameterError, ValueError, OSError) as error:
        print(str(error).splitlines()[0], file=sys.stderr)
        rclpy.shutdown()
        sys.exit(2)
    if hasattr(node, "switch_on"):
        node.switch_on()
    try:
        spin(rclpy.get_default_context(), [node])
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
