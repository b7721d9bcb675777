"""The section of a scenario on train control by radio."""

from __future__ import annotations

from pathlib import Path
from typing import Final, Literal

from pydantic import Field, model_validator

from rail_corridor.scenario.faults import Fault, TimedFault
from rail_corridor.scenario.model import Section
from rail_corridor.scenario.section_fields import StrictInt
from rail_msgs_py.quantities import CAB_SIGNALS, FAULT_BEGIN, ODOMETER_ERROR
from rail_msgs_py.train_radio import quantities
from rail_msgs_py.train_radio.quantities import carrier_hz
from rail_msgs_py.train_radio.unit_clock import MOST_DRIFT_PPM, MOST_OFFSET_S
from rail_world.line.description_base import Chainage, Description, Name, StrictFloat, field_of
from rail_world.train_radio.threat_description import Threats


class LossPlan(Description):
    """A stretch of a track where the train radio is weaker."""

    kind: Literal["cutting", "tunnel"] = Field(description="what it is")
    track: Name = Field(description="track it lies on")
    from_m: Chainage = Field(description="start [m]")
    to_m: Chainage = Field(description="end [m]")
    entry_db: StrictFloat = field_of(quantities.ENTRY_LOSS)
    db_per_km: StrictFloat = field_of(quantities.TUNNEL_LOSS)

    @model_validator(mode="after")
    def _has_a_length(self) -> LossPlan:
        if self.to_m <= self.from_m:
            raise ValueError(f"to_m: must be after from_m, {self.from_m:g} m")
        if self.kind == "cutting" and self.db_per_km:
            raise ValueError(f"db_per_km: {self.db_per_km:g} does not go with a cutting")
        return self


class BrakeBand(Description):
    """Guaranteed brake rates up to a speed, from the one of the band before."""

    up_to_kmh: StrictFloat = Field(gt=0.0, le=600.0, description="up to this speed [km/h]")
    braking_mps2: StrictFloat = field_of(quantities.BRAKING)
    emergency_mps2: StrictFloat = field_of(quantities.EMERGENCY_BRAKING)

    @model_validator(mode="after")
    def _brakes_agree(self) -> BrakeBand:
        if self.emergency_mps2 < self.braking_mps2:
            raise ValueError(f"emergency_mps2: is weaker than braking_mps2, {self.braking_mps2:g}")
        return self


