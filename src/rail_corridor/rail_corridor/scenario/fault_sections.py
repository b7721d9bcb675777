"""The faults of a scenario: what goes wrong, and when."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_corridor.equipment.train_bus.fault_section import BusFault
from rail_world.line.description import Chainage, Description, Name, Number
from rail_world.train_radio.threat_description import LONGEST_DELAY_S, LongestDelay, Rate, Threats

from .section_fields import ChannelNumber, Power, Time


class _Fault(Description):
    from_s: Time = Field(default=0.0, description="begin [s]")
    to_s: Time = Field(default=1e6, description="end [s]")

    @model_validator(mode="after")
    def _has_a_duration(self) -> _Fault:
        if self.to_s <= self.from_s:
            raise ValueError(f"to_s: must be after from_s, {self.from_s:g} s")
        return self


class DeadStation(_Fault):
    """A station that neither sends nor receives."""

    kind: Literal["dead_station"]
    station: Name = Field(description="its name")


class Jam(_Fault):
    """A jammer: band-limited noise on one channel, from a place at the track."""

    kind: Literal["jam"]
    channel: ChannelNumber = Field(description="channel it jams")
    power_dbm: Power = Field(default=0.0, description="its power [dBm]")
    track: Name = Field(description="track it stands at")
    at_m: Chainage = Field(description="chainage it stands at [m]")


class Sanding(_Fault):
    """Sand on the rails: a train picks up less."""

    kind: Literal["sanding"]
    train: Name = Field(description="the train that sands")
    loss_db: Number = Field(default=60.0, ge=0.0, le=200.0, description="pick-up lost [dB]")


class DeadTransmitter(_Fault):
    """A track circuit that sends nothing."""

    kind: Literal["dead_transmitter"]
    circuit: Name = Field(description="its name: tc1, tc2, ... in the order of the tracks")


class DeadBaseStation(_Fault):
    """A base station of the train radio that neither sends nor hears."""

    kind: Literal["dead_base_station"]
    base: Name = Field(description="its name: base1, base2, ... in the order of the tracks")


class TrainStop(_Fault):
    """A train that brakes to a stand as fast as it can and stays there."""

    kind: Literal["train_stop"]
    train: Name = Field(description="the train")


class NetworkThreats(_Fault):
    """An intruder between zone controller and base stations: threats of EN 50159 to frames.

    Where periods overlap, they strike independently of each other.
    """

    kind: Literal["threat"]
    threats: Threats = Field(
        description="some of repetition, deletion, insertion, resequencing, corruption, delay, "
        "masquerade"
    )
    rate: Rate = Field(description="probability of each for a frame, either way")
    longest_delay_s: LongestDelay = Field(
        default=LONGEST_DELAY_S, description="a delay is drawn evenly from 0 to this [s]"
    )


class DeadReference(_Fault):
    """A reference station that sends nothing."""

    kind: Literal["dead_reference"]
    station: Name = Field(description="its name: ref1, ref2, ... in the order of the tracks")


class DetunedReference(_Fault):
    """A reference station whose oscillator is off."""

    kind: Literal["detuned_reference"]
    station: Name = Field(description="its name: ref1, ref2, ... in the order of the tracks")
    shift_hz: Number = Field(ge=-2000.0, le=2000.0, description="how far it is off [Hz]")


class WheelSlip(_Fault):
    """Wheels that turn faster or slower than the train runs."""

    kind: Literal["wheel_slip"]
    train: Name = Field(description="the train")
    ratio: Number = Field(ge=0.0, le=3.0, description="speed of the wheels over that of the train")


Fault = Annotated[
    DeadStation
    | Jam
    | Sanding
    | DeadTransmitter
    | DeadBaseStation
    | TrainStop
    | NetworkThreats
    | DeadReference
    | DetunedReference
    | WheelSlip
    | BusFault,
    Field(discriminator="kind"),
]
