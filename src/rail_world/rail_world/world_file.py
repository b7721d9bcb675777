"""The truth as one JSON file, which the world and its media read when they start."""

from __future__ import annotations

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field

from rail_world.doppler.description import ReferenceDescription
from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.network import Network, build_network
from rail_world.ranging.description import RadioDescription, ZoneExtent
from rail_world.track_code.description import RailDescription
from rail_world.train_bus.description import BusDescription
from rail_world.train_radio.description import CbtcDescription
from rail_world.train_radio.threat_description import ThreatPeriod
from rail_world.trains.description import TrainDescription


class TrainStop(BaseModel):
    """A train that brakes to a stand by itself, from one time [s] to another."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    train: str
    from_s: float
    to_s: float


class WheelSlip(BaseModel):
    """Wheels that turn `ratio` times as fast as the train runs, from one time [s] to another."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    train: str
    from_s: float
    to_s: float
    ratio: float = Field(ge=0.0, le=10.0)


class WorldFile(BaseModel):
    """Tracks, trains and media of one run.

    Paths in it are absolute: the file may lie anywhere.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    seed: int = Field(ge=0)
    tick_s: float = Field(gt=0.0)
    tracks: dict[str, TrackDescription]
    junctions: tuple[JunctionDescription, ...] = ()
    trains: tuple[TrainDescription, ...]
    radio: RadioDescription
    rails: RailDescription | None = None
    cbtc: CbtcDescription | None = None
    threats: tuple[ThreatPeriod, ...] = Field(
        (), description="what an intruder does to the frames on the backbone"
    )
    references: ReferenceDescription | None = None
    bus: BusDescription | None = None
    stops: tuple[TrainStop, ...] = ()
    slips: tuple[WheelSlip, ...] = ()
    zones: tuple[ZoneExtent, ...] = ()
    scenario: str = Field("", description="JSON, announced as it is on /world/scenario")
    odometer_error: float = Field(
        0.005, ge=0.0, le=0.1, description="standard deviation of the wheels' relative error"
    )

    @property
    def tick_ns(self) -> int:
        """Length of a tick in nanoseconds."""
        return round(self.tick_s * 1e9)

    def network(self) -> Network:
        """The tracks, joined."""
        return build_network(self.tracks, self.junctions)


def read_world_file(path: str) -> WorldFile:
    """Read and validate a world file.

    Raises
    ------
    OSError, pydantic.ValidationError
    """
    return WorldFile.model_validate_json(Path(path).read_bytes())
