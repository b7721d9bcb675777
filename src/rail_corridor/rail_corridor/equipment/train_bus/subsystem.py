"""The train bus as the corridor sees it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rich.console import RenderableType

from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.subsystem import PlanContext, Subsystem
from rail_corridor.run_data import RecordSpec, RunData, in_one_message, per_train
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import train_bus as topics
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
from rail_world.line.description_base import Description

from .checks import check_bus
from .nodes import bus_nodes
from .report import bus_metrics, bus_table
from .section import TRAIN_BUS_SECTION, BusFault, TrainPartedFault
from .world import bus_description, bus_trains

_ONBOARD: Final = "rail_onboard.train_bus"


class TrainBusSubsystem(Subsystem):
    """The bus in the trains, and the reflectometer that watches its cable."""

    name = "train_bus"
    sections = (TRAIN_BUS_SECTION,)
    faults = (BusFault, TrainPartedFault)
    hazards = ("trains.*.train_bus.false_reports",)
    nodes = (
        NodeKind(
            "bus_medium",
            "rail_world.train_bus.medium_node:BusMediumNode",
            clocked=True,
            sink=True,
            waits=True,
        ),
        NodeKind(
            "bus_terminal", f"{_ONBOARD}.terminal_node:BusTerminalNode", clocked=True, waits=True
        ),
        NodeKind(
            "train_bus_monitor",
            f"{_ONBOARD}.monitor_node:TrainBusMonitorNode",
            clocked=True,
            waits=True,
        ),
    )
    topics = topics.TOPICS

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_bus(scenario)

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return bus_nodes(scenario, context)

    def offer(self, kind: str, scenario: Scenario, train: str) -> Mapping[str, Any]:
        """Train protection learns that the bus tells whether the train is whole."""
        return {"bus": True} if kind == "atp" and train in bus_trains(scenario) else {}

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        described = bus_description(scenario)
        return {} if described is None else {"train_bus": described}

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """Frames at both ends, what the monitor believes, and the truth of the links."""
        trains = bus_trains(scenario)
        if not trains:
            return ()
        return (
            RecordSpec(BUS_LINK, per_train(trains, end="head"), key="head"),
            RecordSpec(BUS_LINK, per_train(trains, end="tail"), key="tail"),
            RecordSpec(BUS_STATE, per_train(trains)),
            RecordSpec(BUS_LINKS, in_one_message(trains), estimated=False, awaited=False),
        )

    def train_report(self, scenario: Scenario, data: RunData, train: int) -> dict[str, Any]:
        """See `Subsystem.train_report`."""
        trains = bus_trains(scenario)
        name = data.trains[train]
        return bus_metrics(scenario, data, trains.index(name)) if name in trains else {}

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        table = bus_table(report["trains"])
        if table is not None:
            yield table

    def live(self) -> LiveView:
        """See `Subsystem.live`."""
        from .cards import TrainBusView  # wanted by the live page only

        return TrainBusView()


TRAIN_BUS: Final = TrainBusSubsystem()
