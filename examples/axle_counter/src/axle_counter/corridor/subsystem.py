"""Axle counters as the corridor sees them: what the entry point names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from rich.console import RenderableType

from axle_counter import topics
from axle_counter.topics import PASSAGES, SECTIONS
from rail_corridor.equipment.node_spec import NodeKind, NodeSpec
from rail_corridor.equipment.subsystem import PlanContext, Subsystem
from rail_corridor.run_data import RecordSpec, RunData, in_one_message
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE
from rail_world.line.description_base import Description

from .checks import check_axle_counters
from .live import AxleCounterView
from .nodes import axle_counter_nodes, sensors_of
from .placement import layout_of
from .report import axle_counter_metrics, axle_counter_tables
from .section import AXLE_COUNTERS, MissedAxles, RailBrake


class AxleCounter(Subsystem):
    """Wheel sensors at the borders of sections, and what counts between them."""

    name = "axle_counter"
    sections = (AXLE_COUNTERS,)
    faults = (MissedAxles, RailBrake)
    nodes = (
        NodeKind(
            "wheel_sensor_medium",
            "axle_counter.world.medium_node:WheelSensorMediumNode",
            sink=True,
            waits=True,
            reads=(STATE,),
        ),
        NodeKind("detection_point", "axle_counter.wayside.detection_point_node:DetectionPointNode"),
        NodeKind(
            "axle_evaluator",
            "axle_counter.wayside.evaluator_node:AxleEvaluatorNode",
            clocked=True,
            sink=True,
            waits=True,
        ),
    )
    hazards = ("axle_counter.free_while_occupied_ticks",)
    topics = topics.TOPICS
    scenarios = Path(__file__).parents[1] / "scenarios"

    def check(self, scenario: Scenario, train_fields: Sequence[str]) -> None:
        """See `Subsystem.check`."""
        check_axle_counters(scenario, train_fields)

    def plan(self, scenario: Scenario, context: PlanContext) -> Sequence[NodeSpec]:
        """See `Subsystem.plan`."""
        return axle_counter_nodes(scenario, context)

    def world(self, scenario: Scenario) -> Mapping[str, Description]:
        """See `Subsystem.world`."""
        described = sensors_of(scenario)
        return {} if described is None else {self.name: described}

    def announcement(self, scenario: Scenario) -> Mapping[str, Any]:
        """Detection points with their places, and the sections between them."""
        if not self.present(scenario):
            return {}
        layout = layout_of(scenario)
        points = [vars(point) for point in layout.points]
        sections = [
            {"name": each.name, "spans": [vars(span) for span in each.spans]}
            for each in layout.sections
        ]
        return {self.name: {"points": points, "sections": sections}}

    def summary(self, scenario: Scenario) -> Iterable[RenderableType]:
        """See `Subsystem.summary`."""
        for section in layout_of(scenario).sections:
            spans = ", ".join(f"{p.track} {p.start_m:.0f}..{p.end_m:.0f} m" for p in section.spans)
            borders = ", ".join(point for point, _ in section.borders)
            yield f"section {section.name}: {spans}, between {borders}"

    def records(self, scenario: Scenario) -> Sequence[RecordSpec]:
        """What detection points have seen, and what is said of the sections."""
        layout = layout_of(scenario)
        if not layout.points:
            return ()
        return (
            RecordSpec(PASSAGES, {point.name: {"point": point.name} for point in layout.points}),
            RecordSpec(SECTIONS, in_one_message(section.name for section in layout.sections)),
        )

    def run_report(self, scenario: Scenario, data: RunData) -> dict[str, Any]:
        """See `Subsystem.run_report`."""
        return axle_counter_metrics(scenario, data)

    def tables(self, report: Mapping[str, Any]) -> Iterable[RenderableType]:
        """See `Subsystem.tables`."""
        return axle_counter_tables(report)

    def live(self) -> AxleCounterView:
        """See `Subsystem.live`."""
        return AxleCounterView()


AXLE_COUNTER: Final = AxleCounter()
