"""The sections of phase ranging: stations, channels, signal, radio, transponders; its faults."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import (
    ChannelNumber,
    ChannelPair,
    StrictInt,
)
from rail_msgs_py.ranging import quantities
from rail_msgs_py.ranging.quantities import carrier_hz
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.ranging.signal import RangingSignal
from rail_world.line.description_base import (
    Chainage,
    Description,
    Name,
    StrictFloat,
    field_of,
    range_of,
)

LONGEST_ZONE_M: Final = 2000.0
SHORTEST_ZONE_M: Final = 20.0


class StationPosition(Description):
    """One station placed by hand: at a chainage, or where a branch clears its junction."""

    name: Name = Field(description="name of the station")
    track: Name | None = Field(default=None, description="track it stands at")
    at_m: Chainage | None = Field(default=None, description="chainage it stands at [m]")
    junction: Name | None = Field(
        default=None, description="instead: branch whose fouling point it stands at"
    )
    zone: Name | None = Field(
        default=None, description="name of its zone (on the main track at a junction)"
    )
    branch_zone: Name | None = Field(
        default=None, description="at a junction: name of its zone on the branch"
    )

    @model_validator(mode="after")
    def _one_place(self) -> StationPosition:
        if self.junction is None:
            for name in ("track", "at_m"):
                if getattr(self, name) is None:
                    raise ValueError(f"{name}: a station has track and at_m, or junction")
            if self.branch_zone is not None:
                raise ValueError("branch_zone: goes with junction only")
        else:
            for name in ("track", "at_m"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: does not go with junction")
        return self


class StationPlan(Description):
    """Where the wayside ranging stations (WRS) stand, by rule or one by one."""

    zone_length_m: Annotated[StrictFloat, Field(ge=SHORTEST_ZONE_M, le=LONGEST_ZONE_M)] | None = (
        Field(default=None, description="automatic placing: no zone is longer than this [m]")
    )
    positions: tuple[StationPosition, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        description="instead of zone_length_m: every station",
    )
    mast_offset_m: StrictFloat = Field(
        default=3.0, ge=0.5, le=20.0, description="mast to the right of the track [m]"
    )
    mast_height_m: StrictFloat = Field(
        default=5.0, ge=0.0, le=50.0, description="station antenna above the train antenna [m]"
    )
    fouling_distance_m: StrictFloat = Field(
        default=4.5,
        ge=2.0,
        le=20.0,
        description="distance of branch and main track where the junction's station stands [m]",
    )

    @model_validator(mode="after")
    def _one_rule(self) -> StationPlan:
        if (self.zone_length_m is None) == (self.positions is None):
            raise ValueError("zone_length_m: give either zone_length_m or positions")
        return self


class ChannelPlan(Description):
    """Pairs [downlink, uplink] that zones use in turn (Jeong et al., Figs 7 and 8)."""

    main: tuple[ChannelPair, ...] = field_of(quantities.MAIN_PAIRS, min_length=1, max_length=20)
    branch: tuple[ChannelPair, ...] = Field(
        default=((5, 6), (7, 8)),
        min_length=1,
        max_length=20,
        description="pairs in turn along a branch",
    )
    first_carrier_hz: StrictFloat = field_of(quantities.FIRST_CARRIER)
    spacing_hz: StrictFloat = field_of(quantities.CARRIER_SPACING)

    @model_validator(mode="after")
    def _each_once(self) -> ChannelPlan:
        used: set[int] = set()
        for name, pairs in (("main", self.main), ("branch", self.branch)):
            for index, pair in enumerate(pairs):
                for channel in pair:
                    if channel in used:
                        raise ValueError(f"{name}.{index}: channel {channel} is used twice")
                    used.add(channel)
        return self

    @property
    def numbers(self) -> tuple[int, ...]:
        """Every channel of the plan, sorted."""
        return tuple(sorted(c for pair in (*self.main, *self.branch) for c in pair))

    @property
    def carriers_hz(self) -> dict[int, float]:
        """Carrier frequency [Hz] of every channel of the plan."""
        return {c: carrier_hz(c, self.first_carrier_hz, self.spacing_hz) for c in self.numbers}


class RangingPlan(Description):
    """The ranging signal and how its phase is compared."""

    tone_hz: StrictFloat = field_of(quantities.TONE)
    deviation_hz: StrictFloat = field_of(quantities.DEVIATION)
    low_tone_hz: Annotated[StrictFloat, range_of(quantities.TONE)] | None = Field(
        default=None, description="two_tone: tone that resolves the cycle of the other [Hz]"
    )
    low_deviation_hz: Annotated[StrictFloat, range_of(quantities.DEVIATION)] | None = Field(
        default=None, description="two_tone: its peak FM deviation [Hz]; null = low_tone_hz"
    )
    sample_rate_hz: StrictFloat = field_of(quantities.SAMPLE_RATE)
    samples: StrictInt = field_of(quantities.SAMPLES)
    comparator: quantities.Comparator = field_of(quantities.COMPARATOR)

    @model_validator(mode="after")
    def _makes_a_signal(self) -> RangingPlan:
        if (self.comparator == "two_tone") != (self.low_tone_hz is not None):
            raise ValueError("low_tone_hz: goes with comparator two_tone, which needs it")
        if self.low_deviation_hz is not None and self.low_tone_hz is None:
            raise ValueError("low_deviation_hz: goes with comparator two_tone only")
        if self.low_tone_hz is not None and self.low_tone_hz >= self.tone_hz:
            raise ValueError(f"low_tone_hz: must be below tone_hz, {self.tone_hz:g} Hz")
        try:
            _ = self.signal
        except ValueError as error:
            field, _, reason = str(error).partition(" ")
            names = {"tones_hz": "tone_hz", "deviations_hz": "deviation_hz"}
            raise ValueError(f"{names.get(field, field)}: {reason}") from None
        return self

    @cached_property
    def signal(self) -> RangingSignal:
        """The signal that stations send."""
        tones, deviations = [self.tone_hz], [self.deviation_hz]
        if self.low_tone_hz is not None:
            tones.append(self.low_tone_hz)
            deviations.append(self.low_deviation_hz or self.low_tone_hz)
        return RangingSignal(tuple(tones), tuple(deviations), self.sample_rate_hz, self.samples)

    @property
    def unambiguous_range_m(self) -> float:
        """Longest range that the comparator tells from a shorter one [m] (Jeong et al., eq. 13).

        A quarter of the wavelength for the AND comparator, half of it for the others; with two
        tones the lower one counts.
        """
        tone_hz = self.low_tone_hz or self.tone_hz
        return SPEED_OF_LIGHT_M_PER_S / ((4.0 if self.comparator == "and" else 2.0) * tone_hz)


class RadioPlan(Description):
    """Powers, antennas, noise and propagation."""

    wrs_power_dbm: StrictFloat = field_of(quantities.WRS_POWER)
    vrs_power_dbm: StrictFloat = field_of(quantities.VRS_POWER)
    noise_figure_db: StrictFloat = field_of(quantities.NOISE_FIGURE)
    path_loss_exponent: StrictFloat = field_of(quantities.PATH_LOSS_EXPONENT)
    reach_zones: StrictFloat = Field(
        default=2.0,
        ge=1.0,
        le=10.0,
        description="nothing is received beyond this many zone lengths (Jeong et al., 2.5: two)",
    )
    wrs_gain_dbi: StrictFloat = field_of(quantities.WRS_GAIN)
    wrs_beamwidth_deg: StrictFloat = field_of(quantities.WRS_BEAMWIDTH)
    vrs_gain_dbi: StrictFloat = field_of(quantities.VRS_GAIN)
    vrs_beamwidth_deg: StrictFloat = field_of(quantities.VRS_BEAMWIDTH)
    front_to_back_db: StrictFloat = field_of(quantities.FRONT_TO_BACK)
    oscillator_ppm: StrictFloat = field_of(quantities.OSCILLATOR)


class TransponderPlan(Description):
    """The delay of the transponders on board, and how well the calibration rig knows it."""

    delay_s: StrictFloat = field_of(quantities.TRANSPONDER_DELAY)
    spread_s: StrictFloat = Field(
        default=5e-9,
        ge=0.0,
        le=1e-6,
        description="standard deviation of the delay from one unit to the next [s]",
    )
    calibration_bursts: StrictInt = Field(
        default=400, ge=1, le=100_000, description="bursts on the calibration rig"
    )


class DeadStation(TimedFault):
    """A station that neither sends nor receives."""

    kind: Literal["dead_station"]
    station: Name = Field(description="its name")


class Jam(TimedFault):
    """A jammer: band-limited noise on one channel, from a place at the track."""

    kind: Literal["jam"]
    channel: ChannelNumber = Field(description="channel it jams")
    power_dbm: StrictFloat = field_of(quantities.JAMMER_POWER)
    track: Name = Field(description="track it stands at")
    at_m: Chainage = Field(description="chainage it stands at [m]")

    @property
    def subject(self) -> str:
        """Its channel."""
        return f"CH{self.channel}"


STATIONS: Final[Section[StationPlan]] = Section(
    "stations", StationPlan, "the wayside ranging stations"
)
CHANNELS: Final[Section[ChannelPlan]] = Section(
    "channels", ChannelPlan, "radio channels", ChannelPlan()
)
SIGNAL: Final[Section[RangingPlan]] = Section(
    "ranging", RangingPlan, "ranging signal", RangingPlan()
)
RADIO: Final[Section[RadioPlan]] = Section("radio", RadioPlan, "radio link", RadioPlan())
TRANSPONDER: Final[Section[TransponderPlan]] = Section(
    "transponder", TransponderPlan, "on board", TransponderPlan()
)
