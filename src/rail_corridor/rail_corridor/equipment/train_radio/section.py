"""The section of a scenario on train control by radio."""

from __future__ import annotations

from typing import Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import Frequency, Power, Whole
from rail_world.line.description_base import Chainage, Description, Name, Number
from rail_world.train_radio.threat_description import LONGEST_DELAY_S, LongestDelay, Rate, Threats


class LossPlan(Description):
    """A stretch of a track where the train radio is weaker."""

    kind: Literal["cutting", "tunnel"] = Field(description="what it is")
    track: Name = Field(description="track it lies on")
    from_m: Chainage = Field(description="begin [m]")
    to_m: Chainage = Field(description="end [m]")
    entry_db: Number = Field(
        default=10.0, ge=0.0, le=100.0, description="of the walls, or of a portal [dB]"
    )
    db_per_km: Number = Field(default=0.0, ge=0.0, le=1000.0, description="within a tunnel [dB/km]")

    @model_validator(mode="after")
    def _has_a_length(self) -> LossPlan:
        if self.to_m <= self.from_m:
            raise ValueError(f"to_m: must be after from_m, {self.from_m:g} m")
        if self.kind == "cutting" and self.db_per_km:
            raise ValueError(f"db_per_km: {self.db_per_km:g} does not go with a cutting")
        return self


class CbtcPlan(Description):
    """Train control by radio: base stations, link and margins.

    With this section trains run on the movement authorities that they receive.
    """

    base_spacing_m: Number = Field(
        default=1200.0, ge=50.0, le=20_000.0, description="no base station is farther apart [m]"
    )
    scheme: Literal["siso", "mrc", "alamouti_2x1", "alamouti_2x2"] = Field(
        default="alamouti_2x2", description="antennas and code (An et al., eqs 1 to 9)"
    )
    constellation: Literal["bpsk", "qpsk", "16qam"] = Field(
        default="qpsk", description="symbols of the bursts"
    )
    symbol_rate_hz: Frequency = Field(default=100e3, description="symbols per second")
    samples_per_symbol: Whole = Field(default=2, ge=2, le=16, description="complex samples")
    pilot_period: Whole = Field(
        default=16, ge=1, le=1024, description="data symbols from pilots to pilots"
    )
    channels: Whole = Field(
        default=3, ge=2, le=8, description="channel pairs that base stations use in turn"
    )
    carrier_hz: Number = Field(
        default=2.4e9, ge=1e7, le=1e11, description="downlink of channel 1 [Hz]"
    )
    spacing_hz: Frequency = Field(default=1e6, description="distance of two channels [Hz]")
    duplex_hz: Frequency = Field(default=50e6, description="uplink above downlink [Hz]")
    base_power_dbm: Power = Field(default=20.0, description="of all antennas together [dBm]")
    train_power_dbm: Power = Field(default=20.0, description="of all antennas together [dBm]")
    extra_loss_db: Number = Field(
        default=0.0, ge=-60.0, le=120.0, description="taken from every link, for sweeps [dB]"
    )
    path_loss_exponent: Number = Field(
        default=2.5, ge=1.5, le=6.0, description="2 = free space; counts from 1 m"
    )
    noise_figure_db: Number = Field(default=8.0, ge=0.0, le=30.0, description="receivers [dB]")
    rician_factor: Number = Field(
        default=0.0, ge=0.0, le=1000.0, description="line of sight over scattered; 0 = Rayleigh"
    )
    mast_offset_m: Number = Field(default=6.0, ge=0.5, le=100.0, description="off the track [m]")
    mast_height_m: Number = Field(
        default=8.0, ge=0.0, le=100.0, description="base station above the train antenna [m]"
    )
    losses: tuple[LossPlan, ...] = Field(
        default=(), max_length=100, description="cuttings and tunnels"
    )
    braking_mps2: Number = Field(
        default=0.7, ge=0.1, le=2.0, description="service braking that is counted on [m/s^2]"
    )
    emergency_mps2: Number = Field(
        default=0.9, ge=0.1, le=3.0, description="emergency braking that is counted on [m/s^2]"
    )
    margin_m: Number = Field(
        default=10.0, ge=0.0, le=1000.0, description="kept behind a train ahead [m]"
    )
    timeout_s: Number = Field(
        default=3.0, ge=0.5, le=60.0, description="age of an authority that makes a train brake [s]"
    )
    cab_signals: bool = Field(
        default=True, description="drivers keep to the permitted speed before the brake makes them"
    )
    odometer_error: Number = Field(
        default=0.005, ge=0.0, le=0.1, description="standard deviation of the wheels' error"
    )

    @model_validator(mode="after")
    def _brakes_agree(self) -> CbtcPlan:
        if self.emergency_mps2 < self.braking_mps2:
            raise ValueError(f"emergency_mps2: is weaker than braking_mps2, {self.braking_mps2:g}")
        return self

    @property
    def downlinks_hz(self) -> dict[int, float]:
        """Downlink carrier of each channel [Hz]."""
        return {n: self.carrier_hz + (n - 1) * self.spacing_hz for n in range(1, self.channels + 1)}

    @property
    def uplinks_hz(self) -> dict[int, float]:
        """Uplink carrier of each channel [Hz]."""
        return {n: carrier_hz + self.duplex_hz for n, carrier_hz in self.downlinks_hz.items()}


class DeadBaseStation(TimedFault):
    """A base station of the train radio that neither sends nor hears."""

    kind: Literal["dead_base_station"]
    base: Name = Field(description="its name: base1, base2, ... in the order of the tracks")


class NetworkThreats(TimedFault):
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

    @property
    def subject(self) -> str:
        """The threats."""
        return ", ".join(threat.value for threat in self.threats)


CBTC: Final[Section[CbtcPlan | None]] = Section(
    "cbtc", CbtcPlan | None, "train control by radio, which trains obey; null = none", None
)
