"""The odometers of all trains: what their wheels count in each tick."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .description import TrainDescription, WheelSlip
from .wheels import Wheels, pulse_m, wheel_errors


class Odometers:
    """Odometers of the trains whose wheels are listened to.

    Parameters
    ----------
    seed : int
    sigma : float
        Standard deviation of the relative error of the wheels' diameters.
    trains : sequence of str
        Those that are listened to.
    descriptions : sequence of TrainDescription
        Of all.
    slips : sequence of WheelSlip
    """

    def __init__(
        self,
        seed: int,
        sigma: float,
        trains: Sequence[str],
        descriptions: Sequence[TrainDescription],
        slips: Sequence[WheelSlip],
    ) -> None:
        steps = {each.name: pulse_m(each.vehicle) for each in descriptions}
        errors = wheel_errors(seed, sigma, trains)
        self._wheels = {
            train: Wheels(error, (), steps.get(train, 0.0)) for train, error in errors.items()
        }
        self.slip(slips)

    def slip(self, slips: Sequence[WheelSlip]) -> None:
        """Have wheels slip at other times, all else being as it was."""
        for train, wheels in self._wheels.items():
            wheels.slips = tuple(slip for slip in slips if slip.train == train)

    def count(
        self, time_s: float, travelled: Mapping[str, tuple[float, float]]
    ) -> Iterator[tuple[str, NDArray[np.float64]]]:
        """Each train with its reading, distance [m] and speed [m/s], [1, 2]."""
        for train, wheels in self._wheels.items():
            yield train, np.array([wheels.count(time_s, *travelled[train])])
