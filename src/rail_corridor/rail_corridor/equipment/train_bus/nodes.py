"""The nodes of the train buses: the medium, and on each train two terminals and the monitor."""

from __future__ import annotations

import math
from typing import Any, Final

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario

from .section import TRAIN_BUS_SECTION, BusPlan
from .world import bus_consist, bus_trains, longest_delay_s

BUS_MEDIUM: Final = "/world/bus_medium"
#: A block larger than shared memory has room for goes slowly or not at all [bytes].
_LARGEST_BLOCK: Final = 400_000
_BYTES_PER_SAMPLE: Final = 16


def bus_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of the train buses; none without them."""
    plan, timeout_s = TRAIN_BUS_SECTION.of(scenario), context.timeout_s
    if plan is None:
        return []
    nodes = [context.medium("bus_medium")]
    trains = bus_trains(scenario)
    for number, train in enumerate(trains):
        for end in ("head", "tail"):
            parameters = _terminal(scenario, plan, end, 3 * timeout_s / 5)
            parameters["protected"] = end == "head" and _has_protection(scenario, context)
            nodes.append(NodeSpec("bus_terminal", f"/{train}/bus_{end}", "onboard", parameters))
        parameters = _monitor(scenario, plan, number / len(trains), 3 * timeout_s / 5)
        name = f"/{train}/train_bus_monitor"
        nodes.append(NodeSpec("train_bus_monitor", name, "onboard", parameters))
    return nodes


def _has_protection(scenario: Scenario, context: PlanContext) -> bool:
    """Whether trains have a protection that reports them."""
    supervision = context.supervision(scenario)
    return supervision is not None and supervision.node == "atp"


def most_traces(plan: BusPlan) -> int:
    """Traces of a measurement that fit into one block."""
    # Loaded where it is wanted: it takes longer than all of a scenario.
    from rail_signals.train_bus.tdr.reflectometer import Reflectometer

    consist = bus_consist(plan)
    rise_s = plan.reflectometer_rise_s
    instrument = Reflectometer(rise_time_s=rise_s, sample_period_s=rise_s / 4.0)
    samples = instrument.samples_for(consist.bus_line().delay_s)
    return _LARGEST_BLOCK // (_BYTES_PER_SAMPLE * samples)


def _terminal(scenario: Scenario, plan: BusPlan, end: str, timeout_s: float) -> dict[str, Any]:
    return {
        "end": end,
        "bit_rate_hz": plan.bit_rate_hz,
        "samples_per_bit": plan.samples_per_bit,
        "rise_time_s": plan.rise_time_s,
        "longest_delay_s": longest_delay_s(bus_consist(plan)),
        "answer_timeout_s": plan.answer_timeout_s,
        "medium": BUS_MEDIUM,
        "tick_s": scenario.tick_s,
        "timeout_s": timeout_s,
    }


def _monitor(
    scenario: Scenario, plan: BusPlan, fraction: float, timeout_s: float
) -> dict[str, Any]:
    # Trains measure one after the other, not all in one tick.
    ticks = math.floor(fraction * plan.period_s / scenario.tick_s)
    return {
        "cars": plan.cars,
        "period_s": plan.period_s,
        "offset_s": ticks * scenario.tick_s,
        "traces": min(plan.traces, most_traces(plan)),
        "rise_time_s": plan.reflectometer_rise_s,
        "noise_rms": plan.reflectometer_noise,
        "medium": BUS_MEDIUM,
        "tick_s": scenario.tick_s,
        "timeout_s": timeout_s,
    }
