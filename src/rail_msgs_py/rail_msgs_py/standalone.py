"""Running one node, or many, on one events executor until told to stop."""

from __future__ import annotations

import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from .namesakes import NameTakenError, sole_bearer
from .parameters import ParameterError

# In these wheels the events executor fires no callback without a finite time-out.
FOREVER_S = 1e6


def spin(context: Any, nodes: Iterable[Any], until: Future | None = None) -> int:
    """Spin nodes on one events executor until ``until`` is done or a signal arrives.

    Returns
    -------
    int
        Number of the signal that ended it, 0 if none did.
    """
    executor = EventsExecutor(context=context)
    stop = until if until is not None else Future()
    received: list[int] = []

    def on_signal(number: int) -> None:
        received.append(number)
        if not stop.done():
            stop.set_result(None)

    for node in nodes:
        executor.add_node(node)
    delivery = getattr(context, "delivery", None)
    if delivery is not None:
        delivery.settle(executor)
    try:
        with signals_to(on_signal):
            executor.spin_until_future_complete(stop, timeout_sec=FOREVER_S)
    except ExternalShutdownException:
        pass
    finally:
        executor.shutdown()
    return received[0] if received else 0


@contextmanager
def signals_to(handle: Callable[[int], None]) -> Iterator[None]:
    """Call ``handle`` for SIGINT and SIGTERM, from a thread of its own.

    The executor waits outside Python, where an ordinary handler would not run until the next
    message comes.
    """
    numbers = {signal.SIGINT, signal.SIGTERM}
    # Python writes the number of each signal here as it arrives, whatever the main thread does.
    read_end, write_end = socket.socketpair()
    write_end.setblocking(False)
    # In this order: a signal in between ends the process, and is not lost.
    previous_fd = signal.set_wakeup_fd(write_end.fileno(), warn_on_full_buffer=False)
    previous = {number: signal.signal(number, lambda *_: None) for number in numbers}

    def watch() -> None:
        while received := read_end.recv(1):
            handle(received[0])

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(previous_fd)
        for number, handler in previous.items():
            signal.signal(number, handler)
        write_end.close()
        thread.join()
        read_end.close()


def run_node(make: Callable[[], Any]) -> None:
    """Entry point of a node on its own: arguments, spinning, a clean end.

    Wrong arguments or parameters, and a name that another node has, end with one line and exit
    code 2.
    """
    try:
        _init()
        with ExitStack() as held:
            node = make()
            held.callback(node.destroy_node)
            held.enter_context(sole_bearer(node))
            if hasattr(node, "switch_on"):
                node.switch_on()
            spin(rclpy.get_default_context(), [node])
    except (ParameterError, NameTakenError, ValueError, OSError) as error:
        print(str(error).splitlines()[0], file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        rclpy.try_shutdown()


def _init() -> None:
    """Initialise ROS with the arguments of the command line; ValueError if it takes them not."""
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:  # RCLError and others, which rclpy does not export
        # It appends where in its own sources it noticed.
        reason = str(error).partition(", at /")[0]
        unknown = type(error).__name__ == "UnknownROSArgsError"
        raise ValueError(f"unknown ROS arguments {reason}" if unknown else reason) from None
