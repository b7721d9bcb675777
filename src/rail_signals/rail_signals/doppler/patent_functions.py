"""The position functions of the patent, as claimed: two stations, a straight or a circle.

Kim et al. (S1) take the ratio of two shifts, which holds neither the speed nor the frequency:

    f_d1 / f_d2 = cos(phi_1) / cos(phi_2),

phi_k the angle between the track and the line to station k, and look for the place where a
function of it is least. As printed it divides by the second shift and by its cosine, which vanish
abeam of station 2; here it is multiplied out,

    f = (f_d1 cos(phi_2) - f_d2 cos(phi_1))^2,

which has the same zeros, besides the true place often another one or two. Of these only those
count where the shifts are those of a train that runs forwards and no faster than it can: with
k the shift straight ahead of a station, ``f_dk = k cos(phi_k)`` and 0 < k <= `most_hz`.

What the claims do not speak of holds here as there: the offset of the receiver must be known and
taken off, two zeros may be left, and a train that stands has no place.
`rail_signals.doppler.solver` needs neither the cases nor these conditions.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import acos, atan2, copysign, cos, hypot, inf, sin, sqrt
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar

from rail_signals.arrays import FloatArray

Shifts: TypeAlias = tuple[float, float]
"""Shifts of the first and the second station [Hz], the receiver's offset taken off."""

_GRID = 401


