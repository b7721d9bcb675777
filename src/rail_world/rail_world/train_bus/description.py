"""The validated description of the train buses: cables, levels, noise, faults that grow."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_world.line.description_base import Description, Name, Number

Seconds = Annotated[Number, Field(ge=0.0, le=1e9)]
Ohms = Annotated[Number, Field(gt=0.0, le=1e6)]

FaultKind = Literal[
    "open",
    "short",
    "water_ingress",
    "bad_splice",
    "wrong_cable",
    "missing_shield_ground",
    "loose_connector",
]


class BusFaultDescription(Description):
    """A fault of a bus; how it grows is in `rail_world.train_bus.fault_growth`.

    Places are metres of cable from the head; cars and couplers are counted from it, from 1.
    """

    fault: FaultKind
    from_s: Seconds
    to_s: Seconds
    law: Literal["linear", "exponential"]
    size: Number = Field(gt=0.0, le=1e6, description="when it has grown, in the unit of its kind")
    at_m: Number = Field(default=0.0, ge=0.0, le=1e4)
    length_m: Number = Field(default=0.0, ge=0.0, le=1e4, description="of cable that is wet")
    conductance_us_per_m: Number = Field(default=0.0, ge=0.0, le=1e4)
    car: int = Field(default=1, ge=1, le=100)
    coupler: int = Field(default=1, ge=1, le=100)
    profile: str = Field(default="", description="whose cable is there instead")
    noise_factor: Number = Field(default=1.0, ge=1.0, le=1e3)
    spread: Number = Field(default=0.0, ge=0.0, le=2.0)


class TrainBus(Description):
    """The bus of one train: the profile of each of its cars, and what is wrong with it."""

    train: Name
    cars: tuple[str, ...] = Field(min_length=1, max_length=100)
    fault: BusFaultDescription | None = None


class BusDescription(Description):
    """Everything the bus medium knows."""

    trains: tuple[TrainBus, ...] = Field(min_length=1)
    bit_rate_hz: Number = Field(gt=0.0, le=1e8)
    samples_per_bit: int = Field(ge=4, le=64)
    level_v: Number = Field(gt=0.0, le=1e3, description="of the drivers, into a matched line")
    noise_v: Number = Field(ge=0.0, le=1e3, description="rms of a sample at a receiver")
    source_ohm: Ohms = Field(description="terminator at the head")
    longest_delay_s: Number = Field(gt=0.0, le=1e-3)
    reference_ohm: Ohms = Field(description="output of the reflectometer")
    reflectometer_noise: Number = Field(ge=0.0, le=1.0, description="rms, as a reflection")

    @property
    def sample_rate_hz(self) -> float:
        """Samples per second at the terminals."""
        return self.bit_rate_hz * self.samples_per_bit

    @property
    def guard_samples(self) -> int:
        """Samples by which what arrives is longer than what was sent."""
        return math.ceil(self.longest_delay_s * self.sample_rate_hz) + self.samples_per_bit

    @property
    def tail_samples(self) -> int:
        """Samples after which a line has forgotten a frame, several times its delay."""
        return 4 * self.guard_samples

    @model_validator(mode="after")
    def _agrees(self) -> BusDescription:
        names = [bus.train for bus in self.trains]
        if len(set(names)) != len(names):
            raise ValueError("trains: a name comes twice")
        return self
