"""The world of a scenario: tracks, trains and their faults, and a part for all equipment."""

from __future__ import annotations

from typing import TypeVar

from rail_corridor.equipment.registry import odometer_error_of, subsystems, supervision_of
from rail_corridor.scenario.faults import (
    Fault,
    LowAdhesionFault,
    ReducedBrakingFault,
    SpeedRestrictionFault,
    TrainStopFault,
    WheelSlipFault,
)
from rail_corridor.scenario.model import Scenario
from rail_world.line.description_base import Description
from rail_world.line.drawing import Drawing
from rail_world.trains.description import (
    LowAdhesion,
    ReducedBraking,
    SpeedRestriction,
    TrainStop,
    WheelSlip,
)
from rail_world.world_file import WorldFile

from .announcement import announcement

Described = TypeVar("Described", bound=Description)


def world_file(scenario: Scenario) -> WorldFile:
    """Everything about a run that the world and its media read."""
    parts = {
        name: described.model_dump(mode="json")
        for each in subsystems()
        for name, described in each.world(scenario).items()
    }
    supervision = supervision_of(scenario)
    told = supervision is not None and supervision.tells_restrictions
    drawings = [each.drawing(scenario) for each in subsystems()]
    return WorldFile(
        seed=scenario.seed,
        tick_s=scenario.tick_s,
        tracks=scenario.tracks,
        junctions=scenario.junctions,
        trains=scenario.trains,
        parts=parts,
        drawing=Drawing(
            masts=tuple(mast for each in drawings for mast in each.masts),
            stretches=tuple(stretch for each in drawings for stretch in each.stretches),
        ),
        stops=_of(scenario, TrainStopFault, TrainStop),
        slips=_of(scenario, WheelSlipFault, WheelSlip),
        reduced_braking=_of(scenario, ReducedBrakingFault, ReducedBraking),
        low_adhesion=_of(scenario, LowAdhesionFault, LowAdhesion),
        boards=() if told else _of(scenario, SpeedRestrictionFault, SpeedRestriction),
        quiet_from_s=quiet_from_s(scenario),
        odometer_error=odometer_error_of(scenario) or 0.0,
        scenario=announcement(scenario),
    )


def quiet_from_s(scenario: Scenario) -> float:
    """When the last fault of a scenario has ended [s]; 0 without faults."""
    return max((float(getattr(fault, "to_s", 0.0)) for fault in scenario.faults), default=0.0)


def _of(scenario: Scenario, kind: type[Fault], described: type[Described]) -> tuple[Described, ...]:
    """Faults of one kind as the world knows them, which has the same fields."""
    return tuple(
        described.model_validate(fault.model_dump(exclude={"kind"}))
        for fault in scenario.faults
        if isinstance(fault, kind)
    )
