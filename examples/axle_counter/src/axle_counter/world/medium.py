"""The medium of the wheel sensors: from the true motion of trains to the amplitudes of coils.

A block is what happens during the tick that ends at its stamp: its last sample is of that very
moment, and the next block goes on one sample later. So every sample of a run is delivered once, and
no wheel is lost between two blocks.

Between the ends of a tick a train moves along the cubic with the places and speeds that it has
there (Hermite): exact for a constant acceleration, and without a jump from one block to the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rail_world.line.description_base import whole_samples
from rail_world.line.network import Network
from rail_world.line.route import Route
from rail_world.trains.description import TrainDescription

from .description import WheelSensorDescription

#: Keeps the noise apart from that of other equipment with the same seed.
_STREAM = 0x61786C65


@dataclass(frozen=True)
class Motion:
    """Where a train is at the end of a tick.

    ``path_m`` along its route, ``speed_mps`` its derivative, and whether it is on the line at all.
    """

    path_m: float
    speed_mps: float
    on_line: bool


class _Train:
    """Axles and magnets of one train, and the sensors on its way."""

    def __init__(
        self, train: TrainDescription, described: WheelSensorDescription, network: Network
    ) -> None:
        length_m = train.vehicle.length_m
        self.name = train.name
        # The reference point is the front in the first direction, and stays so.
        self.axles_m = -train.direction * described.cars.axles_m(length_m)
        self.bogies_m = -train.direction * described.cars.bogies_m(length_m)
        route = network.route(train.route, train.direction)
        self.sensors_m = {
            index: on_path
            for index, place in enumerate(described.places)
            if (on_path := path_on(route, place.track, place.at_m)) is not None
        }
        self.before: Motion | None = None


def path_on(route: Route, track: str, at_m: float) -> float | None:
    """Place of a point of a track along a route [m], None if the route does not pass it."""
    for leg in route.legs:
        if leg.track.name == track and at_m <= leg.end_m:
            return leg.path_start_m + at_m
    return None


class WheelSensorMedium:
    """Amplitudes of the coils of all wheel sensors, tick by tick.

    Parameters
    ----------
    described : WheelSensorDescription
    trains : sequence of TrainDescription
    network : Network
    seed : int
        Of the noise, which depends on nothing else but sensor and tick.
    tick_s : float

    Raises
    ------
    ValueError
        If a tick is not a whole number of samples.
    """

    def __init__(
        self,
        described: WheelSensorDescription,
        trains: Sequence[TrainDescription],
        network: Network,
        seed: int,
        tick_s: float,
    ) -> None:
        self._described, self._tick_s = described, tick_s
        self._sensor = described.sensor
        self._samples = whole_samples(described.sample_rate_hz, tick_s)
        self._trains = [_Train(train, described, network) for train in trains]
        self._coils_m = np.array(described.sensor.coils_m)[:, None]
        self._keys = [
            np.random.SeedSequence(seed, spawn_key=(_STREAM, index)).generate_state(2, np.uint64)
            for index in range(len(described.places))
        ]
        # Part of the tick that has gone by at each sample, and the cubic's four weights.
        u = np.arange(1, self._samples + 1) / self._samples
        self._weights = np.stack(
            (
                (1.0 + 2.0 * u) * (1.0 - u) ** 2,
                u**2 * (3.0 - 2.0 * u),
                u * (1.0 - u) ** 2 * tick_s,
                u**2 * (u - 1.0) * tick_s,
            )
        )

    def blocks(self, tick: int, motions: Sequence[Motion]) -> NDArray[np.float64]:
        """Amplitudes of all coils [sensor, coil, sample] [V] during the tick that ends now.

        Parameters
        ----------
        tick : int
            Number of the tick; to be called for each in turn.
        motions : sequence of Motion
            Of each train at its end.
        """
        shape = (len(self._described.places), 2, self._samples)
        amplitudes_v = np.full(shape, self._sensor.rest_v)
        time_s = tick * self._tick_s
        for train, motion in zip(self._trains, motions, strict=True):
            if motion.on_line:
                self._damp(amplitudes_v, train, self._path(train.before, motion), time_s)
            train.before = motion if motion.on_line else None
        if self._described.noise_v:
            for index, key in enumerate(self._keys):
                words = np.random.Philox(key=key, counter=[0, 0, 0, tick])
                noise = np.random.Generator(words).standard_normal(shape[1:])
                amplitudes_v[index] += self._described.noise_v * noise
        return amplitudes_v

    def _path(self, before: Motion | None, now: Motion) -> NDArray[np.float64]:
        """Place of a train along its path [sample] [m]; it stands where it has just appeared."""
        if before is None:
            return np.full(self._samples, now.path_m)
        ends = (before.path_m, now.path_m, before.speed_mps, now.speed_mps)
        return np.asarray(ends) @ self._weights

    def _damp(
        self,
        amplitudes_v: NDArray[np.float64],
        train: _Train,
        path_m: NDArray[np.float64],
        time_s: float,
    ) -> None:
        reach_m = self._coils_m[1, 0] + 0.5 * self._sensor.pulse_m
        low_m, high_m = float(path_m.min()) - reach_m, float(path_m.max()) + reach_m
        magnets = [
            fault
            for fault in self._described.rail_brakes
            if fault.train == train.name and fault.from_s <= time_s < fault.to_s
        ]
        for index, sensor_m in train.sensors_m.items():
            for axle in _near(train.axles_m, sensor_m, low_m, high_m):
                u_m = path_m + train.axles_m[axle] - sensor_m - self._coils_m
                strength = self._strength(index, axle, time_s)
                amplitudes_v[index] -= strength * self._sensor.dip_v(u_m)
            for fault in magnets:
                half_m = 0.5 * fault.length_m
                for bogie in _near(train.bogies_m, sensor_m, low_m - half_m, high_m + half_m):
                    u_m = path_m + train.bogies_m[bogie] - sensor_m - self._coils_m
                    amplitudes_v[index] -= self._sensor.dip_v(u_m, half_m)

    def _strength(self, sensor: int, axle: int, time_s: float) -> float:
        """How much of its due damping an axle of a train has at a sensor."""
        point = self._described.places[sensor].point
        for fault in self._described.missed_axles:
            here = fault.point == point and fault.from_s <= time_s < fault.to_s
            if here and (axle + 1) % fault.every == 0:
                return fault.left
        return 1.0


def _near(bodies_m: NDArray[np.float64], sensor_m: float, low_m: float, high_m: float) -> list[int]:
    """Bodies of a train that come near a sensor while the train is between two places."""
    from_train_m = sensor_m - bodies_m
    found: list[int] = np.flatnonzero((from_train_m > low_m) & (from_train_m < high_m)).tolist()
    return found