@dataclass(frozen=True)
class StraightSection:
    """A straight with its x-axis along the track (claims 4 and 11).

    The origin is the point of the track midway between the stations' feet.

    Parameters
    ----------
    half_base_m : float
        The first station is beside ``x = -half_base_m``, the second beside ``+half_base_m``.
    aside_m : (float, float)
        Distances of the stations from the track, of either sign.
    from_m, to_m : float
        Where the section begins and ends.
    """

    half_base_m: float
    aside_m: tuple[float, float]
    from_m: float
    to_m: float

    def cosines(self, x_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Cosines of the angles to both stations."""
        x = np.asarray(x_m, dtype=np.float64)
        first, second = x + self.half_base_m, x - self.half_base_m
        return (
            np.asarray(-first / np.hypot(first, self.aside_m[0])),
            np.asarray(-second / np.hypot(second, self.aside_m[1])),
        )

    def function(self, x_m: ArrayLike, shifts_hz: Shifts) -> FloatArray:
        """The position function f(x) [Hz^2]."""
        return _multiplied_out(self.cosines(x_m), shifts_hz)

    def position(self, shifts_hz: Shifts, most_hz: float = inf) -> tuple[float, float]:
        """Where f(x) is least within the section, and how small it is [m], [Hz^2].

        Examples
        --------
        >>> section = StraightSection(500.0, (50.0, 50.0), -500.0, 500.0)
        >>> one, two = (700.0 * float(c) for c in section.cosines(200.0))
        >>> round(section.position((one, two))[0], 3)
        200.0
        """
        return _least(self, shifts_hz, most_hz, self.from_m, self.to_m)


@dataclass(frozen=True)
class CircularSection:
    """An arc with the stations about the same centre (claims 5 and 12).

    Parameters
    ----------
    radius_m : float
        Of the track.
    stations_m : ((float, float), (float, float))
        Places of the stations, x and y from the centre of the circle.
    from_rad, to_rad : float
        Angles at the centre between which the section lies, anticlockwise from the x-axis; the
        train runs towards greater ones.
    """

    radius_m: float
    stations_m: tuple[tuple[float, float], tuple[float, float]]
    from_rad: float
    to_rad: float

    def angle_to(self, station: int, theta_rad: float) -> float:
        """Angle between the tangent at the train and its line to a station [rad].

        By the law of cosines in the triangle of train, centre and station, whose sides are the
        radius r, the distance rho of the station from the centre, and R,

            cos(alpha) = (r^2 + R^2 - rho^2) / (2 r R),

        alpha the angle at the train between centre and station, a right angle off the tangent.
        """
        x, y = self.stations_m[station]
        r, rho = self.radius_m, hypot(x, y)
        ahead = atan2(y, x) - theta_rad
        square = r * r + rho * rho - 2.0 * r * rho * cos(ahead)
        distance = sqrt(square)
        alpha = acos(max(-1.0, min(1.0, (r * r + square - rho * rho) / (2.0 * r * distance))))
        # sin(alpha) is the cosine to the tangent; on which side tells where the station is.
        return acos(max(-1.0, min(1.0, copysign(sin(alpha), sin(ahead)))))

    def cosines(self, theta_rad: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Cosines of the angles between the direction of travel and both stations."""
        theta = np.atleast_1d(np.asarray(theta_rad, dtype=np.float64))
        both = [[cos(self.angle_to(k, float(t))) for t in theta] for k in (0, 1)]
        shape = np.shape(theta_rad)
        return np.reshape(both[0], shape), np.reshape(both[1], shape)

    def function(self, theta_rad: ArrayLike, shifts_hz: Shifts) -> FloatArray:
        """The position function f(theta) [Hz^2]."""
        return _multiplied_out(self.cosines(theta_rad), shifts_hz)

    def position(self, shifts_hz: Shifts, most_hz: float = inf) -> tuple[float, float]:
        """Where f(theta) is least within the section, and how small it is [rad], [Hz^2]."""
        return _least(self, shifts_hz, most_hz, self.from_rad, self.to_rad)


@dataclass(frozen=True)
class MixedSection:
    """A straight and the arc that follows it (claims 6 and 13).

    The condition by which one of the two answers is chosen, which the claims leave open: that
    with the smaller function of those that lie inside their own section, not at an end of it.
    The functions compare as they are, both being in Hz^2 of the same shifts.

    Parameters
    ----------
    straight, arc
        The same stations, each in the coordinates of its section.
    """

    straight: StraightSection
    arc: CircularSection

    def position(self, shifts_hz: Shifts, most_hz: float = inf) -> tuple[str, float] | None:
        """``("straight", x)`` in metres or ``("arc", theta)`` in radians; None if neither fits."""
        minima: list[tuple[float, str, float]] = []
        for name, section, low, high in (
            ("straight", self.straight, self.straight.from_m, self.straight.to_m),
            ("arc", self.arc, self.arc.from_rad, self.arc.to_rad),
        ):
            place, value = section.position(shifts_hz, most_hz)
            margin = 1e-6 * (high - low)
            if low + margin < place < high - margin:
                minima.append((value, name, place))
        if not minima:
            return None
        _, name, place = min(minima)
        return name, place


def _multiplied_out(cosines: tuple[FloatArray, FloatArray], shifts_hz: Shifts) -> FloatArray:
    one, two = cosines
    return np.asarray((shifts_hz[0] * two - shifts_hz[1] * one) ** 2)


def _least(
    section: StraightSection | CircularSection,
    shifts_hz: Shifts,
    most_hz: float,
    low: float,
    high: float,
) -> tuple[float, float]:
    """Least value of the function of a section: a grid, then Brent's method about its minima.

    An end of the section, with the value there, where no minimum inside counts.
    """
    grid = np.linspace(low, high, _GRID)
    values = section.function(grid, shifts_hz)
    inner = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    minima: list[tuple[float, float]] = []
    for index in inner.tolist():
        near = minimize_scalar(
            lambda at: float(section.function(at, shifts_hz)),
            bounds=(float(grid[index - 1]), float(grid[index + 1])),
            method="bounded",
            options={"xatol": 1e-9 * (high - low)},
        )
        one, two = (float(c) for c in section.cosines(float(near.x)))
        ahead_hz = (shifts_hz[0] * one + shifts_hz[1] * two) / (one * one + two * two)
        if 0.0 < ahead_hz <= most_hz:
            minima.append((float(near.fun), float(near.x)))
    if not minima:
        return (low, float(values[0])) if values[0] < values[-1] else (high, float(values[-1]))
    value, place = min(minima)
    return place, value
