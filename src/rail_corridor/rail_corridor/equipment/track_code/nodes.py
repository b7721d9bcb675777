"""The nodes of track codes: the rails, the circuits, receiver and supervision of each train."""

from __future__ import annotations

from typing import Any

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.quantities import CLAIM_SIGMAS
from rail_msgs_py.track_code.quantities import PROFILE

from .placement import Circuit, circuits_of
from .section import TRACK_CIRCUITS, TrackCircuitPlan


def code_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of the track circuits and of the trains that obey them; none without circuits."""
    plan, timeout_s = TRACK_CIRCUITS.of(scenario), context.timeout_s
    if plan is None:
        return []
    nodes = [context.medium("rail_medium")]
    for circuit in circuits_of(scenario):
        parameters = _transmitter(scenario, plan, circuit, timeout_s / 5)
        name = f"/wayside/{circuit.name}/track_code"
        nodes.append(NodeSpec("track_code_transmitter", name, "wayside", parameters))
    for described in scenario.trains:
        train = described.name
        receiver = {
            "profile": PROFILE.default,
            "carriers_hz": plan.carriers_hz,
            "sample_rate_hz": plan.sample_rate_hz,
        }
        supervision = {
            "braking_mps2": plan.braking_mps2,
            "odometer_error": CLAIM_SIGMAS.default * plan.odometer_error,
            "direction": described.direction,
            "timeout_s": 3 * timeout_s / 5,
            **context.offers("code_supervision", scenario, train),
        }
        nodes += [
            NodeSpec("track_code_receiver", f"/{train}/track_code", "onboard", receiver),
            NodeSpec("code_supervision", f"/{train}/code_supervision", "onboard", supervision),
        ]
    return nodes


def _transmitter(
    scenario: Scenario, plan: TrackCircuitPlan, circuit: Circuit, timeout_s: float
) -> dict[str, Any]:
    ahead = circuits_ahead(scenario, plan, circuit)
    row = [circuit, *ahead]
    return {
        "profile": PROFILE.default,
        "carrier_hz": circuit.carrier_hz,
        "sample_rate_hz": plan.sample_rate_hz,
        "tick_s": scenario.tick_s,
        "ahead": tuple(c.name for c in ahead),
        "lengths_m": tuple(c.length_m for c in row),
        "limits_mps": tuple(c.limit_mps for c in row),
        "gradients_permil": tuple(c.gradient_permil for c in row),
        "braking_mps2": plan.braking_mps2,
        "clear_level_db": -plan.attenuation_db_per_km * circuit.length_m / 1000.0,
        "timeout_s": timeout_s,
    }


def circuits_ahead(scenario: Scenario, plan: TrackCircuitPlan, circuit: Circuit) -> list[Circuit]:
    """Circuits that matter to the code of one: as far as the fastest train needs to stop, twice."""
    fastest_mps = max(c.limit_mps for c in circuits_of(scenario))
    enough_m = fastest_mps**2 / plan.braking_mps2
    ahead, covered_m = [], 0.0
    for other in circuits_of(scenario):
        if other.track != circuit.track or other.start_m < circuit.end_m - 1e-6:
            continue
        ahead.append(other)
        covered_m += other.length_m
        if covered_m > enough_m and len(ahead) >= 3:
            break
    return ahead
