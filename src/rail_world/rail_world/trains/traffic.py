"""All trains of the corridor: stepped together, their truth as one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import inf

import numpy as np
from numpy.typing import NDArray

from rail_world.line.network import Network
from rail_world.line.route import Route

from .conditions import Conditions
from .description import TrainDescription
from .drive_command import DriveCommand
from .motion import TrainMotion
from .occupancy import Fouling, Occupant, next_ahead, overlaps

STEP_M = 0.25
MOST_POINTS = 400_000
#: Kept free on both sides of a train that enters [m].
ENTRANCE_MARGIN_M = 10.0


class Traffic:
    """The trains in the order of their description.

    Parameters
    ----------
    descriptions : sequence of TrainDescription
    network : Network
    tick_s : float
        Step.
    conditions : Conditions, optional
        What befalls the trains; may be exchanged for others on the way.
    """

    def __init__(
        self,
        descriptions: Sequence[TrainDescription],
        network: Network,
        tick_s: float,
        conditions: Conditions | None = None,
    ) -> None:
        self.conditions = conditions or Conditions()
        self._tick_s = tick_s
        self._ticks = 0
        self._fouling = Fouling(network)
        self.names = tuple(description.name for description in descriptions)
        #: As they are: for judging alone.
        self.trains = [TrainMotion(d, network, tick_s) for d in descriptions]
        self._descriptions = tuple(descriptions)
        self._track_index = {name: index for index, name in enumerate(network.tracks)}
        # Trains with the same route are located in one call.
        groups: dict[tuple[str, ...], list[int]] = {}
        for index, train in enumerate(self.trains):
            groups.setdefault(tuple(train.route.tracks), []).append(index)
        self._groups = [
            (CentreLine(self.trains[members[0]].route), members) for members in groups.values()
        ]
        self._state = np.zeros((len(self.trains), 10))
        #: Where those on the line are.
        self.occupants = self._occupants()

    def step(self, commands: Mapping[str, DriveCommand] | None = None) -> None:
        """Move every train by one tick, under what supervision imposes on it by name."""
        self._ticks += 1
        time_s = self._ticks * self._tick_s
        self.conditions.apply(time_s, self.trains)
        imposed = self.conditions.commands(time_s, commands or {})
        there = self.occupants
        steps = []
        for index, (name, train) in enumerate(zip(self.names, self.trains, strict=True)):
            command = imposed.get(name)
            ahead_m, free = inf, True
            if command is not None and command.on_sight:
                ahead_m, _ = self.next_ahead(index)
            if train.due and train.description.enters_at_departure:
                free = self.in_the_way(index, there) is None
                if free:  # nobody else enters there in this tick
                    there = [*there, self._occupant(index)]
            steps.append((train, command, free, ahead_m))
        for train, command, free, ahead_m in steps:
            train.step(command, may_depart=free, free_ahead_m=ahead_m)
        self.occupants = self._occupants()

    def next_ahead(self, index: int) -> tuple[float, int]:
        """Way to the next train ahead [m], and its index; infinite, and its own, without one."""
        train = self.trains[index]
        return next_ahead(train.route, train.front_m, train.direction, index, self.occupants)

    def in_the_way(self, index: int, occupants: Sequence[Occupant]) -> int | None:
        """Who is where a train is to enter, or within its braking distance; None if nobody is.

        Of those that run, the way that they need to stop counts as well.
        """
        train = self.trains[index]
        first = self._occupant(index, train.description.speed_kmh / 3.6, ENTRANCE_MARGIN_M)
        for other in occupants:
            moved = self._occupant(other.train, other.speed_mps)
            if other.train != index and next(overlaps((first, moved)), None) is not None:
                return other.train
        return None

    def _occupants(self) -> list[Occupant]:
        there = range(len(self.trains))
        return [self._occupant(index) for index in there if self._on_line(index)]

    def _occupant(self, index: int, speed_mps: float = 0.0, margin_m: float = 0.0) -> Occupant:
        return occupant(index, self.trains[index], self._fouling, speed_mps, margin_m)

    def travelled(self) -> dict[str, tuple[float, float]]:
        """Distance [m] and speed [m/s] of the rims of the wheels of each train."""
        return {
            name: (train.wheel_distance_m, abs(train.speed_mps) + train.brakes.creep_mps)
            for name, train in zip(self.names, self.trains, strict=True)
        }

    def state(self) -> NDArray[np.float64]:
        """The truth [train, column], columns as ``STATE.columns``.

        The array is reused: copy what must last.
        """
        state = self._state
        for index, train in enumerate(self.trains):
            state[index, 0] = train.path_m
            state[index, 5] = train.speed_mps
            state[index, 6] = train.acceleration_mps2
            state[index, 7] = self._track_index[train.track]
            state[index, 8] = train.chainage_m
            state[index, 9] = self._on_line(index)
        for line, members in self._groups:
            state[members, 1:5] = line.at(state[members, 0])
        return state

    def places(self) -> Iterator[tuple[str, str, float, float]]:
        """Name, track, chainage [m] and speed [m/s] of each train."""
        for name, train in zip(self.names, self.trains, strict=True):
            yield name, train.track, train.chainage_m, train.speed_mps

    @property
    def all_arrived(self) -> bool:
        """Whether no train has anywhere left to go."""
        return all(train.state == "arrived" for train in self.trains)

    def on_line(self, index: int) -> bool:
        """Whether a train is on the line: not before it enters, nor after it has left."""
        return self._on_line(index) > 0.0

    def _on_line(self, index: int) -> float:
        """1 where the train is on the line: not before it enters, nor after it has left."""
        train, description = self.trains[index], self._descriptions[index]
        if description.enters_at_departure and train.state == "waiting":
            return 0.0
        return 0.0 if description.leaves_on_arrival and train.state == "arrived" else 1.0


def occupant(
    index: int,
    train: TrainMotion,
    fouling: Fouling,
    speed_mps: float = 0.0,
    margin_m: float = 0.0,
) -> Occupant:
    """Where a train is, with the way to a stand from a speed, and a margin at both ends."""
    way_m = 0.5 * speed_mps * speed_mps / train.planned_deceleration_mps2
    low_m = train.low_m - margin_m - (way_m if train.direction < 0 else 0.0)
    high_m = train.high_m + margin_m + (way_m if train.direction > 0 else 0.0)
    stretches = tuple(fouling.stretches(train.route, low_m, high_m))
    return Occupant(index, stretches, train.direction, abs(train.speed_mps))


class CentreLine:
    """Pose along a route by a table: what every tick asks for.

    Points `STEP_M` apart are off an arc of 300 m radius by 0.03 mm.
    """

    def __init__(self, route: Route) -> None:
        count = min(max(2, round(route.length_m / STEP_M) + 1), MOST_POINTS)
        self._path_m = np.linspace(0.0, route.length_m, count)
        pose = route.pose(self._path_m)
        columns = (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)
        self._poses = np.stack(columns, axis=1)
        self._per_metre = (count - 1) / route.length_m

    def at(self, path_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """x, y, z [m] and heading [rad] of each point, [point, 4]."""
        place = path_m * self._per_metre
        before = np.clip(place.astype(np.intp), 0, len(self._poses) - 2)
        fraction = (place - before)[:, None]
        return self._poses[before] * (1.0 - fraction) + self._poses[before + 1] * fraction
