"""What track circuits must agree on with the rest of a scenario."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.errors import InputError
from rail_corridor.scenario.model import Scenario
from rail_signals.track_code.scales import CodeScales

from .placement import circuits_of
from .section import TRACK_CIRCUITS, DeadTransmitter, Sanding


def check_codes(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError for the first thing that does not fit the track circuits."""
    plan = TRACK_CIRCUITS.of(scenario)
    for index, fault in enumerate(scenario.faults):
        if plan is None and isinstance(fault, Sanding | DeadTransmitter):
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
    for circuit in circuits_of(scenario):
        try:
            CodeScales().gradient_index(circuit.gradient_permil)
        except ValueError:
            raise InputError(
                f"is steeper than any code can tell, in {circuit.name}",
                field=f"tracks.{circuit.track}.gradients",
                value=circuit.gradient_permil,
            ) from None
    _check_faults(scenario)


def _check_faults(scenario: Scenario) -> None:
    circuits = [circuit.name for circuit in circuits_of(scenario)]
    trains = [train.name for train in scenario.trains]
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, Sanding) and fault.train not in trains:
            raise InputError(
                f"there is no such train, they are {', '.join(trains)}",
                field=f"faults.{index}.train",
                value=fault.train,
            )
        if isinstance(fault, DeadTransmitter) and fault.circuit not in circuits:
            raise InputError(
                f"there is no such circuit, they are {circuits[0]} ... {circuits[-1]}",
                field=f"faults.{index}.circuit",
                value=fault.circuit,
            )
