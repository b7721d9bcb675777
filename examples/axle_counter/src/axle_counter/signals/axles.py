"""Where the axles of a train are, from the geometry of its cars.

A train of cars alike: each stands on two bogies whose pivots are ``PIVOT_RATIO`` of its length
apart, with half of its axles in either.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

#: Distance of the pivots over the length of the car: 19.0 m of 26.4 m in the UIC-X coach.
PIVOT_RATIO: Final = 19.0 / 26.4


@dataclass(frozen=True)
class Cars:
    """Cars of a train, all alike; typical magnitudes, assumed here.

    Parameters
    ----------
    length_m : float
        Of a car, about [m]: the train is cut into equal cars that come closest to it.
    axles : int
        Of a car, in two bogies: 2, 4 or 6.
    wheelbase_m : float
        From the first to the last axle of a bogie [m].
    """

    length_m: float = 20.0
    axles: int = 4
    wheelbase_m: float = 2.5

    @property
    def axle_distance_m(self) -> float:
        """From an axle to the next one of its bogie [m]; infinite where that has but one."""
        return self.wheelbase_m / (self.axles // 2 - 1) if self.axles > 2 else float("inf")

    def bogies_m(self, train_m: float) -> NDArray[np.float64]:
        """From the front of a train of a length [m] to the middles of its bogies [bogie] [m]."""
        count = max(1, round(train_m / self.length_m))
        car_m = train_m / count
        middles = (np.arange(count) + 0.5) * car_m
        half_m = 0.5 * PIVOT_RATIO * car_m
        return np.sort(np.concatenate((middles - half_m, middles + half_m)))

    def axles_m(self, train_m: float) -> NDArray[np.float64]:
        """From the front of a train of a length [m] to its axles [axle] [m], increasing.

        >>> Cars(length_m=26.4, axles=4, wheelbase_m=2.5).axles_m(26.4).round(2).tolist()
        [2.45, 4.95, 21.45, 23.95]
        """
        each = self.axles // 2
        own = np.linspace(-0.5, 0.5, each) * self.wheelbase_m if each > 1 else np.zeros(1)
        return np.sort((self.bogies_m(train_m)[:, None] + own).ravel())
