"""The section of track circuits and their codes; its faults."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import Frequency, Whole
from rail_signals.track_code.profile import load_profile
from rail_world.line.description_base import Description, Name, Number

#: Profile whose fields the supervision of trains understands.
PROFILE: Final = "tones27"


class TrackCircuitPlan(Description):
    """Track circuits that send codes, and what trains make of them.

    With this section trains run on what they understand from the rails.
    """

    length_m: Number = Field(
        default=500.0, ge=50.0, le=3000.0, description="no circuit is longer than this [m]"
    )
    carriers_hz: tuple[Frequency, ...] = Field(
        default=(1700.0, 2300.0),
        min_length=2,
        max_length=4,
        description="carriers in turn along a track [Hz]",
    )
    sample_rate_hz: Frequency = Field(
        default=16_000.0, description="sample rate in the rails; a multiple of 128 Hz"
    )
    braking_mps2: Number = Field(
        default=0.5, ge=0.1, le=2.0, description="braking that the codes count on [m/s^2]"
    )
    cab_signals: bool = Field(
        default=True, description="drivers keep to the permitted speed before the brake makes them"
    )
    attenuation_db_per_km: Number = Field(
        default=6.0, ge=0.0, le=100.0, description="of the rails [dB/km]"
    )
    snr_db: Number = Field(
        default=40.0,
        ge=-20.0,
        le=100.0,
        description="level at the transmitter over white noise in 300 Hz [dB]",
    )
    joint_db: Number = Field(
        default=30.0, ge=0.0, le=120.0, description="crosstalk past a joint, below the signal [dB]"
    )
    harmonics: tuple[tuple[Whole, Number], ...] = Field(
        default=((31, -30.0), (33, -33.0), (35, -34.0), (37, -36.0), (47, -40.0)),
        max_length=100,
        description="traction current: [harmonic of 50 Hz, level against the transmitter in dB]",
    )
    impulses_per_s: Number = Field(
        default=0.2, ge=0.0, le=1000.0, description="impulses of noise, of the transmitter's level"
    )
    odometer_error: Number = Field(
        default=0.005, ge=0.0, le=0.1, description="standard deviation of the wheels' error"
    )

    @model_validator(mode="after")
    def _makes_a_signal(self) -> TrackCircuitPlan:
        if self.sample_rate_hz % 128.0:
            raise ValueError("sample_rate_hz: must be a multiple of 128 Hz")
        if 2.0 * (max(self.carriers_hz) + 150.0) > self.sample_rate_hz:
            raise ValueError(
                "sample_rate_hz: must be twice the highest carrier and 150 Hz, or more"
            )
        known = load_profile(PROFILE).carriers_hz
        for index, carrier_hz in enumerate(self.carriers_hz):
            if carrier_hz not in known:
                raise ValueError(f"carriers_hz.{index}: {PROFILE} has {known}")
            if carrier_hz == self.carriers_hz[index - 1]:
                raise ValueError(f"carriers_hz.{index}: neighbours need different carriers")
        return self


class Sanding(TimedFault):
    """Sand on the rails: a train picks up less."""

    kind: Literal["sanding"]
    train: Name = Field(description="the train that sands")
    loss_db: Number = Field(default=60.0, ge=0.0, le=200.0, description="pick-up lost [dB]")


class DeadTransmitter(TimedFault):
    """A track circuit that sends nothing."""

    kind: Literal["dead_transmitter"]
    circuit: Name = Field(description="its name: tc1, tc2, ... in the order of the tracks")


TRACK_CIRCUITS: Final[Section[TrackCircuitPlan | None]] = Section(
    "track_circuits",
    TrackCircuitPlan | None,
    "codes in the rails, which trains obey; null = none",
    None,
)
