"""One process of a corridor: makes its nodes and spins them until told to stop."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import threading
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rail_corridor.equipment.node_spec import NodeSpec

if TYPE_CHECKING:
    from rail_msgs_py.tap import Tap

#: Kind of node -> module and class; the ament packages name the same modules.
NODE_CLASSES = {
    "world": ("rail_world.world_node", "WorldNode"),
    "radio_medium": ("rail_world.ranging.medium_node", "RadioMediumNode"),
    "wrs": ("rail_wayside.ranging.wrs_node", "WrsNode"),
    "zone_controller": ("rail_wayside.zone_controller_node", "ZoneControllerNode"),
    "vrs": ("rail_onboard.ranging.vrs_node", "VrsNode"),
    "rail_medium": ("rail_world.track_code.medium_node", "RailMediumNode"),
    "track_code_transmitter": (
        "rail_wayside.track_code.transmitter_node",
        "TrackCodeTransmitterNode",
    ),
    "track_code_receiver": ("rail_onboard.track_code.receiver_node", "TrackCodeReceiverNode"),
    "code_supervision": ("rail_onboard.track_code.supervision_node", "CodeSupervisionNode"),
    "cbtc_medium": ("rail_world.train_radio.medium_node", "CbtcMediumNode"),
    "backbone": ("rail_world.train_radio.backbone_node", "BackboneNode"),
    "cbtc_base_station": ("rail_wayside.train_radio.base_station_node", "CbtcBaseStationNode"),
    "cbtc_radio": ("rail_onboard.train_radio.radio_node", "CbtcRadioNode"),
    "atp": ("rail_onboard.train_radio.atp_node", "AtpNode"),
    "reference_medium": ("rail_world.doppler.medium_node", "ReferenceMediumNode"),
    "reference_station": ("rail_wayside.doppler.reference_station_node", "ReferenceStationNode"),
    "doppler_positioner": ("rail_onboard.doppler.positioner_node", "DopplerPositionerNode"),
    "localizer": ("rail_onboard.localizer.localizer_node", "LocalizerNode"),
    "bus_medium": ("rail_world.train_bus.medium_node", "BusMediumNode"),
    "bus_terminal": ("rail_onboard.train_bus.terminal_node", "BusTerminalNode"),
    "train_bus_monitor": ("rail_onboard.train_bus.monitor_node", "TrainBusMonitorNode"),
}
#: With more nodes than this in a process the services are left out.
MOST_NODES_WITH_SERVICES = 12


def node_class(kind: str) -> Any:
    """Class of a kind of node."""
    module, name = NODE_CLASSES[kind]
    return getattr(importlib.import_module(module), name)


def make_node(spec: NodeSpec, context: Any, services: Any) -> Any:
    """Create a node; equipment is switched on."""
    namespace, _, name = spec.name.rpartition("/")
    node = node_class(spec.kind)(
        name,
        namespace=namespace,
        context=context,
        parameters=spec.parameters,
        services=services,
    )
    if hasattr(node, "switch_on"):
        node.switch_on()
    return node


def make_nodes(specs: Sequence[NodeSpec], context: Any, *, switches: bool = False) -> list[Any]:
    """Create the nodes of one process; many of them go without services.

    With ``switches`` they keep those that switch equipment off and on.
    What is there by then stays: no need to look through it for garbage again.
    """
    services: Any = len(specs) <= MOST_NODES_WITH_SERVICES or (switches and "switches")
    nodes = [make_node(spec, context, services) for spec in specs]
    gc.collect()
    gc.freeze()
    return nodes


def run_nodes(specs: Sequence[NodeSpec], tap: Tap | None = None, *, switches: bool = False) -> None:
    """Make nodes in this process and spin them until SIGTERM.

    Parameters
    ----------
    specs : sequence of NodeSpec
    tap : Tap, optional
        Is told of everything that they publish.
    switches : bool
        As of `make_nodes`.
    """
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from rail_msgs_py.standalone import spin

    context = make_context(tap)
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    nodes = make_nodes(specs, context, switches=switches)
    try:
        spin(context, nodes)
    finally:
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=context)


def make_context(tap: Tap | None) -> Any:
    """Context of the nodes of a process."""
    import rclpy

    from rail_msgs_py.tap import TappedContext

    return rclpy.Context() if tap is None else TappedContext(tap)


def die_with(lifeline: int) -> None:
    """End this process when the other end of a pipe closes, however the launcher ended."""

    def watch() -> None:
        os.read(lifeline, 1)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=watch, daemon=True).start()
