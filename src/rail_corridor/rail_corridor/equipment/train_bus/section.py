"""The section on the train bus, and the fault that grows in it."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import Fault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import Frequency, Time, Whole
from rail_signals.train_bus.frame import BusFrameFormat
from rail_world.line.description_base import Description, Name, Number
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

    cars: tuple[str, ...] = Field(
        default=("CM2", "CM3", "CM4", "CM3", "CM2"),
        min_length=1,
        max_length=40,
        description="profile of the cable in each car, from the head",
    )
    trains: tuple[Name, ...] = Field(
        default=(), max_length=100, description="trains that have the bus; empty = all"
    )
    bit_rate_hz: Frequency = Field(default=1e6, description="bits per second")
    samples_per_bit: Whole = Field(default=8, ge=4, le=64, description="an even number")
    rise_time_s: Number = Field(
        default=150e-9, ge=0.0, le=1e-3, description="of the drivers' edges, 10 to 90 % [s]"
    )
    level_v: Number = Field(
        default=4.0, gt=0.0, le=100.0, description="amplitude of the drivers, matched line [V]"
    )
    noise_v: Number = Field(
        default=0.25, ge=0.0, le=100.0, description="rms of a sample at the receivers [V]"
    )
    answer_timeout_s: Number = Field(
        default=2.0, ge=0.1, le=60.0, description="end of train not confirmed after this time [s]"
    )
    period_s: Number = Field(
        default=30.0, ge=0.1, le=1e5, description="from one measurement to the next [s]"
    )
    traces: Whole = Field(default=8, ge=1, le=64, description="traces of a measurement")
    reflectometer_rise_s: Number = Field(
        default=20e-9, gt=0.0, le=1e-6, description="rise time of the reflectometer [s]"
    )
    reflectometer_noise: Number = Field(
        default=1e-3, gt=0.0, le=0.1, description="rms of a sample of a trace, as a reflection"
    )

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
    from_s: Time = Field(default=0.0, description="begin [s]")
    to_s: Time = Field(description="it is as large as it gets [s]")
    law: Literal["linear", "exponential"] = Field(default="exponential", description="of growth")
    size: Annotated[Number, Field(gt=0.0, le=1e6)] | None = Field(
        default=None,
        description="when it has grown: resistance of loose_connector and bad_splice, and what is"
        " left of it in a short [ohm]; rise of the capacitance (water_ingress), of impedance and"
        " loss (missing_shield_ground) as a share; null = 3000, 3000, 1, 0.6, 0.2",
    )
    at_m: Annotated[Number, Field(ge=0.0, le=1e4)] | None = Field(
        default=None, description="place along the cable from the head, where it is in a run [m]"
    )
    car: Annotated[Whole, Field(ge=1, le=100)] | None = Field(
        default=None, description="car of wrong_cable, missing_shield_ground; the head's is 1"
    )
    coupler: Annotated[Whole, Field(ge=1, le=100)] | None = Field(
        default=None, description="coupler of loose_connector; 1 is behind the head's car"
    )
    length_m: Number = Field(
        default=5.0, gt=0.0, le=1e3, description="water_ingress: length that is wet [m]"
    )
    conductance_us_per_m: Number = Field(
        default=10.0, ge=0.0, le=1e3, description="water_ingress: of the wet insulation [uS/m]"
    )
    spread: Number = Field(
        default=0.2,
        ge=0.0,
        le=1.0,
        description="loose_connector: standard deviation of the logarithm of its resistance from"
        " one moment to the next",
    )
    noise_factor: Number = Field(
        default=3.0, ge=1.0, le=100.0, description="missing_shield_ground: on the noise"
    )
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


TRAIN_BUS_SECTION: Final[Section[BusPlan | None]] = Section(
    "train_bus", BusPlan | None, "the bus in the trains and what watches it; null = none", None
)
