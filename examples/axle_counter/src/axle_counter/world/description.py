"""What the medium of the wheel sensors knows besides where the trains are."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from axle_counter import quantities
from axle_counter.signals.axles import Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from rail_world.line.description_base import Chainage, Description, Name, StrictFloat, field_of


class SensorPlace(Description):
    """Where the wheel sensor of a detection point is."""

    point: Name
    track: Name
    at_m: Chainage


class MissedAxlesAct(Description):
    """A loose sensor: of every so many axles of a train one damps it by ``left`` of its due."""

    kind: Literal["missed_axles"] = "missed_axles"
    point: Name
    from_s: StrictFloat
    to_s: StrictFloat
    every: int = field_of(quantities.EVERY)
    left: StrictFloat = field_of(quantities.LEFT)


class RailBrakeAct(Description):
    """Magnets of the rail brake of a train, down between the axles of each bogie."""

    kind: Literal["rail_brake"] = "rail_brake"
    train: Name
    from_s: StrictFloat
    to_s: StrictFloat
    length_m: StrictFloat = field_of(quantities.MAGNET_LENGTH)


class WheelSensorDescription(Description):
    """Everything the medium of the wheel sensors knows besides where the trains are."""

    sensor: WheelSensor
    places: tuple[SensorPlace, ...] = Field(min_length=1)
    cars: Cars
    sample_rate_hz: StrictFloat = field_of(quantities.SAMPLE_RATE)
    noise_v: StrictFloat = field_of(quantities.NOISE)
    missed_axles: tuple[MissedAxlesAct, ...] = ()
    rail_brakes: tuple[RailBrakeAct, ...] = ()

    @model_validator(mode="after")
    def _agrees(self) -> WheelSensorDescription:
        points = [place.point for place in self.places]
        if len(set(points)) < len(points):
            raise ValueError("places: a point comes twice")
        for fault in self.missed_axles:
            if fault.point not in points:
                raise ValueError(f"missed_axles: there is no point {fault.point}")
        return self
