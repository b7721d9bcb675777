"""Where a train stands next: stops, points of turning back, the end of its run."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal

from rail_world.errors import WorldDataError
from rail_world.line.route import Route
from rail_world.trains.description import ReversalDescription, TrainDescription

from .driver import nearest_ahead

# Two points closer than this are one stop.
SAME_PLACE_M = 1.0

Kind = Literal["start", "stop", "extra", "reversal", "end"]


@dataclass(frozen=True)
class Target:
    """Where the train will stand next.

    Parameters
    ----------
    path_m : float
        Path distance [m].
    kind : str
        A stop of the track, an extra one, a reversal, or the end of the track.
    """

    path_m: float
    kind: Kind


class Itinerary:
    """The points a train stands at, resolved on its route.

    Parameters
    ----------
    description : TrainDescription
        The train.
    route : Route
        Its route.

    Raises
    ------
    WorldDataError
        For a point off the route, or one to turn back at that does not lie ahead.
    """

    def __init__(self, description: TrainDescription, route: Route) -> None:
        self._length_m = route.length_m
        first = description.route[0]

        def place(field: str, track: str | None, at_m: float) -> float:
            try:
                return route.path_of(track or first, at_m)
            except ValueError as error:
                field = f"trains.{description.name}.{field}"
                raise WorldDataError(field, at_m, str(error)) from None

        self.start_m = place("start_m", None, description.start_m)
        self._regular = {1: list(route.stops_m), -1: [-s for s in reversed(route.stops_m)]}
        extra = sorted(
            place(f"stop_at_m.{i}", p.track, p.at_m) for i, p in enumerate(description.stop_at_m)
        )
        self._extra = {1: extra, -1: [-s for s in reversed(extra)]}
        self._reversals: list[tuple[float | None, ReversalDescription]] = [
            (
                None if r.at_m is None else place(f"reverse_at.{i}.at_m", r.track, r.at_m),
                r,
            )
            for i, r in enumerate(description.reverse_at)
        ]
        self._check_reversals(description)

    def _check_reversals(self, description: TrainDescription) -> None:
        from_m, direction = self.start_m, description.direction
        for index, (path_m, reversal) in enumerate(self._reversals):
            if path_m is None:  # a time: where the train will be is not known here
                return
            if direction * (path_m - from_m) <= SAME_PLACE_M:
                raise WorldDataError(
                    f"trains.{description.name}.reverse_at.{index}.at_m",
                    reversal.at_m,
                    "is not ahead of the train there",
                )
            from_m, direction = path_m, -direction

    @property
    def next_reversal(self) -> ReversalDescription | None:
        """The next reversal to come."""
        return self._reversals[0][1] if self._reversals else None

    def reversed(self) -> None:
        """Strike out the reversal just done."""
        del self._reversals[0]

    def next_target(self, at: Target, direction: int) -> Target | None:
        """Where to stand next, coming from a place in a direction; None at the end of the run."""
        s = direction * at.path_m
        regular = nearest_ahead(self._regular[direction], s, SAME_PLACE_M)
        extra = nearest_ahead(self._extra[direction], s, SAME_PLACE_M)
        reversal = inf
        if self._reversals and self._reversals[0][0] is not None:
            reversal = direction * self._reversals[0][0]
            if reversal - s <= SAME_PLACE_M:
                reversal = inf
        nearest = min(regular, extra, reversal)
        if nearest < inf:
            kind: Kind = "stop"
            if reversal - nearest <= SAME_PLACE_M:
                nearest, kind = reversal, "reversal"
            elif regular - nearest <= SAME_PLACE_M:
                nearest = regular
            else:
                kind = "extra"
            return Target(direction * nearest, kind)
        if at.kind == "stop":
            return None
        end_m = self._length_m if direction > 0 else 0.0
        return Target(end_m, "end") if abs(end_m - at.path_m) > SAME_PLACE_M else None
