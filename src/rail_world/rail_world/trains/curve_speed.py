"""The speed at which a train leaves the rails in a curve.

On a circle of radius R, with a cant that makes up for the acceleration a_c, a train of gauge s
whose centre of mass is h above the rails begins to tip over its outer wheels at

    v^2 / R - a_c = g s / (2 h)

(quasi-static, without wind and without springs). Assumed: s = 1.5 m between the contact points,
h = 1.8 m; and the cant that balances the speed limit there, but no more than 150 mm, none on
points, by which a branch leaves its track.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from rail_signals.arrays import FloatArray
from rail_world.line.network import Network
from rail_world.line.route import Route

from .vehicle import GRAVITY_MPS2

GAUGE_M: Final = 1.5
CENTRE_OF_MASS_M: Final = 1.8
MOST_CANT_M: Final = 0.150
#: Length of points from their tip, without cant [m].
POINTS_M: Final = 50.0
_STEP_M: Final = 5.0
_STRAIGHT_PER_M: Final = 1e-6


class CurveSpeed:
    """What the curves of one route bear.

    Parameters
    ----------
    route : Route
    network : Network
    """

    def __init__(self, route: Route, network: Network) -> None:
        count = max(2, int(np.ceil(route.length_m / _STEP_M)) + 1)
        path_m = np.linspace(0.0, route.length_m, count)
        self._per_metre = (count - 1) / route.length_m
        curvature = np.abs(route.curvature_per_m(path_m))
        limits_mps = route.limits_mps.at(path_m)
        with np.errstate(invalid="ignore"):
            balanced = np.where(curvature > _STRAIGHT_PER_M, curvature * limits_mps**2, 0.0)
        cant_mps2 = np.minimum(balanced, GRAVITY_MPS2 * MOST_CANT_M / GAUGE_M)
        for leg in route.legs:
            if network.parent_junction(leg.track.name) is not None:
                on_points = (path_m >= leg.path_start_m) & (path_m <= leg.path_start_m + POINTS_M)
                cant_mps2[on_points] = 0.0
        bears_mps2 = GRAVITY_MPS2 * GAUGE_M / (2.0 * CENTRE_OF_MASS_M) + cant_mps2
        self._mps: FloatArray = np.full(count, np.inf)
        curved = curvature > _STRAIGHT_PER_M
        self._mps[curved] = np.sqrt(bears_mps2[curved] / curvature[curved])
        #: What every place of the route bears [m/s].
        self.least_mps = float(self._mps.min())

    def between(self, low_m: float, high_m: float) -> float:
        """What the curves under a train between two path distances bear [m/s]."""
        first = max(int(low_m * self._per_metre), 0)
        last = max(int(high_m * self._per_metre) + 2, first + 1)
        return float(self._mps[first:last].min(initial=np.inf))
