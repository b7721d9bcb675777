"""The nodes of the localizer: one on each train."""

from __future__ import annotations

from typing import Any

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario
from rail_world.trains.description import TrainDescription

from .section import LOCALIZER_SECTION, LocalizerPlan


def localizer_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """A localizer for every train; none without the section."""
    plan = LOCALIZER_SECTION.of(scenario)
    if plan is None:
        return []
    return [
        NodeSpec(
            "localizer",
            f"/{train.name}/localizer",
            "onboard",
            _localizer(scenario, plan, train, context)
            | context.offers("localizer", scenario, train.name),
        )
        for train in scenario.trains
    ]


def _localizer(
    scenario: Scenario, plan: LocalizerPlan, train: TrainDescription, context: PlanContext
) -> dict[str, Any]:
    supervision = context.supervision(scenario)
    wheels = plan.odometer_error if supervision is None else supervision.odometer_error
    return {
        "track": train.route[0],
        "direction": train.direction,
        "start_m": train.start_m,
        "odometer_scale": max(plan.odometer_error, wheels),
        "integrity_risk": plan.integrity_risk,
        "oldest_s": max(1.5, 6.0 * scenario.tick_s),
        "tick_s": scenario.tick_s,
        "timeout_s": 5 * context.timeout_s / 10,
    }
