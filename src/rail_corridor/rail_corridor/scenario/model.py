"""A scenario: one situation, whatever equipment is in it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, Generic, TypeVar, cast

from pydantic import Field, SerializeAsAny, model_validator
from typing_extensions import Self

from rail_msgs_py.quantities import END_WHEN_ARRIVED, SEED, TICK
from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.description_base import Description, Name, StrictFloat, field_of
from rail_world.line.network import Network, build_network
from rail_world.trains.description import TrainDescription

from .actions import ReleaseOnSight
from .faults import Fault
from .section_fields import StrictInt
from .timetable import Timetable

Plan = TypeVar("Plan")
Derived = TypeVar("Derived")

_MOST_TICKS: Final = 10_000_000


class Scenario(Description):
    """One situation: tracks, trains, equipment, faults and the seed of every draw.

    Equipment adds a `Section` each; `rail_corridor.loading.schema` makes the whole model.
    """

    name: Name = Field(description="name of the scenario")
    description: str = Field(default="", max_length=1000, description="one line about it")
    seed: StrictInt = field_of(SEED)
    duration_s: StrictFloat = Field(gt=0.0, le=1e5, description="simulated time [s]")
    end_when_arrived: bool = field_of(END_WHEN_ARRIVED)
    tick_s: StrictFloat = field_of(TICK)
    tracks: dict[Name, TrackDescription] = Field(max_length=100, description="tracks by name")
    junctions: tuple[JunctionDescription, ...] = Field(
        default=(), max_length=100, description="facing points that join the tracks"
    )
    trains: tuple[TrainDescription, ...] = Field(
        default=(), max_length=100, description="trains one by one"
    )
    timetable: Timetable | None = Field(
        default=None, description="trains alike; they become part of trains on loading"
    )
    faults: tuple[SerializeAsAny[Fault], ...] = Field(
        default=(), max_length=1000, description="what goes wrong, and when"
    )
    actions: tuple[ReleaseOnSight, ...] = Field(
        default=(), max_length=1000, description="what people do, and when"
    )

    @model_validator(mode="after")
    def _has_few_ticks(self) -> Scenario:
        if math.ceil(self.duration_s / self.tick_s - 1e-9) > _MOST_TICKS:
            raise ValueError(f"duration_s: is more than ten million ticks of {self.tick_s:g} s")
        return self

    @property
    def ticks(self) -> int:
        """Number of ticks that cover the duration."""
        return math.ceil(self.duration_s / self.tick_s - 1e-9)

    @cached_property
    def network(self) -> Network:
        """The tracks in the map frame; WorldDataError if they do not fit together."""
        return build_network(self.tracks, self.junctions)

    @cached_property
    def derived(self) -> dict[Any, Any]:
        """What functions have made of this scenario; see `derive`."""
        return {}

    def derive(self, function: Callable[[Any], Derived]) -> Derived:
        """What a function makes of this scenario, computed once."""
        if function not in self.derived:
            self.derived[function] = function(self)
        return cast("Derived", self.derived[function])

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Copy with changes; what was derived is not taken along."""
        copy = super().model_copy(update=update, deep=deep)
        for name in copy.__dict__.keys() - type(self).model_fields.keys():
            del copy.__dict__[name]
        return copy

    def to_json(self) -> str:
        """Return the scenario as JSON, for another process or a recording."""
        return self.model_dump_json(exclude_unset=True)


@dataclass(frozen=True)
class Section(Generic[Plan]):
    """A section of a scenario: what one kind of equipment adds to the file.

    Parameters
    ----------
    name : str
        Of the field.
    kind : type
        Model of the section, or ``Model | None`` where it may be missing.
    description : str
    default
        Value without the field; `needed` if there is none.
    """

    name: str
    kind: Any
    description: str
    default: Any = ...

    def of(self, scenario: Scenario) -> Plan:
        """The section of a scenario."""
        return cast("Plan", getattr(scenario, self.name))
