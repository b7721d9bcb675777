"""Faults of trains, and what the faults of all equipment have in common."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END, SLIP_RATIO
from rail_world.line.description_base import Description, Name, StrictFloat, field_of


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


#: Kinds that befall a corridor whatever equipment is in it.
COMMON_FAULTS: Final[tuple[type[Fault], ...]] = (TrainStopFault, WheelSlipFault, EquipmentOffFault)
