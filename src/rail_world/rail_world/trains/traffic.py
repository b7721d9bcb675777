"""All trains of the corridor: stepped together, their truth as one table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from rail_world.line.network import Network
from rail_world.line.route import Route

from .description import TrainDescription
from .drive_command import DriveCommand
from .motion import TrainMotion

STEP_M = 0.25
MOST_POINTS = 400_000


class Traffic:
    """The trains in the order of their description.

    Parameters
    ----------
    descriptions : sequence of TrainDescription
    network : Network
    tick_s : float
        Step.
    """

    def __init__(
        self, descriptions: Sequence[TrainDescription], network: Network, tick_s: float
    ) -> None:
        self.names = tuple(description.name for description in descriptions)
        self._trains = [TrainMotion(d, network, tick_s) for d in descriptions]
        self._descriptions = tuple(descriptions)
        self._track_index = {name: index for index, name in enumerate(network.tracks)}
        # Trains with the same route are located in one call.
        groups: dict[tuple[str, ...], list[int]] = {}
        for index, train in enumerate(self._trains):
            groups.setdefault(tuple(train.route.tracks), []).append(index)
        self._groups = [
            (CentreLine(self._trains[members[0]].route), members) for members in groups.values()
        ]
        self._state = np.zeros((len(self._trains), 10))

    def step(self, commands: Mapping[str, DriveCommand] | None = None) -> None:
        """Move every train by one tick, under what supervision imposes on it by name."""
        imposed = commands or {}
        for name, train in zip(self.names, self._trains, strict=True):
            train.step(imposed.get(name))

    def travelled(self) -> dict[str, tuple[float, float]]:
        """Distance travelled [m] and speed [m/s] of each train."""
        return {
            name: (train.distance_m, abs(train.speed_mps))
            for name, train in zip(self.names, self._trains, strict=True)
        }

    def state(self) -> NDArray[np.float64]:
        """The truth [train, column], columns as ``STATE.columns``.

        The array is reused: copy what must last.
        """
        state = self._state
        for index, train in enumerate(self._trains):
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
        for name, train in zip(self.names, self._trains, strict=True):
            yield name, train.track, train.chainage_m, train.speed_mps

    @property
    def all_arrived(self) -> bool:
        """Whether no train has anywhere left to go."""
        return all(train.state == "arrived" for train in self._trains)

    def _on_line(self, index: int) -> float:
        """1 where the train is on the line: not before it enters, nor after it has left."""
        train, description = self._trains[index], self._descriptions[index]
        if description.enters_at_departure and train.state == "waiting":
            return 0.0
        return 0.0 if description.leaves_on_arrival and train.state == "arrived" else 1.0


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
