"""Forces on a train along its path.

Equation of motion, with m the mass and f the rotating mass factor:

    f m dv/dt = F - (a + b v + c v^2) - m g (sin(slope) + r)     driving
                                                                 (F < 0: braking)

``F`` is limited by tractive effort and by power, ``a + b v + c v^2`` is the Davis resistance, and
``r`` the specific curve resistance after Roeckl. Slope and curve resistance are means over the
length of the train, whose mass is spread evenly.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt

import numpy as np
import numpy.typing as npt

from rail_signals.arrays import FloatArray
from rail_world.line.route import Route
from rail_world.trains.description import VehicleDescription

GRAVITY_MPS2 = 9.80665
_PANEL_M = 10.0


def curve_resistance(curvature_per_m: npt.ArrayLike) -> FloatArray:
    """Specific curve resistance for standard gauge, force over weight [1].

    Roeckl: 650 / (R - 55) N/kN for radii from 300 m, 500 / (R - 30) N/kN below. The formula was
    never meant for radii below 100 m; there the value at 100 m is kept.

    Parameters
    ----------
    curvature_per_m : array_like [...]
        Curvature of either sign [1/m].

    Examples
    --------
    >>> round(float(curve_resistance(1 / 705.0)), 9)
    0.001
    """
    curvature = np.minimum(np.abs(np.asarray(curvature_per_m, dtype=np.float64)), 1.0 / 100.0)
    # Written with the curvature k = 1/R: 650 / (R - 55) = 650 k / (1 - 55 k).
    wide = 0.650 * curvature / (1.0 - 55.0 * curvature)
    tight = 0.500 * curvature / (1.0 - 30.0 * curvature)
    resistance: FloatArray = np.where(curvature <= 1.0 / 300.0, wide, tight)
    return resistance


class Vehicle:
    """A train set's forces, as accelerations of its effective mass; plain floats in and out.

    Parameters
    ----------
    description : VehicleDescription
        The figures.
    """

    def __init__(self, description: VehicleDescription) -> None:
        self.effective_mass_kg = description.mass_kg * description.rotating_mass_factor
        self.length_m = description.length_m
        self.max_speed_mps = description.max_speed_kmh / 3.6
        self.service_brake_mps2 = description.max_service_brake_mps2
        self.emergency_brake_mps2 = description.emergency_brake_mps2
        self.brake_build_up_s = description.brake_build_up_s
        #: Rotating over all of the mass, as speeds of the train move it.
        self.rotating_share = 1.0 - 1.0 / description.rotating_mass_factor
        # Weight over effective mass: turns a specific force into an acceleration.
        self.gravity_mps2 = GRAVITY_MPS2 / description.rotating_mass_factor
        self._traction_mps2 = description.max_traction_n / self.effective_mass_kg
        self._power_w_per_kg = description.max_power_w / self.effective_mass_kg
        self._a = description.davis.a_n / self.effective_mass_kg
        self._b = description.davis.b_n_per_mps / self.effective_mass_kg
        self._c = description.davis.c_n_per_mps2 / self.effective_mass_kg

    def running_resistance_mps2(self, speed_mps: float) -> float:
        """Deceleration by the Davis resistance at a speed, not negative."""
        return self._a + speed_mps * (self._b + speed_mps * self._c)

    def traction_mps2(self, speed_mps: float) -> float:
        """Acceleration by full traction at a speed, resistances not counted."""
        if self._traction_mps2 * speed_mps <= self._power_w_per_kg:
            return self._traction_mps2
        return self._power_w_per_kg / speed_mps


class _Cumulative:
    """Piecewise linear function given by its corners; the end slopes go on outside."""

    def __init__(self, positions_m: Sequence[float], values: Sequence[float]) -> None:
        self._x = [float(x) for x in positions_m]
        self._y = [float(y) for y in values]
        self._slope = [
            (y1 - y0) / (x1 - x0)
            for x0, x1, y0, y1 in zip(self._x, self._x[1:], self._y, self._y[1:], strict=False)
        ]
        self._last = len(self._slope) - 1

    def at(self, x: float) -> float:
        index = min(max(bisect_right(self._x, x) - 1, 0), self._last)
        return self._y[index] + self._slope[index] * (x - self._x[index])


@dataclass(frozen=True)
class Extent:
    """Where the train reaches from its reference point, along the path.

    Parameters
    ----------
    below_m, above_m : float
        Length towards decreasing and increasing path distance [m].
    """

    below_m: float
    above_m: float


class LineForces:
    """Slope and curve resistance along a route, averaged over a train.

    Parameters
    ----------
    route : Route
        The path.
    extent : Extent
        The train about its reference point.
    """

    def __init__(self, route: Route, extent: Extent) -> None:
        self._extent = extent
        self._length_m = extent.below_m + extent.above_m
        gradients = route.gradients_permil
        corners = [*gradients.starts_m.tolist(), route.length_m]
        self._height = _Cumulative(corners, (1e-3 * gradients.integral(corners)).tolist())
        self._curve = _curve_work(route)
        self.level = not gradients.values.any()
        self.steepest = 1e-3 * float(np.max(np.abs(gradients.values)))

    def slope_sine(self, path_m: float) -> float:
        """Sine of the mean slope under the train, uphill towards increasing path positive."""
        if self.level:
            return 0.0
        above = self._height.at(path_m + self._extent.above_m)
        slope = (above - self._height.at(path_m - self._extent.below_m)) / self._length_m
        return slope / sqrt(1.0 + slope * slope)

    def curve_resistance(self, path_m: float) -> float:
        """Mean specific curve resistance under the train [1]."""
        if self._curve is None:
            return 0.0
        above = self._curve.at(path_m + self._extent.above_m)
        return (above - self._curve.at(path_m - self._extent.below_m)) / self._length_m


def _curve_work(route: Route) -> _Cumulative | None:
    """Integral of the specific curve resistance along the path, None where all is straight."""
    positions: list[float] = [0.0]
    work: list[float] = [0.0]
    for leg in route.legs:
        start_m = 0.0
        for element in leg.track.alignment.elements:
            end_m = min(start_m + element.length_m, leg.end_m)
            if end_m <= start_m:
                break
            k0, k1 = element.start_curvature_per_m, element.end_curvature_per_m
            panels = 1 if k0 == k1 else int(np.ceil((end_m - start_m) / _PANEL_M))
            s = np.linspace(0.0, end_m - start_m, panels + 1)
            middle = 0.5 * (s[:-1] + s[1:])
            at_middle = curve_resistance(k0 + (k1 - k0) * middle / element.length_m)
            steps = work[-1] + np.cumsum(at_middle * np.diff(s))
            # A joint closer to the last than rounding adds nothing.
            for x, y in zip((leg.path_start_m + start_m + s[1:]).tolist(), steps, strict=True):
                if x > positions[-1]:
                    positions.append(x)
                    work.append(float(y))
            start_m = end_m
    return _Cumulative(positions, work) if work[-1] > 0.0 else None
