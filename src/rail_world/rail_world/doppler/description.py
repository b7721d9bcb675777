"""The validated description of the reference stations and what trains hear of them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from rail_msgs_py.doppler import quantities
from rail_msgs_py.quantities import FAULT_BEGIN, FAULT_END
from rail_world.line.description_base import (
    Chainage,
    Description,
    Length,
    Name,
    StrictFloat,
    range_of,
)
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
    from_s: Annotated[StrictFloat, range_of(FAULT_BEGIN)]
    to_s: Annotated[StrictFloat, range_of(FAULT_END)]
    shift_hz: Annotated[StrictFloat, range_of(quantities.DETUNING)] | None = None

    @model_validator(mode="after")
    def _is_of_its_kind(self) -> ReferenceFault:
        if (self.shift_hz is None) == (self.kind == "detuned_reference"):
            raise ValueError(f"shift_hz: {self.shift_hz} does not agree with {self.kind}")
        return self

    def acts(self, time_s: float) -> bool:
        """Whether it is there at a simulated time [s]."""
        return self.from_s <= time_s < self.to_s


class ReferenceDescription(Description):
    """Everything the medium of the reference tones knows besides where the trains are.

    Powers are radiated ones (EIRP); a train's antenna has no gain and hears all around.
    """

    stations: tuple[ReferenceStation, ...] = Field(min_length=1, max_length=10_000)
    trains: tuple[str, ...] = ()
    tracks: tuple[str, ...] = Field(description="order that counts the tracks")
    carrier_hz: Annotated[StrictFloat, range_of(quantities.CARRIER)]
    sample_rate_hz: Annotated[StrictFloat, range_of(quantities.SAMPLE_RATE)]
    samples: Annotated[int, range_of(quantities.SAMPLES)]
    noise_figure_db: Annotated[StrictFloat, range_of(quantities.NOISE_FIGURE)]
    path_loss_exponent: Annotated[StrictFloat, range_of(quantities.PATH_LOSS_EXPONENT)]
    extra_loss_db: Annotated[StrictFloat, range_of(quantities.EXTRA_LOSS)]
    coverage_range_m: Length = Field(description="beyond which nothing is received [m]")
    receiver_ppm: Annotated[StrictFloat, range_of(quantities.RECEIVER_OFFSET)]
    station_ppb: Annotated[StrictFloat, range_of(quantities.STATION_OFFSET)]
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
