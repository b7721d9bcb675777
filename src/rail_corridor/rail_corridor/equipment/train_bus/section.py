"""The section on the train bus, and the fault that grows in it."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import Fault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import StrictInt
from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.quantity import NEEDED
from rail_msgs_py.train_bus import quantities
from rail_signals.train_bus.frame import BusFrameFormat
from rail_world.line.description_base import Description, Name, StrictFloat, field_of, range_of
from rail_world.train_bus.description import FaultKind

#: Size of each kind where none is given; open and wrong_cable have none.
SIZES: Final[dict[str, float]] = {
    "short": 1.0,
    "water_ingress": 0.6,
    "bad_splice": 3000.0,
    "missing_shield_ground": 0.2,
    "loose_connector": 3000.0,
}
#: What each kind needs beside its size.
_NEEDS: Final[dict[str, str]] = {
    "open": "at_m",
    "short": "at_m",
    "water_ingress": "at_m",
    "bad_splice": "at_m",
    "wrong_cable": "car",
    "missing_shield_ground": "car",
    "loose_connector": "coupler",
}


class BusPlan(Description):
    """The train bus: its cable in each car, its frames, and the reflectometer that watches it."""

    cars: tuple[str, ...] = field_of(quantities.CARS, min_length=1, max_length=40)
    trains: tuple[Name, ...] = Field(
        default=(), max_length=100, description="trains that have the bus; empty = all"
    )
    bit_rate_hz: StrictFloat = field_of(quantities.BIT_RATE)
    samples_per_bit: StrictInt = field_of(quantities.SAMPLES_PER_BIT)
    rise_time_s: StrictFloat = field_of(quantities.RISE_TIME)
    level_v: StrictFloat = field_of(quantities.LEVEL)
    noise_v: StrictFloat = field_of(quantities.NOISE)
    answer_timeout_s: StrictFloat = field_of(quantities.ANSWER_TIMEOUT)
    period_s: StrictFloat = field_of(quantities.PERIOD)
    traces: StrictInt = field_of(quantities.TRACES)
    reflectometer_rise_s: StrictFloat = field_of(quantities.REFLECTOMETER_RISE)
    reflectometer_noise: StrictFloat = field_of(quantities.REFLECTOMETER_NOISE)

    @model_validator(mode="after")
    def _makes_frames(self) -> BusPlan:
        try:
            BusFrameFormat(32, self.bit_rate_hz, self.samples_per_bit, self.rise_time_s)
        except ValueError as error:
            field, _, reason = str(error).partition(" ")
            raise ValueError(f"{field}: {reason}") from None
        if len(set(self.trains)) != len(self.trains):
            raise ValueError("trains: a train comes twice")
        return self


class BusFault(Fault):
    """A fault in the bus cable of a train that grows from one time to another, and stays.

    Its share of its size runs from 0 to 1 by the law: linear, or exponential, a thousandfold.
    """

    kind: Literal["bus_fault"]
    train: Name = Field(description="the train")
    fault: FaultKind = Field(description="what it is; open and wrong_cable do not grow")
    from_s: StrictFloat = field_of(FAULT_BEGIN)
    to_s: StrictFloat = field_of(FAULT_END.but(default=NEEDED, text="it is as large as it gets"))
    law: quantities.GrowthLaw = field_of(quantities.GROWTH_LAW)
    size: Annotated[StrictFloat, range_of(quantities.FAULT_SIZE)] | None = Field(
        default=None,
        description="when it has grown: resistance of loose_connector and bad_splice, and what is"
        " left of it in a short [ohm]; rise of the capacitance (water_ingress), of impedance and"
        " loss (missing_shield_ground) as a share; null = 3000, 3000, 1, 0.6, 0.2",
    )
    at_m: Annotated[StrictFloat, range_of(quantities.FAULT_PLACE)] | None = Field(
        default=None, description=quantities.FAULT_PLACE.description
    )
    car: Annotated[StrictInt, range_of(quantities.FAULT_CAR)] | None = Field(
        default=None, description=quantities.FAULT_CAR.description
    )
    coupler: Annotated[StrictInt, range_of(quantities.FAULT_COUPLER)] | None = Field(
        default=None, description=quantities.FAULT_COUPLER.description
    )
    length_m: StrictFloat = field_of(quantities.WET_LENGTH)
    conductance_us_per_m: StrictFloat = field_of(quantities.WET_CONDUCTANCE)
    spread: StrictFloat = field_of(quantities.CONTACT_SPREAD)
    noise_factor: StrictFloat = field_of(quantities.NOISE_FACTOR)
    cable: str = Field(
        default="polyethylene", max_length=40, description="wrong_cable: profile of what is there"
    )

    @model_validator(mode="after")
    def _agrees(self) -> BusFault:
        if self.to_s <= self.from_s:
            raise ValueError(f"to_s: must be after from_s, {self.from_s:g} s")
        needed = _NEEDS[self.fault]
        for name in ("at_m", "car", "coupler"):
            value = getattr(self, name)
            if name == needed and value is None:
                raise ValueError(f"{name}: {self.fault} needs it")
            if name != needed and value is not None:
                raise ValueError(f"{name}: does not go with {self.fault}")
        return self

    @property
    def full_size(self) -> float:
        """Size when it has grown; 1 where there is nothing to grow."""
        return SIZES.get(self.fault, 1.0) if self.size is None else self.size


class TrainPartedFault(Fault):
    """A train that comes apart behind a car: the bus is cut there, and stays so.

    The world has no rear part that stands by itself; what goes on as one train is still its whole
    length. What is lost is the confirmation that the train is whole.
    """

    kind: Literal["train_parted"]
    train: Name = Field(description="the train")
    from_s: StrictFloat = field_of(FAULT_BEGIN)
    behind_car: StrictInt = field_of(
        quantities.FAULT_COUPLER.but(default=1, text="car behind which it parts")
    )


TRAIN_BUS_SECTION: Final[Section[BusPlan | None]] = Section(
    "train_bus", BusPlan | None, "the bus in the trains and what watches it; null = none", None
)
