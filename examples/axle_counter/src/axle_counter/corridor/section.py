"""The section on axle counters; their faults."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from axle_counter.signals.axles import Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import Frequency, StrictInt, Time
from rail_world.line.description_base import Description, Name, StrictFloat

_SENSOR, _CARS = WheelSensor(), Cars()


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
    car_m: StrictFloat = Field(
        default=_CARS.length_m, ge=5.0, le=50.0, description="length of the cars, about [m]"
    )
    axles_per_car: Literal[2, 4, 6] = Field(
        default=4, description="axles of a car, half of them in each of two bogies"
    )
    wheelbase_m: StrictFloat = Field(
        default=_CARS.wheelbase_m, ge=1.0, le=5.0, description="of a bogie, first to last axle [m]"
    )
    coil_spacing_m: StrictFloat = Field(
        default=_SENSOR.coil_spacing_m, ge=0.01, le=1.0, description="between the two coils [m]"
    )
    pulse_m: StrictFloat = Field(
        default=_SENSOR.pulse_m,
        ge=0.01,
        le=1.0,
        description="travel over which a wheel damps a coil [m]",
    )
    threshold: StrictFloat = Field(
        default=_SENSOR.threshold,
        ge=0.01,
        le=0.99,
        description="fraction of the damping by a wheel that switches a coil on",
    )
    release: StrictFloat = Field(
        default=_SENSOR.release, ge=0.01, le=0.99, description="... and that switches it off again"
    )
    sample_rate_hz: Frequency = Field(
        default=8000.0, description="sample rate of the amplitudes [Hz]"
    )
    noise_v: StrictFloat = Field(
        default=0.005,
        ge=0.0,
        le=1.0,
        description="standard deviation of a sample, where a coil at rest has 1 V [V]",
    )
    reset: Literal["sweep", "conditional"] = Field(
        default="sweep",
        description="what a reset makes of a section: free once a train has swept it, or at once",
    )
    resets: tuple[SectionReset, ...] = Field(
        default=(), max_length=1000, description="resets by the signaller"
    )

    @field_validator("axles_per_car", mode="before")
    @classmethod
    def _whole(cls, value: object, info: ValidationInfo) -> object:
        if isinstance(value, bool):
            raise ValueError("a whole number is wanted, not a truth value")
        return value

    @model_validator(mode="after")
    def _makes_a_sensor(self) -> AxleCounterPlan:
        assert self.sensor is not None
        if self.cars.axle_distance_m <= self.sensor.least_axle_distance_m:
            raise ValueError(
                f"wheelbase_m: axles closer than {self.sensor.least_axle_distance_m:.2f} m are one"
                " to the sensor"
            )
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
    every: StrictInt = Field(
        default=3, ge=1, le=1000, description="the axle of a train that is missed, and each so many"
    )
    left: StrictFloat = Field(
        default=0.1, ge=0.0, le=1.0, description="what is left of the damping by such an axle"
    )


class RailBrake(TimedFault):
    """Magnets of a rail brake, down between axles, which a wheel sensor takes for more axles."""

    kind: Literal["rail_brake"]
    train: Name = Field(description="the train")
    length_m: StrictFloat = Field(default=1.0, ge=0.1, le=2.0, description="of a magnet [m]")


AXLE_COUNTERS: Final[Section[AxleCounterPlan | None]] = Section(
    "axle_counters",
    AxleCounterPlan | None,
    "axle counters, which say what sections are free; null = none",
    None,
)
