"""The world of a scenario: tracks, trains and their faults, and a part for all equipment."""

from __future__ import annotations

from rail_corridor.equipment.registry import odometer_error_of, subsystems
from rail_corridor.scenario.faults import TrainStopFault as TrainStopFault
from rail_corridor.scenario.faults import WheelSlipFault as WheelSlipFault
from rail_corridor.scenario.model import Scenario
from rail_world.line.drawing import Drawing
from rail_world.trains.description import TrainStop, WheelSlip
from rail_world.world_file import WorldFile

from .announcement import announcement


def world_file(scenario: Scenario) -> WorldFile:
    """Everything about a run that the world and its media read."""
    parts = {
        name: described.model_dump(mode="json")
        for each in subsystems()
        for name, described in each.world(scenario).items()
    }
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
        stops=tuple(
            TrainStop(train=fault.train, from_s=fault.from_s, to_s=fault.to_s)
            for fault in scenario.faults
            if isinstance(fault, TrainStopFault)
        ),
        slips=tuple(
            WheelSlip(train=fault.train, from_s=fault.from_s, to_s=fault.to_s, ratio=fault.ratio)
            for fault in scenario.faults
            if isinstance(fault, WheelSlipFault)
        ),
        odometer_error=odometer_error_of(scenario) or 0.0,
        scenario=announcement(scenario),
    )
