"""The section of track circuits and their codes; its faults."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import StrictInt
from rail_msgs_py.quantities import CAB_SIGNALS, ODOMETER_ERROR
from rail_msgs_py.track_code import quantities
from rail_signals.track_code.profile import load_profile
from rail_world.line.description_base import (
    Chainage,
    Description,
    Name,
    StrictFloat,
    field_of,
    range_of,
)


class TrackCircuitPlan(Description):
    """Track circuits that send codes, and what trains make of them.

    With this section trains run on what they understand from the rails.
    """

    length_m: StrictFloat = field_of(quantities.LENGTH)
    carriers_hz: tuple[Annotated[StrictFloat, range_of(quantities.CARRIERS)], ...] = field_of(
        quantities.CARRIERS, min_length=2, max_length=4
    )
    sample_rate_hz: StrictFloat = field_of(quantities.SAMPLE_RATE)
    braking_mps2: StrictFloat = field_of(quantities.BRAKING)
    cab_signals: bool = field_of(CAB_SIGNALS)
    attenuation_db_per_km: StrictFloat = field_of(quantities.ATTENUATION)
    snr_db: StrictFloat = Field(
        default=40.0,
        ge=-20.0,
        le=100.0,
        description="level at the transmitter over white noise in 300 Hz [dB]",
    )
    joint_db: StrictFloat = field_of(quantities.JOINT_LOSS)
    harmonics: tuple[tuple[StrictInt, StrictFloat], ...] = Field(
        default=((31, -30.0), (33, -33.0), (35, -34.0), (37, -36.0), (47, -40.0)),
        max_length=100,
        description="traction current: [harmonic of 50 Hz, level against the transmitter in dB]",
    )
    impulses_per_s: StrictFloat = field_of(quantities.IMPULSE_RATE)
    odometer_error: StrictFloat = field_of(ODOMETER_ERROR)

    @model_validator(mode="after")
    def _makes_a_signal(self) -> TrackCircuitPlan:
        if self.sample_rate_hz % 128.0:
            raise ValueError("sample_rate_hz: must be a multiple of 128 Hz")
        if 2.0 * (max(self.carriers_hz) + 150.0) > self.sample_rate_hz:
            raise ValueError(
                "sample_rate_hz: must be twice the highest carrier and 150 Hz, or more"
            )
        profile = quantities.PROFILE.default
        known = load_profile(profile).carriers_hz
        for index, carrier_hz in enumerate(self.carriers_hz):
            if carrier_hz not in known:
                raise ValueError(f"carriers_hz.{index}: {profile} has {known}")
            if carrier_hz == self.carriers_hz[index - 1]:
                raise ValueError(f"carriers_hz.{index}: neighbours need different carriers")
        return self


class Sanding(TimedFault):
    """Sand on the rails: a train picks up less."""

    kind: Literal["sanding"]
    train: Name = Field(description="the train that sands")
    loss_db: StrictFloat = field_of(quantities.SANDING_LOSS)


class BrokenRail(TimedFault):
    """A rail that is broken: what would pass it is weaker."""

    kind: Literal["broken_rail"]
    circuit: Name = Field(description="its name: tc1, tc2, ... in the order of the tracks")
    at_m: Chainage | None = Field(
        default=None, description="chainage of the break; null = the middle of the circuit [m]"
    )
    loss_db: StrictFloat = field_of(quantities.BREAK_LOSS)


class FailedJoint(TimedFault):
    """The insulated joint at the exit end of a track circuit lets through what it should not."""

    kind: Literal["failed_joint"]
    circuit: Name = Field(description="the circuit before the joint")
    loss_db: StrictFloat = field_of(quantities.JOINT_LEFT)


class PoorShunt(TimedFault):
    """Rust or leaves between the wheels of a train and the rails."""

    kind: Literal["poor_shunt"]
    train: Name = Field(description="the train")
    shunt_ohm: StrictFloat = field_of(quantities.SHUNT)


class WetBallast(TimedFault):
    """Rain on a stretch of a track: the ballast leaks."""

    kind: Literal["wet_ballast"]
    track: Name = Field(description="the track")
    from_m: Chainage = Field(default=0.0, description="where it begins [m]")
    to_m: Chainage = Field(default=1e6, description="where it ends [m]")
    ballast_ohm_km: StrictFloat = field_of(quantities.BALLAST)

    @model_validator(mode="after")
    def _has_a_length(self) -> WetBallast:
        if self.to_m <= self.from_m:
            raise ValueError(f"to_m: must be after from_m, {self.from_m:g} m")
        return self


class DeadTransmitter(TimedFault):
    """A track circuit that sends nothing."""

    kind: Literal["dead_transmitter"]
    circuit: Name = Field(description="its name: tc1, tc2, ... in the order of the tracks")


#: Whatever goes wrong in the rails, and between them and the trains.
RAIL_FAULTS: Final = (Sanding, BrokenRail, FailedJoint, PoorShunt, WetBallast, DeadTransmitter)

TRACK_CIRCUITS: Final[Section[TrackCircuitPlan | None]] = Section(
    "track_circuits",
    TrackCircuitPlan | None,
    "codes in the rails, which trains obey; null = none",
    None,
)
