"""The nodes of track codes: the rails, the circuits, receiver and supervision of each train."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.subsystem import PlanContext
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.quantities import CLAIM_SIGMAS
from rail_msgs_py.track_code.quantities import PROFILE
from rail_signals.track_code.scales import GRAVITY_MPS2, CodeScales
from rail_wayside.track_code.code_logic import Block, CodeLogic
from rail_world.trains.vehicle import Vehicle

from .line_speeds import speeds_of
from .placement import Circuit, circuits_of
from .section import TRACK_CIRCUITS, TrackCircuitPlan

#: The most that curves add to the resistance of a train [m/s^2].
CURVES_MPS2: Final = 0.15
#: A code in its own circuit is no farther than this below the least level on dry ballast [dB].
OWN_MARGIN_DB: Final = 6.0
#: The level of what can be decoded is its own to so much: noise and lines are weaker [dB].
DECODING_DB: Final = 3.0


def code_nodes(scenario: Scenario, context: PlanContext) -> list[NodeSpec]:
    """Nodes of the track circuits and of the trains that obey them; none without circuits."""
    plan, timeout_s = TRACK_CIRCUITS.of(scenario), context.timeout_s
    if plan is None:
        return []
    nodes = [context.medium("rail_medium")]
    circuits = circuits_of(scenario)
    speeds_kmh = speeds_of(scenario)
    for circuit in circuits:
        parameters = _transmitter(scenario, plan, circuit, timeout_s / 5)
        parameters["speeds_kmh"] = speeds_kmh
        name = f"/wayside/{circuit.name}/track_code"
        nodes.append(NodeSpec("track_code_transmitter", name, "wayside", parameters))
    for described in scenario.trains:
        train = described.name
        receiver = {
            "profile": PROFILE.default,
            "carriers_hz": plan.carriers_hz,
            "sample_rate_hz": plan.sample_rate_hz,
            "least_level_db": least_own_level_db(scenario, plan) - OWN_MARGIN_DB,
        }
        supervision = {
            "speeds_kmh": speeds_kmh,
            **_physics(scenario, described),
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


def least_own_level_db(scenario: Scenario, plan: TrackCircuitPlan) -> float:
    """Level of a code at the far end of its circuit, of the longest one, on dry ballast [dB]."""
    longest_m = max(circuit.length_m for circuit in circuits_of(scenario))
    return -plan.attenuation_db_per_km * longest_m / 1000.0


def _physics(scenario: Scenario, train: Any) -> dict[str, float]:
    """The most that brakes and traction of a train can do, with the gradients of its line."""
    vehicle = Vehicle(train.vehicle)
    steepest = 0.0
    for name in train.route:
        track = scenario.network.tracks[name]
        permil = track.gradient_permil(np.arange(0.0, track.length_m, 10.0))
        steepest = max(steepest, float(np.abs(permil).max()))
    slope_mps2 = GRAVITY_MPS2 * 1e-3 * steepest
    drag_mps2 = vehicle.running_resistance_mps2(vehicle.max_speed_mps) + CURVES_MPS2
    return {
        "most_braking_mps2": vehicle.emergency_brake_mps2 + slope_mps2 + drag_mps2,
        "most_traction_mps2": vehicle.traction_mps2(0.0) + slope_mps2,
    }


def _transmitter(
    scenario: Scenario, plan: TrackCircuitPlan, circuit: Circuit, timeout_s: float
) -> dict[str, Any]:
    ahead = circuits_ahead(scenario, plan, circuit)
    row = [circuit, *ahead]
    behind = [
        c.name
        for c in circuits_of(scenario)
        if c.track == circuit.track and c.end_m == circuit.start_m
    ]
    return {
        "profile": PROFILE.default,
        "behind": behind[0] if behind else "",
        "leaves": _leaves(scenario, circuit),
        "identity": circuit.identity,
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


def _leaves(scenario: Scenario, circuit: Circuit) -> bool:
    """Whether a train is in a circuit, with any part of it, when it leaves the line at a stop."""
    for train in scenario.trains:
        if not train.leaves_on_arrival or circuit.track not in train.route:
            continue
        track = scenario.network.tracks[circuit.track]
        stops_m = [*track.stops_m, *(stop.at_m for stop in train.stop_at_m)]
        last_m = max(stops_m, default=track.length_m)
        if circuit.start_m < last_m and circuit.end_m > last_m - train.vehicle.length_m:
            return True
    return False


def circuits_ahead(scenario: Scenario, plan: TrackCircuitPlan, circuit: Circuit) -> list[Circuit]:
    """Circuits that matter to the code of one, the nearest first.

    As far as the fastest train needs to stop, twice, and as many as the code needs to be the
    highest, all of them free.
    """
    fastest_mps = max(c.limit_mps for c in circuits_of(scenario))
    enough_m = fastest_mps**2 / plan.braking_mps2
    further = [
        other
        for other in circuits_of(scenario)
        if other.track == circuit.track and other.start_m >= circuit.end_m - 1e-6
    ]
    count, covered_m = 0, 0.0
    while count < len(further) and (covered_m <= enough_m or count < 3):
        covered_m += further[count].length_m
        count += 1
    scales = CodeScales(speeds_kmh=speeds_of(scenario))

    def speed(ahead: int) -> int:
        row = [circuit, *further[:ahead]]
        blocks = [Block(c.length_m, c.limit_mps, c.gradient_permil) for c in row]
        logic = CodeLogic(blocks, braking_mps2=plan.braking_mps2, scales=scales)
        return logic.fields([False] * ahead)["speed"]

    # No code needs more: a step of the table takes a block, and one is kept free.
    most = min(len(further), len(scales.speeds_kmh) + 1)
    while count < most and speed(count) < speed(most):
        count += 1
    return further[:count]
