"""What befalls trains and the line, by the time: stops, brakes, rails, boards."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

from .description import (
    LowAdhesion,
    ReducedBraking,
    SpeedRestriction,
    TrainStop,
)
from .drive_command import DriveCommand
from .motion import TrainMotion

_STOPS = DriveCommand(emergency_brake=True)
_Timed = TrainStop | ReducedBraking | LowAdhesion | SpeedRestriction


@dataclass(frozen=True)
class Conditions:
    """Faults of trains and restrictions of the line.

    Parameters
    ----------
    stops : sequence of TrainStop
    reduced : sequence of ReducedBraking
    slippery : sequence of LowAdhesion
    restrictions : sequence of SpeedRestriction
        As boards, which drivers see; none where supervision tells them.
    """

    stops: Sequence[TrainStop] = ()
    reduced: Sequence[ReducedBraking] = ()
    slippery: Sequence[LowAdhesion] = ()
    restrictions: Sequence[SpeedRestriction] = ()

    def commands(
        self, time_s: float, imposed: Mapping[str, DriveCommand]
    ) -> Mapping[str, DriveCommand]:
        """What is imposed on trains by name, those that stop of themselves among them."""
        stopped = {each.train: _STOPS for each in self.stops if _now(each, time_s)}
        return {**imposed, **stopped} if stopped else imposed

    def apply(self, time_s: float, trains: Sequence[TrainMotion]) -> None:
        """Set brakes, rails and boards of the trains; of several faults the worst counts."""
        if self.reduced or self.slippery:
            for train in trains:
                brakes, name = train.brakes, train.name
                weak = [e for e in self.reduced if e.train == name and _now(e, time_s)]
                wet = [e for e in self.slippery if e.train == name and _now(e, time_s)]
                brakes.service_factor = min((e.service for e in weak), default=1.0)
                brakes.emergency_factor = min((e.emergency for e in weak), default=1.0)
                brakes.adhesion = min((e.adhesion for e in wet), default=inf)
        if self.restrictions:
            boards = tuple(each for each in self.restrictions if _now(each, time_s))
            for train in trains:
                train.restrict(boards)


def _now(fault: _Timed, time_s: float) -> bool:
    return fault.from_s <= time_s < fault.to_s