class CbtcPlan(Description):
    """Train control by radio: base stations, link and margins.

    With this section trains run on the movement authorities that they receive.
    """

    base_spacing_m: StrictFloat = Field(
        default=1200.0, ge=50.0, le=20_000.0, description="no base station is farther apart [m]"
    )
    scheme: quantities.Scheme = field_of(quantities.SCHEME)
    constellation: quantities.Constellation = field_of(quantities.CONSTELLATION)
    symbol_rate_hz: StrictFloat = field_of(quantities.SYMBOL_RATE)
    samples_per_symbol: StrictInt = field_of(quantities.SAMPLES_PER_SYMBOL)
    pilot_period: StrictInt = field_of(quantities.PILOT_PERIOD)
    channels: StrictInt = field_of(quantities.CHANNELS)
    carrier_hz: StrictFloat = field_of(quantities.CARRIER)
    spacing_hz: StrictFloat = field_of(quantities.CARRIER_SPACING)
    duplex_hz: StrictFloat = field_of(quantities.DUPLEX_SPACING)
    base_power_dbm: StrictFloat = field_of(quantities.BASE_POWER)
    train_power_dbm: StrictFloat = field_of(quantities.TRAIN_POWER)
    extra_loss_db: StrictFloat = field_of(quantities.EXTRA_LOSS)
    path_loss_exponent: StrictFloat = field_of(quantities.PATH_LOSS_EXPONENT)
    noise_figure_db: StrictFloat = field_of(quantities.NOISE_FIGURE)
    rician_factor: StrictFloat = field_of(quantities.RICIAN_FACTOR)
    mast_offset_m: StrictFloat = Field(
        default=6.0, ge=0.5, le=100.0, description="off the track [m]"
    )
    mast_height_m: StrictFloat = Field(
        default=8.0, ge=0.0, le=100.0, description="base station above the train antenna [m]"
    )
    losses: tuple[LossPlan, ...] = Field(
        default=(), max_length=100, description="cuttings and tunnels"
    )
    braking_mps2: StrictFloat = field_of(quantities.BRAKING)
    emergency_mps2: StrictFloat = field_of(quantities.EMERGENCY_BRAKING)
    brake_bands: tuple[BrakeBand, ...] = Field(
        default=(), max_length=20, description="guaranteed rates that hold up to other speeds"
    )
    brake_confidence: StrictFloat = field_of(quantities.BRAKE_CONFIDENCE)
    brake_adhesion: StrictFloat = field_of(quantities.BRAKE_ADHESION)
    buffer_m: StrictFloat = field_of(quantities.BUFFER)
    cycle_s: StrictFloat = field_of(quantities.ATP_CYCLE)
    report_period_s: StrictFloat = field_of(quantities.REPORT_PERIOD)
    authority_period_s: StrictFloat = field_of(quantities.AUTHORITY_PERIOD)
    margin_m: StrictFloat = field_of(quantities.MARGIN)
    timeout_s: StrictFloat = field_of(quantities.AUTHORITY_TIMEOUT)
    keys: str | None = Field(
        default=None,
        min_length=1,
        max_length=1000,
        # Neither recordings nor the scenario that the world announces say where secrets lie.
        exclude=True,
        description="YAML file with the key of each train and the zone controller, made by "
        "`rail keys`, named relative to the scenario; null = keys that follow from the seed",
    )
    cab_signals: bool = field_of(CAB_SIGNALS)
    odometer_error: StrictFloat = field_of(ODOMETER_ERROR)

    @model_validator(mode="after")
    def _brakes_agree(self) -> CbtcPlan:
        if self.emergency_mps2 < self.braking_mps2:
            raise ValueError(f"emergency_mps2: is weaker than braking_mps2, {self.braking_mps2:g}")
        speeds = [band.up_to_kmh for band in self.brake_bands]
        if speeds != sorted(set(speeds)):
            raise ValueError(f"brake_bands: {speeds} km/h do not rise")
        return self

    def located(self, directory: Path) -> CbtcPlan:
        """The section with the names of its files made absolute."""
        if self.keys is None:
            return self
        return self.model_copy(update={"keys": str((directory / self.keys).absolute())})

    @property
    def downlinks_hz(self) -> dict[int, float]:
        """Downlink carrier of each channel [Hz]."""
        return {
            channel: carrier_hz(channel, self.carrier_hz, self.spacing_hz)
            for channel in range(1, self.channels + 1)
        }

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
    rate: StrictFloat = field_of(quantities.THREAT_RATE)
    longest_delay_s: StrictFloat = field_of(quantities.LONGEST_DELAY)

    @property
    def subject(self) -> str:
        """The threats."""
        return ", ".join(threat.value for threat in self.threats)


class ClockError(Fault):
    """A unit whose clock is wrong from a time on, until another such fault of its begins."""

    kind: Literal["clock"]
    node: str = Field(
        max_length=200,
        description="full name of a unit with a clock: `/train_1/atp` or "
        "`/wayside/zone_controller`",
    )
    offset_s: StrictFloat = Field(
        default=0.0,
        ge=-MOST_OFFSET_S,
        le=MOST_OFFSET_S,
        description="by how much it is ahead then [s]",
    )
    drift_ppm: StrictFloat = Field(
        default=0.0,
        ge=-MOST_DRIFT_PPM,
        le=MOST_DRIFT_PPM,
        description="how much it gains from then on [ppm]; frames are exchanged up to 200",
    )
    from_s: StrictFloat = field_of(FAULT_BEGIN)


CBTC: Final[Section[CbtcPlan | None]] = Section(
    "cbtc", CbtcPlan | None, "train control by radio, which trains obey; null = none", None
)
