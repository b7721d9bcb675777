"""What track circuits must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_signals.track_code.scales import CodeScales

from .line_speeds import allowed_kmh, holds_trains, speeds_of
from .nodes import DECODING_DB, OWN_MARGIN_DB
from .placement import circuits_of
from .section import RAIL_FAULTS, TRACK_CIRCUITS, BrokenRail, TrackCircuitPlan, WetBallast

#: The steepest fall that a code can tell.
STEEPEST_PERMIL: Final = -CodeScales().gradient_step_permil * CodeScales().gradient_zero


def check_codes(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit the track circuits."""
    plan = TRACK_CIRCUITS.of(scenario)
    for index, fault in enumerate(scenario.faults):
        if plan is None and isinstance(fault, RAIL_FAULTS):
            raise InputError(
                "goes with track_circuits, of which there are none",
                field=f"faults.{index}.kind",
                value=fault.kind,
            )
    if plan is None:
        return
    if scenario.junctions:
        raise InputError(
            "track circuits do not go with junctions yet",
            field="junctions.0.branch",
            value=scenario.junctions[0].branch,
        )
    samples = plan.sample_rate_hz * scenario.tick_s
    if abs(samples - round(samples)) > 1e-6:
        raise InputError(
            f"a tick of {scenario.tick_s:g} s is not a whole number of samples",
            field="track_circuits.sample_rate_hz",
            value=plan.sample_rate_hz,
        )
    for train, field in zip(scenario.trains, train_fields, strict=True):
        reason = "trains on track circuits run towards increasing chainage only"
        if train.direction < 0:
            raise InputError(reason, field=f"{field}.direction", value=train.direction)
        if train.reverse_at:
            raise InputError(reason, field=f"{field}.reverse_at", value=len(train.reverse_at))
    _check_blocks(scenario, plan)
    _check_levels(scenario, plan)
    _check_faults(scenario)


def _check_blocks(scenario: Scenario, plan: TrackCircuitPlan) -> None:
    """Every circuit lets a train through that finds it free."""
    circuits = circuits_of(scenario)
    for circuit in circuits:
        if not holds_trains(circuit, plan.braking_mps2):
            raise InputError(
                f"holds no train on the fall of {-circuit.gradient_permil:g} per mille in"
                f" {circuit.name}",
                field="track_circuits.braking_mps2",
                value=plan.braking_mps2,
            )
        if circuit.gradient_permil < STEEPEST_PERMIL:
            raise InputError(
                f"no code tells a fall of more than {-STEEPEST_PERMIL:g} per mille, {circuit.name}"
                f" has {-circuit.gradient_permil:g}",
                field=f"tracks.{circuit.track}.gradients",
                value=circuit.gradient_permil,
            )
    speeds = speeds_of(scenario)
    for name, kmh in allowed_kmh(circuits, plan.braking_mps2, speeds).items():
        circuit = next(each for each in circuits if each.name == name)
        if kmh <= 0.0 < circuit.limit_mps:
            raise InputError(
                f"{name} of {circuit.length_m:.0f} m is too short for a code that lets trains move",
                field="track_circuits.length_m",
                value=plan.length_m,
            )


def _check_levels(scenario: Scenario, plan: TrackCircuitPlan) -> None:
    """The code of a neighbour is told from one's own by its level."""
    lengths_m = [circuit.length_m for circuit in circuits_of(scenario)]
    spread_db = plan.attenuation_db_per_km * 1e-3 * (max(lengths_m) - min(lengths_m))
    least_db = spread_db + OWN_MARGIN_DB + DECODING_DB
    if plan.joint_db < least_db:
        raise InputError(
            "the code of a neighbour would pass for the circuit's own, a joint must take"
            f" {least_db:.1f} dB",
            field="track_circuits.joint_db",
            value=plan.joint_db,
        )


def _check_faults(scenario: Scenario) -> None:
    names = {
        "circuit": [circuit.name for circuit in circuits_of(scenario)],
        "train": [train.name for train in scenario.trains],
        "track": list(scenario.network.tracks),
    }
    for index, fault in enumerate(scenario.faults):
        if not isinstance(fault, RAIL_FAULTS):
            continue
        for field, known in names.items():
            name = getattr(fault, field, None)
            if name is not None and name not in known:
                said = ", ".join(known) if len(known) < 5 else f"{known[0]} ... {known[-1]}"
                raise InputError(
                    f"there is no such {field}, they are {said}",
                    field=f"faults.{index}.{field}",
                    value=name,
                )
        if isinstance(fault, BrokenRail) and fault.at_m is not None:
            circuit = next(c for c in circuits_of(scenario) if c.name == fault.circuit)
            if not circuit.start_m <= fault.at_m <= circuit.end_m:
                raise InputError(
                    f"is not in {circuit.name}, {circuit.start_m:g} to {circuit.end_m:g} m",
                    field=f"faults.{index}.at_m",
                    value=fault.at_m,
                )
        if isinstance(fault, WetBallast):
            length_m = scenario.network.tracks[fault.track].length_m
            if fault.from_m >= length_m:
                raise InputError(
                    f"is past the end of {fault.track}, {length_m:g} m",
                    field=f"faults.{index}.from_m",
                    value=fault.from_m,
                )
