"""The nodes of axle counters, and their part of the world."""

from __future__ import annotations

from dataclasses import asdict

from axle_counter.world.description import (
    MissedAxlesAct,
    RailBrakeAct,
    SensorPlace,
    WheelSensorDescription,
)
from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario

from .placement import layout_of
from .section import AXLE_COUNTERS, AxleCounterPlan, MissedAxles, RailBrake
from .truth import empty_at_start


def axle_counter_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Medium, detection points and evaluator; none without the section."""
    plan = AXLE_COUNTERS.of(scenario)
    if plan is None:
        return []
    sensor = asdict(plan.sensor)
    points = [
        NodeSpec("detection_point", f"/wayside/{point.name}/wheel_sensor", "wayside", dict(sensor))
        for point in layout_of(scenario).points
    ]
    evaluator = NodeSpec(
        "axle_evaluator", "/wayside/axle_counter", "wayside", _evaluator(scenario, plan, context)
    )
    return [context.medium("wheel_sensor_medium"), *points, evaluator]


def _evaluator(
    scenario: Scenario, plan: AxleCounterPlan, context: PlanContext
) -> dict[str, object]:
    sections = layout_of(scenario).sections
    borders = [(each.name, point, way) for each in sections for point, way in each.borders]
    return {
        "sections": tuple(section.name for section in sections),
        "border_sections": tuple(section for section, _, _ in borders),
        "border_points": tuple(point for _, point, _ in borders),
        "border_inward": tuple(way for _, _, way in borders),
        "reset": plan.reset,
        "reset_sections": tuple(reset.section for reset in plan.resets),
        "reset_times_s": tuple(reset.at_s for reset in plan.resets),
        "empty_at_start": empty_at_start(scenario, plan),
        # After the medium has given up, before the world does.
        "timeout_s": 3 * context.timeout_s / 5,
    }


def sensors_of(scenario: Scenario) -> WheelSensorDescription | None:
    """What the medium knows, None without the section."""
    plan = AXLE_COUNTERS.of(scenario)
    if plan is None:
        return None
    return WheelSensorDescription(
        sensor=plan.sensor,
        places=tuple(
            SensorPlace(point=point.name, track=point.track, at_m=point.at_m)
            for point in layout_of(scenario).points
        ),
        cars=plan.cars,
        sample_rate_hz=plan.sample_rate_hz,
        noise_v=plan.noise_v,
        missed_axles=tuple(
            MissedAxlesAct(**fault.model_dump())
            for fault in scenario.faults
            if isinstance(fault, MissedAxles)
        ),
        rail_brakes=tuple(
            RailBrakeAct(**fault.model_dump())
            for fault in scenario.faults
            if isinstance(fault, RailBrake)
        ),
    )
