"""The section on reference stations, by whose Doppler shifts trains are located; its faults."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import StrictInt
from rail_msgs_py.doppler import quantities
from rail_signals.doppler.tone_plan import TonePlan
from rail_world.line.description_base import Description, Name, StrictFloat, field_of


class ReferencePlan(Description):
    """Reference stations, by whose Doppler shifts trains find their place (Kim et al.)."""

    spacing_m: StrictFloat = Field(
        default=600.0, ge=50.0, le=20_000.0, description="no station is farther apart [m]"
    )
    offset_m: StrictFloat = field_of(quantities.OFFSET)
    height_m: StrictFloat = field_of(quantities.HEIGHT)
    carrier_hz: StrictFloat = field_of(quantities.CARRIER)
    sample_rate_hz: StrictFloat = field_of(quantities.SAMPLE_RATE)
    samples: StrictInt = field_of(quantities.SAMPLES)
    slots: StrictInt = field_of(quantities.SLOTS)
    slot_spacing_hz: StrictFloat = field_of(quantities.SLOT_SPACING)
    power_dbm: StrictFloat = field_of(quantities.POWER)
    noise_figure_db: StrictFloat = field_of(quantities.NOISE_FIGURE)
    path_loss_exponent: StrictFloat = field_of(quantities.PATH_LOSS_EXPONENT)
    extra_loss_db: StrictFloat = field_of(quantities.EXTRA_LOSS)
    reach_spacings: StrictFloat = Field(
        default=2.5, ge=1.0, le=10.0, description="nothing is received beyond this many spacings"
    )
    receiver_ppm: StrictFloat = field_of(quantities.RECEIVER_OFFSET)
    station_ppb: StrictFloat = field_of(quantities.STATION_OFFSET)
    fastest_kmh: StrictFloat = field_of(quantities.FASTEST)

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
            raise ValueError(f"slots: {most:g} stations may be received at once")
        return self

    @property
    def coverage_range_m(self) -> float:
        """Distance beyond which nothing is received [m]."""
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
    shift_hz: StrictFloat = field_of(quantities.DETUNING)


REFERENCES: Final[Section[ReferencePlan | None]] = Section(
    "references",
    ReferencePlan | None,
    "stations for positions by Doppler shifts; null = none",
    None,
)
