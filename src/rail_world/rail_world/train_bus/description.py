"""The validated description of the train buses: cables, levels, noise, faults that grow."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.train_bus import quantities
from rail_world.line.description_base import Description, Name, StrictFloat, range_of

Ohms = Annotated[StrictFloat, Field(gt=0.0, le=1e6)]

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
    from_s: Annotated[StrictFloat, range_of(FAULT_BEGIN)]
    to_s: Annotated[StrictFloat, range_of(FAULT_END)]
    law: Annotated[quantities.GrowthLaw, range_of(quantities.GROWTH_LAW)]
    size: Annotated[StrictFloat, range_of(quantities.FAULT_SIZE)]
    at_m: Annotated[StrictFloat, range_of(quantities.FAULT_PLACE)]
    length_m: Annotated[StrictFloat, range_of(quantities.WET_LENGTH)]
    conductance_us_per_m: Annotated[StrictFloat, range_of(quantities.WET_CONDUCTANCE)]
    car: Annotated[int, range_of(quantities.FAULT_CAR)]
    coupler: Annotated[int, range_of(quantities.FAULT_COUPLER)]
    profile: str = Field(description="whose cable is there instead; empty = nobody's")
    noise_factor: Annotated[StrictFloat, range_of(quantities.NOISE_FACTOR)]
    spread: Annotated[StrictFloat, range_of(quantities.CONTACT_SPREAD)]


class TrainBus(Description):
    """The bus of one train: the profile of each of its cars, and what is wrong with it."""

    train: Name
    cars: Annotated[tuple[str, ...], range_of(quantities.CARS)]
    fault: BusFaultDescription | None = None


class BusDescription(Description):
    """Everything the bus medium knows."""

    trains: tuple[TrainBus, ...] = Field(min_length=1)
    bit_rate_hz: Annotated[StrictFloat, range_of(quantities.BIT_RATE)]
    samples_per_bit: Annotated[int, range_of(quantities.SAMPLES_PER_BIT)]
    level_v: Annotated[StrictFloat, range_of(quantities.LEVEL)]
    noise_v: Annotated[StrictFloat, range_of(quantities.NOISE)]
    source_ohm: Ohms = Field(description="terminator at the head")
    longest_delay_s: StrictFloat = Field(gt=0.0, le=1e-3)
    reference_ohm: Ohms = Field(description="output of the reflectometer")
    reflectometer_noise: Annotated[StrictFloat, range_of(quantities.REFLECTOMETER_NOISE)]

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
