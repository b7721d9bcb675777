"""Timetables: trains alike that depart one after the other."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field, model_validator

from rail_world.description import Description, Name, Number, TrainDescription

from .sections import Whole

CLEARING_TIME_S: Final = 30.0
"""Time after which a departed train has left the place it departed from [s]."""


class TrainTemplate(TrainDescription):
    """A train of a timetable; its name is continued by a number from 1 on."""

    name: Annotated[Name, Field(max_length=36)] = Field(
        default="train", description="first part of the names"
    )


class Timetable(Description):
    """Trains alike that depart one after the other."""

    count: Whole = Field(ge=1, le=100, description="number of trains")
    headway_s: Number = Field(
        ge=CLEARING_TIME_S, le=1e5, description="time from one departure to the next [s]"
    )
    train: TrainTemplate = Field(description="the train; its depart_s is that of the first")

    @model_validator(mode="after")
    def _from_standstill(self) -> Timetable:
        if self.train.speed_kmh > 0.0:
            raise ValueError("train.speed_kmh: trains of a timetable start from standstill")
        return self

    def trains(self) -> tuple[TrainDescription, ...]:
        """Return the trains in order of departure."""
        common = {name: getattr(self.train, name) for name in self.train.model_fields_set}
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
