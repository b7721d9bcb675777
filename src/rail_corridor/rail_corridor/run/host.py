"""One process of a corridor: makes its nodes and spins them until told to stop."""

from __future__ import annotations

import gc
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.registry import node_kinds
from rail_signals.compiled import preload_kernels

if TYPE_CHECKING:
    from rail_msgs_py.tap import Tap

#: With more nodes than this in a process the services are left out until somebody asks for them.
MOST_NODES_WITH_SERVICES = 24
#: Wall time for a process to end in order once its launcher has gone.
_ORPHANED_S = 3.0


def load_for_nodes(kinds: Iterable[str]) -> None:
    """Load what nodes of some kinds need, once for all processes that are forked after it.

    Of each process by itself it would take half a second.
    """
    from rcl_interfaces.msg import ParameterEvent
    from rclpy.type_support import check_for_type_support

    from rail_msgs_py.topics.tick import TOPICS

    for kind in kinds:
        node_kinds()[kind].load()
    for message in (ParameterEvent, *(topic.type for topic in TOPICS)):
        check_for_type_support(message)
    preload_kernels()
    # The collector does not look through it again, nor make each process its own copy of it.
    gc.collect()
    gc.freeze()
    gc.enable()  # `rail` loads without it


def make_node(spec: NodeSpec, context: Any, services: Any) -> Any:
    """Create a node; equipment is switched on."""
    namespace, _, name = spec.name.rpartition("/")
    node = node_kinds()[spec.kind].load()(
        name,
        namespace=namespace,
        context=context,
        parameters=spec.parameters,
        services=services,
    )
    if hasattr(node, "switch_on"):
        node.switch_on()
    return node


def make_nodes(
    specs: Sequence[NodeSpec],
    context: Any,
    *,
    switches: bool = False,
    until: Callable[[], bool] = lambda: False,
) -> list[Any]:
    """Create the nodes of one process; many of them go without services.

    With ``switches`` they keep those that switch equipment off and on. Once ``until`` says so
    no more are made.
    What is there by then stays: no need to look through it for garbage again.
    """
    services: Any = len(specs) <= MOST_NODES_WITH_SERVICES or (switches and "switches")
    nodes = []
    for spec in specs:
        if until():
            break
        nodes.append(make_node(spec, context, services))
    gc.collect()
    gc.freeze()
    return nodes


def run_nodes(
    specs: Sequence[NodeSpec],
    tap: Tap | None = None,
    *,
    switches: bool = False,
    report_reads: frozenset[str] = frozenset(),
) -> None:
    """Make nodes in this process and spin them until SIGTERM.

    Parameters
    ----------
    specs : sequence of NodeSpec
    tap : Tap, optional
        Is told of everything that they publish.
    switches : bool
        As of `make_nodes`.
    report_reads : frozenset of str
        Names of the topics that a report in another process reads: its ear must be open before
        their nodes are ready.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from rail_msgs_py.standalone import spin

    context = make_context(tap, report_reads)
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = make_nodes(specs, context, switches=switches)
    try:
        spin(context, nodes)
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=context)


def destroy_nodes(nodes: Iterable[Any], within_s: float) -> bool:
    """Destroy nodes, as many as can be in a time; whether that was all of them.

    The middleware looks for the counterparts of each publisher and subscription among all those of
    the process: some thousands of them take several seconds.
    """
    deadline_s = time.monotonic() + within_s
    for node in nodes:
        if time.monotonic() > deadline_s:
            return False
        node.destroy_node()
    return True


def make_context(tap: Tap | None, report_reads: frozenset[str] = frozenset()) -> Any:
    """Context of the nodes of a process; ``report_reads`` as of `CorridorContext`."""
    from rail_msgs_py.context import CorridorContext

    return CorridorContext(tap, report_reads)


def die_with(lifeline: int) -> None:
    """End this process when the other end of a pipe closes, however the launcher ended.

    If that was a kill, the middleware may wait for a lock that it held (Fast DDS issue 6485): then
    this one goes without taking leave.
    """

    def watch() -> None:
        os.read(lifeline, 1)
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_ORPHANED_S)
        os.kill(os.getpid(), signal.SIGKILL)

    threading.Thread(target=watch, daemon=True).start()
