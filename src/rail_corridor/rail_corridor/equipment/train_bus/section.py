"""The section of a scenario on the train bus."""

from __future__ import annotations

from pydantic import Field, model_validator

from rail_corridor.scenario.section_fields import Frequency, Whole
from rail_signals.train_bus.frame import BusFrameFormat
from rail_world.line.description import Description, Name, Number


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
