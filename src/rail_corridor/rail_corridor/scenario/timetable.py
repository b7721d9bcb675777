"""Timetables: trains alike that depart one after the other."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from rail_world.line.description_base import Description, Name, StrictFloat
from rail_world.trains.description import TrainDescription

from .section_fields import StrictInt

#: Trains no closer than that [s]; one that finds its entrance taken waits.
LEAST_HEADWAY_S: Final = 30.0


class TrainTemplate(TrainDescription):
    """A train of a timetable; its name is continued by a number from 1 on.

    It enters the line when it departs and leaves it when it arrives, unless told otherwise.
    """

    name: Annotated[Name, Field(max_length=36)] = Field(
        default="train", description="first part of the names"
    )
    enters_at_departure: bool = Field(
        default=True, description="whether the train is not on the line before it departs"
    )
    leaves_on_arrival: bool = Field(
        default=True, description="whether the train is gone when its run ends"
    )


class Timetable(Description):
    """Trains alike that depart one after the other."""

    count: StrictInt = Field(ge=1, le=100, description="number of trains")
    headway_s: StrictFloat = Field(
        ge=LEAST_HEADWAY_S, le=1e5, description="time from one departure to the next [s]"
    )
    train: TrainTemplate = Field(description="the train; its depart_s is that of the first")

    def trains(self) -> tuple[TrainDescription, ...]:
        """Return the trains in order of departure."""
        common = {name: getattr(self.train, name) for name in TrainDescription.model_fields}
        return tuple(
            TrainDescription(
                **{
                    **common,
                    "name": f"{self.train.name}{number + 1}",
                    "depart_s": self.train.depart_s + number * self.headway_s,
                }
            )
            for number in range(self.count)
        )
