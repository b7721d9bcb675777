"""The section on reference stations, by whose Doppler shifts trains are located; its faults."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import Frequency, Power, Whole
from rail_signals.doppler.tone_plan import TonePlan
from rail_world.line.description_base import Description, Name, Number


class ReferencePlan(Description):
    """Reference stations, by whose Doppler shifts trains find their place (Kim et al.)."""

    spacing_m: Number = Field(
        default=600.0, ge=50.0, le=20_000.0, description="no station is farther apart [m]"
    )
    offset_m: Number = Field(
        default=20.0, ge=1.0, le=1000.0, description="off the track, sides in turn [m]"
    )
    height_m: Number = Field(default=6.0, ge=0.0, le=100.0, description="above the antenna [m]")
    carrier_hz: Number = Field(default=2.6e9, ge=1e7, le=1e11, description="middle of tones [Hz]")
    sample_rate_hz: Frequency = Field(default=64e3, description="complex samples per second")
    samples: Whole = Field(default=2048, ge=512, le=65_536, description="of a block; a power of 2")
    slots: Whole = Field(default=10, ge=2, le=1000, description="tones in turn along the tracks")
    slot_spacing_hz: Frequency = Field(default=6e3, description="from tone to tone [Hz]")
    power_dbm: Power = Field(default=10.0, description="radiated power of a station [dBm]")
    noise_figure_db: Number = Field(default=8.0, ge=0.0, le=30.0, description="receivers [dB]")
    path_loss_exponent: Number = Field(
        default=2.0, ge=1.5, le=6.0, description="2 = free space; counts from 1 m"
    )
    extra_loss_db: Number = Field(
        default=0.0, ge=-60.0, le=120.0, description="taken from every link, for sweeps [dB]"
    )
    reach_spacings: Number = Field(
        default=2.5, ge=1.0, le=10.0, description="nothing is heard past so many spacings"
    )
    receiver_ppm: Number = Field(
        default=0.5, ge=0.0, le=2.0, description="largest offset of a train's oscillator [ppm]"
    )
    station_ppb: Number = Field(
        default=0.01, ge=0.0, le=100.0, description="standard deviation of a station's [ppb]"
    )
    fastest_kmh: Number = Field(
        default=500.0, ge=10.0, le=600.0, description="speed that receivers search up to [km/h]"
    )

    @model_validator(mode="after")
    def _makes_tones(self) -> ReferencePlan:
        try:
            _ = self.tones
        except ValueError as error:
            field, _, reason = str(error).partition(" ")
            known = {"spacing_hz": "slot_spacing_hz"}
            raise ValueError(f"{known.get(field, field)}: {reason}") from None
        most = 2.0 * self.reach_spacings + 1.0
        if self.slots < most:
            raise ValueError(f"slots: {most:g} stations may be heard at once")
        return self

    @property
    def reach_m(self) -> float:
        """Distance past which nothing is heard [m]."""
        return self.reach_spacings * self.spacing_m

    @cached_property
    def tones(self) -> TonePlan:
        """The plan of the tones."""
        return TonePlan(
            self.carrier_hz,
            self.sample_rate_hz,
            self.samples,
            self.slots,
            self.slot_spacing_hz,
            self.fastest_kmh / 3.6,
            self.receiver_ppm,
            math.hypot(self.offset_m, self.height_m),
        )


class DeadReference(TimedFault):
    """A reference station that sends nothing."""

    kind: Literal["dead_reference"]
    station: Name = Field(description="its name: ref1, ref2, ... in the order of the tracks")


class DetunedReference(TimedFault):
    """A reference station whose oscillator is off."""

    kind: Literal["detuned_reference"]
    station: Name = Field(description="its name: ref1, ref2, ... in the order of the tracks")
    shift_hz: Number = Field(ge=-2000.0, le=2000.0, description="how far it is off [Hz]")


REFERENCES: Final[Section[ReferencePlan | None]] = Section(
    "references",
    ReferencePlan | None,
    "stations for positions by Doppler shifts; null = none",
    None,
)
