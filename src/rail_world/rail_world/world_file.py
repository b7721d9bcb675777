"""The truth as one JSON file, which the world and its media read when they start."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.quantities import ODOMETER_ERROR, SEED, TICK
from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.description_base import range_of
from rail_world.line.drawing import Drawing
from rail_world.line.network import Network, build_network
from rail_world.trains.conditions import Conditions
from rail_world.trains.description import (
    LowAdhesion,
    ReducedBraking,
    SpeedRestriction,
    TrainDescription,
    TrainStop,
    WheelSlip,
)

Part = TypeVar("Part", bound=BaseModel)


class WorldFile(BaseModel):
    """Tracks, trains and media of one run.

    Paths in it are absolute: the file may lie anywhere.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    seed: Annotated[int, range_of(SEED)]
    tick_s: Annotated[float, range_of(TICK)]
    tracks: dict[str, TrackDescription]
    junctions: tuple[JunctionDescription, ...] = ()
    trains: tuple[TrainDescription, ...]
    parts: dict[str, dict[str, Any]] = Field(
        {}, description="what the media of all equipment know, by its name"
    )
    drawing: Drawing = Drawing()
    stops: tuple[TrainStop, ...] = ()
    slips: tuple[WheelSlip, ...] = ()
    reduced_braking: tuple[ReducedBraking, ...] = ()
    low_adhesion: tuple[LowAdhesion, ...] = ()
    boards: tuple[SpeedRestriction, ...] = Field(
        (), description="restrictions that drivers see; none where supervision tells them"
    )
    quiet_from_s: float = Field(0.0, description="when the last fault has ended, infinite = never")
    scenario: str = Field("", description="JSON, announced as it is on /world/scenario")
    odometer_error: Annotated[float, range_of(ODOMETER_ERROR)]

    @property
    def tick_ns(self) -> int:
        """Length of a tick in nanoseconds."""
        return round(self.tick_s * 1e9)

    def part(self, name: str, kind: type[Part]) -> Part:
        """What the media of one kind of equipment know.

        Raises
        ------
        LookupError
            If there is no such equipment.
        pydantic.ValidationError
        """
        if name not in self.parts:
            raise LookupError(f"describes no {name}")
        return kind.model_validate(self.parts[name])

    @property
    def conditions(self) -> Conditions:
        """What befalls the trains."""
        return Conditions(self.stops, self.reduced_braking, self.low_adhesion, self.boards)

    def network(self) -> Network:
        """The tracks, joined."""
        return build_network(self.tracks, self.junctions)


def read_world_file(path: str) -> WorldFile:
    """Read and validate the world file that a parameter names.

    Raises
    ------
    ParameterError
        If there is none, or it describes no world.
    """
    try:
        if not path:
            raise OSError(0, "a file is needed")
        return WorldFile.model_validate_json(Path(path).read_bytes())
    except OSError as error:
        reason = error.strerror or "cannot be read"
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        reason = f"{where}: {first['msg']}" if where else first["msg"]
    raise ParameterError(f"world_file: {path!r}: {reason}")
