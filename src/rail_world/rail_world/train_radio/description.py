"""The validated description of the CBTC radio: masts, carriers, powers, sections, faults."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_msgs_py.train_radio import quantities
from rail_signals.train_radio.path_loss import Cutting, PathLossSection, Tunnel
from rail_world.line.description_base import (
    Chainage,
    Description,
    Length,
    Name,
    StrictFloat,
    range_of,
)
from rail_world.ranging.description import Channel, Vector

Antennas = Annotated[int, Field(ge=1, le=2, strict=True)]
Hertz = Annotated[StrictFloat, Field(gt=0.0, le=1e11)]
PowerDbm = Annotated[StrictFloat, Field(ge=-150.0, le=80.0)]


class BaseStation(Description):
    """A mast beside the track, which sends and receives on one pair of carriers."""

    name: Name
    track: Name
    chainage_m: Chainage = Field(description="of the foot of the mast on its track [m]")
    position_m: Vector = Field(description="of its antennas in the map frame [m]")
    channel: Channel


class LossSection(Description):
    """A cutting or tunnel on a track, with a loss of `rail_signals.train_radio.path_loss`."""

    kind: Literal["cutting", "tunnel"]
    track: Name
    from_m: Chainage
    to_m: Chainage
    edge_m: StrictFloat = Field(
        default=0.0, ge=0.0, description="over which it begins and ends [m]"
    )
    wall_loss_db: Annotated[StrictFloat, range_of(quantities.ENTRY_LOSS)] | None = None
    entry_loss_db: Annotated[StrictFloat, range_of(quantities.ENTRY_LOSS)] | None = None
    loss_db_per_m: Annotated[StrictFloat, range_of(quantities.TUNNEL_LOSS_PER_M)] | None = None

    @model_validator(mode="after")
    def _is_of_its_kind(self) -> LossSection:
        wanted = {"wall_loss_db": self.kind == "cutting"}
        wanted["entry_loss_db"] = wanted["loss_db_per_m"] = self.kind == "tunnel"
        for field, want in wanted.items():
            value = getattr(self, field)
            if want and value is None:
                raise ValueError(f"{field}: a {self.kind} needs it")
            if not want and value is not None:
                raise ValueError(f"{field}: {value:g} does not go with a {self.kind}")
        self.section()
        return self

    def section(self) -> PathLossSection:
        """Its law of loss."""
        if self.kind == "cutting":
            return Cutting(self.from_m, self.to_m, self.wall_loss_db or 0.0, self.edge_m)
        return Tunnel(
            self.from_m,
            self.to_m,
            self.entry_loss_db or 0.0,
            self.loss_db_per_m or 0.0,
            self.edge_m,
        )


class CbtcFault(Description):
    """Something that goes wrong in the radio, from and to a simulated time.

    ``dead_base_station``: ``base_station`` neither sends nor hears. ``jam``: every receiver on
    ``channel``, of either direction, has ``noise_dbm`` more noise at each of its antennas.
    """

    kind: Literal["dead_base_station", "jam"]
    from_s: Annotated[StrictFloat, range_of(FAULT_BEGIN)]
    to_s: Annotated[StrictFloat, range_of(FAULT_END)]
    base_station: str | None = None
    channel: Channel | None = None
    noise_dbm: PowerDbm = Field(default=-90.0, description="over the whole sample rate [dBm]")

    @model_validator(mode="after")
    def _names_its_place(self) -> CbtcFault:
        if (self.base_station is None) == (self.kind == "dead_base_station"):
            raise ValueError(f"base_station: {self.base_station} does not agree with {self.kind}")
        if (self.channel is None) == (self.kind == "jam"):
            raise ValueError(f"channel: {self.channel} does not agree with {self.kind}")
        return self

    def acts(self, time_s: float) -> bool:
        """Whether it is there at a simulated time [s]."""
        return self.from_s <= time_s < self.to_s


class CbtcDescription(Description):
    """Everything the CBTC medium knows besides where the trains are.

    Powers are radiated ones (EIRP) of all antennas of a sender together, before a receiving
    antenna without gain. Downlink and uplink of a channel have a carrier each (FDD).
    """

    base_stations: tuple[BaseStation, ...] = Field(min_length=1, max_length=10_000)
    trains: tuple[str, ...] = ()
    tracks: tuple[str, ...] = Field(
        default=(), description="order that counts the tracks; empty = as the masts name them"
    )
    downlink_hz: dict[Channel, Hertz] = Field(description="carriers to the trains [Hz]")
    uplink_hz: dict[Channel, Hertz] = Field(description="carriers from the trains [Hz]")
    sample_rate_hz: StrictFloat = Field(gt=0.0, description="of the bursts, both ways [Hz]")
    base_antennas: Antennas
    train_antennas: Antennas
    base_power_dbm: Annotated[StrictFloat, range_of(quantities.BASE_POWER)]
    train_power_dbm: Annotated[StrictFloat, range_of(quantities.TRAIN_POWER)]
    noise_figure_db: Annotated[StrictFloat, range_of(quantities.NOISE_FIGURE)]
    path_loss_exponent: Annotated[StrictFloat, range_of(quantities.PATH_LOSS_EXPONENT)]
    coverage_range_m: Length = Field(description="beyond which nothing is received [m]")
    rician_factor: Annotated[StrictFloat, range_of(quantities.RICIAN_FACTOR)]
    snr_offset_db: Annotated[StrictFloat, range_of(quantities.SNR_OFFSET)]
    sections: tuple[LossSection, ...] = ()
    faults: tuple[CbtcFault, ...] = ()

    @property
    def track_order(self) -> tuple[str, ...]:
        """Names of the tracks in the order that counts them."""
        return self.tracks or tuple(dict.fromkeys(mast.track for mast in self.base_stations))

    @model_validator(mode="after")
    def _agrees(self) -> CbtcDescription:
        names = [mast.name for mast in self.base_stations]
        channels = {mast.channel for mast in self.base_stations}
        for field, values in (("base_stations", names), ("trains", self.trains)):
            twice = _twice(values)
            if twice is not None:
                raise ValueError(f"{field}: {twice} comes twice")
        for mast in self.base_stations:
            if mast.track not in self.track_order:
                raise ValueError(f"base_stations: {mast.name}: there is no track {mast.track}")
            for field in ("downlink_hz", "uplink_hz"):
                if mast.channel not in getattr(self, field):
                    raise ValueError(f"{field}: none for channel {mast.channel} of {mast.name}")
        for section in self.sections:
            if section.track not in self.track_order:
                raise ValueError(f"sections: there is no track {section.track}")
        for fault in self.faults:
            if fault.base_station is not None and fault.base_station not in names:
                raise ValueError(f"faults: there is no base station {fault.base_station}")
            if fault.channel is not None and fault.channel not in channels:
                raise ValueError(f"faults: there is no base station on channel {fault.channel}")
        carriers_hz = sorted([*self.downlink_hz.values(), *self.uplink_hz.values()])
        for one, other in pairwise(carriers_hz):
            if other - one < self.sample_rate_hz:
                raise ValueError(
                    f"carriers of {one:g} and {other:g} Hz are nearer than {self.sample_rate_hz:g}"
                )
        return self


def _twice(names: Iterable[str]) -> str | None:
    """A name that comes twice."""
    seen: set[str] = set()
    for name in names:
        if name in seen:
            return name
        seen.add(name)
    return None
