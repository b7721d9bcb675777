"""The validated description of the reference stations and what trains hear of them."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from rail_world.line.description_base import Chainage, Description, Length, Name, Number
from rail_world.ranging.description import Vector


class ReferenceStation(Description):
    """A station beside the track that sends a tone."""

    name: Name
    track: Name
    chainage_m: Chainage = Field(description="of its foot on the track [m]")
    position_m: Vector = Field(description="of its antenna in the map frame [m]")


class ReferenceFault(Description):
    """Something that goes wrong with a station, from and to a simulated time.

    ``dead_reference``: it is silent. ``detuned_reference``: it sends `shift_hz` too high.
    """

    kind: Literal["dead_reference", "detuned_reference"]
    station: Name
    from_s: Number = Field(default=0.0, ge=0.0)
    to_s: Number = Field(default=1e9, ge=0.0)
    shift_hz: Number = Field(default=0.0, ge=-1e5, le=1e5, description="of its oscillator [Hz]")

    def acts(self, time_s: float) -> bool:
        """Whether it is there at a simulated time [s]."""
        return self.from_s <= time_s < self.to_s


class ReferenceDescription(Description):
    """Everything the medium of the reference tones knows besides where the trains are.

    Powers are radiated ones (EIRP); a train's antenna has no gain and hears all around. The
    defaults are typical magnitudes, assumed here.
    """

    stations: tuple[ReferenceStation, ...] = Field(min_length=1, max_length=10_000)
    trains: tuple[str, ...] = ()
    tracks: tuple[str, ...] = Field(description="order that counts the tracks")
    carrier_hz: Number = Field(gt=0.0, le=1e11)
    sample_rate_hz: Number = Field(gt=0.0, le=1e8)
    samples: int = Field(gt=0, le=1 << 20, description="in a block")
    noise_figure_db: Number = Field(default=8.0, ge=0.0, le=30.0)
    path_loss_exponent: Number = Field(default=2.0, ge=1.5, le=6.0)
    extra_loss_db: Number = Field(
        default=0.0, ge=-60.0, le=120.0, description="taken from every link [dB]"
    )
    reach_m: Length = Field(default=2000.0, description="past which nothing is heard [m]")
    receiver_ppm: Number = Field(
        default=0.5, ge=0.0, le=10.0, description="largest offset of a train's oscillator [ppm]"
    )
    station_ppb: Number = Field(
        default=0.01, ge=0.0, le=1000.0, description="standard deviation of a station's [ppb]"
    )
    faults: tuple[ReferenceFault, ...] = ()

    @model_validator(mode="after")
    def _agrees(self) -> ReferenceDescription:
        names = [station.name for station in self.stations]
        for field, values in (("stations", names), ("trains", list(self.trains))):
            if len(set(values)) < len(values):
                raise ValueError(f"{field}: a name comes twice")
        for station in self.stations:
            if station.track not in self.tracks:
                raise ValueError(f"stations: {station.name}: there is no track {station.track}")
        for fault in self.faults:
            if fault.station not in names:
                raise ValueError(f"faults: there is no reference station {fault.station}")
        return self
