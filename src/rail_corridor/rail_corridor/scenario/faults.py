"""Faults of trains, and what the faults of all equipment have in common."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import ADHESION, BRAKE_FACTOR, FAULT_BEGIN, FAULT_END, SLIP_RATIO
from rail_world.line.description_base import (
    Chainage,
    Description,
    Name,
    Speed,
    StrictFloat,
    field_of,
)


class Fault(Description):
    """Something that goes wrong; each kind has a ``kind`` of its own."""

    kind: str

    @property
    def subject(self) -> str:
        """What it befalls, for those who list faults: the first name in it."""
        fields = (name for name in type(self).model_fields if name != "kind")
        return next((v for name in fields if isinstance(v := getattr(self, name), str)), "")


class TimedFault(Fault):
    """A fault that lasts from one time to another."""

    from_s: StrictFloat = field_of(FAULT_BEGIN)
    to_s: StrictFloat = field_of(FAULT_END)

    @model_validator(mode="after")
    def _has_a_duration(self) -> TimedFault:
        if self.to_s <= self.from_s:
            raise ValueError(f"to_s: must be after from_s, {self.from_s:g} s")
        return self


class TrainStopFault(TimedFault):
    """A train that brakes to a stand as fast as it can and stays there."""

    kind: Literal["train_stop"]
    train: Name = Field(description="the train")


class EquipmentOffFault(TimedFault):
    """Equipment that is switched off; switched on again it knows nothing of before.

    Where times of one equipment overlap or touch, they are one.
    """

    kind: Literal["equipment_off"]
    node: str = Field(
        max_length=200, description="full name of a node, as `/wayside/wrs1` or `/train_1/atp`"
    )


class WheelSlipFault(TimedFault):
    """Wheels that turn faster or slower than the train runs."""

    kind: Literal["wheel_slip"]
    train: Name = Field(description="the train")
    ratio: StrictFloat = field_of(SLIP_RATIO)


class ReducedBrakingFault(TimedFault):
    """Brakes that give a part of their force only: failed cars, worn pads, rain."""

    kind: Literal["reduced_braking"]
    train: Name = Field(description="the train")
    service: StrictFloat = field_of(BRAKE_FACTOR)
    emergency: StrictFloat = field_of(BRAKE_FACTOR)


class LowAdhesionFault(TimedFault):
    """Rails that bear little: wheels slide when braked and spin when pulled harder than that."""

    kind: Literal["low_adhesion"]
    train: Name = Field(description="the train")
    adhesion: StrictFloat = field_of(ADHESION)


class SpeedRestrictionFault(TimedFault):
    """A lower limit on a stretch of a track for a time.

    Drivers keep to it as boards on the line, unless supervision tells them.
    """

    kind: Literal["speed_restriction"]
    track: Name = Field(description="the track")
    from_m: Chainage = Field(description="where it begins [m]")
    to_m: Chainage = Field(description="where it ends [m]")
    speed_kmh: Speed = Field(description="limit [km/h]")

    @model_validator(mode="after")
    def _has_a_length(self) -> SpeedRestrictionFault:
        if self.to_m <= self.from_m:
            raise ValueError(f"to_m: must be after from_m, {self.from_m:g} m")
        return self


#: Faults of trains and of the line, which belong to no equipment.
WORLD_FAULTS: Final[tuple[type[Fault], ...]] = (
    TrainStopFault,
    WheelSlipFault,
    ReducedBrakingFault,
    LowAdhesionFault,
    SpeedRestrictionFault,
)
#: Those, and what befalls any node.
COMMON_FAULTS: Final[tuple[type[Fault], ...]] = (*WORLD_FAULTS, EquipmentOffFault)
