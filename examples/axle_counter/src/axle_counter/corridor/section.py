"""The section on axle counters; their faults."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, field_validator, model_validator

from axle_counter import quantities
from axle_counter.signals.axles import Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import StrictInt, Time
from rail_world.line.description_base import Description, Name, StrictFloat, field_of


class SectionReset(Description):
    """A reset of a section by the signaller."""

    section: Name = Field(description="its name: acs1, acs2, ... in the order of the tracks")
    at_s: Time = Field(description="time of the reset [s]")


class AxleCounterPlan(Description):
    """Axle counters: detection points along every track, and the sections between them."""

    length_m: StrictFloat = Field(
        default=500.0, ge=20.0, le=1e5, description="no section is longer than this [m]"
    )
    margin_m: StrictFloat = Field(
        default=100.0,
        ge=1.0,
        le=1e5,
        description="from the ends of a track to its first and last detection point [m]",
    )
    car_m: StrictFloat = field_of(quantities.CAR_LENGTH)
    axles_per_car: Literal[2, 4, 6] = Field(
        default=4, description="axles of a car, half of them in each of two bogies"
    )
    wheelbase_m: StrictFloat = field_of(quantities.WHEELBASE)
    coil_spacing_m: StrictFloat = field_of(quantities.COIL_SPACING)
    pulse_m: StrictFloat = field_of(quantities.PULSE)
    threshold: StrictFloat = field_of(quantities.THRESHOLD)
    release: StrictFloat = field_of(quantities.RELEASE)
    sample_rate_hz: StrictFloat = field_of(quantities.SAMPLE_RATE)
    noise_v: StrictFloat = field_of(quantities.NOISE)
    reset: Literal["sweep", "conditional"] = field_of(quantities.RESET)
    resets: tuple[SectionReset, ...] = Field(
        default=(), max_length=1000, description="resets by the signaller"
    )

    @field_validator("axles_per_car", mode="before")
    @classmethod
    def _whole(cls, value: object) -> object:
        if isinstance(value, bool):
            raise ValueError("a whole number is wanted, not a truth value")
        return value

    @model_validator(mode="after")
    def _makes_a_sensor(self) -> AxleCounterPlan:
        least_m = self.sensor.least_axle_distance_m
        if self.cars.axle_distance_m <= least_m:
            raise ValueError(f"wheelbase_m: axles closer than {least_m:.2f} m are one to a sensor")
        return self

    @property
    def sensor(self) -> WheelSensor:
        """Dimensions and thresholds of the wheel sensors."""
        return WheelSensor(
            coil_spacing_m=self.coil_spacing_m,
            pulse_m=self.pulse_m,
            threshold=self.threshold,
            release=self.release,
        )

    @property
    def cars(self) -> Cars:
        """Cars of the trains."""
        return Cars(self.car_m, self.axles_per_car, self.wheelbase_m)


class MissedAxles(TimedFault):
    """A wheel sensor that has come loose: it misses axles of every train."""

    kind: Literal["missed_axles"]
    point: Name = Field(description="detection point: dp1, dp2, ... in the order of the tracks")
    every: StrictInt = field_of(quantities.EVERY)
    left: StrictFloat = field_of(quantities.LEFT)


class RailBrake(TimedFault):
    """Magnets of a rail brake, down between axles, which a wheel sensor takes for more axles."""

    kind: Literal["rail_brake"]
    train: Name = Field(description="the train")
    length_m: StrictFloat = field_of(quantities.MAGNET_LENGTH)


AXLE_COUNTERS: Final[Section[AxleCounterPlan | None]] = Section(
    "axle_counters",
    AxleCounterPlan | None,
    "axle counters, which say what sections are free; null = none",
    None,
)
