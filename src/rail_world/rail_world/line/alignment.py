"""Plane curve of a track: straights, circular arcs and clothoids, exactly.

Symbols
-------
    s        chainage inside an element                                        [m]
    kappa    curvature, counter-clockwise positive (REP 103), kappa0 + c s     [1/m]
    c        rate of curvature, zero on straights and arcs                     [1/m^2]
    theta    heading, theta0 + kappa0 s + c s^2 / 2                            [rad]
    z        position as the complex number x + i y, z0 + int exp(i theta) ds  [m]

On straights and arcs the integral is ``s exp(i kappa s / 2) sinc(kappa s / 2)``, which has no
cancellation at small curvature. On clothoids the square in theta is completed and the integral
becomes a difference of two Fresnel integrals (Abramowitz and Stegun, 7.3). That difference
cancels where the curvature hardly changes; there a Gauss-Legendre rule takes over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import fresnel

from rail_signals.arrays import FloatArray

_TOLERANCE_M = 1e-6
# Below this estimate of the rounding error the Fresnel form is used [m].
_FRESNEL_ERROR_M = 1e-9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Element:
    """One element: curvature changes linearly from one end to the other.

    Parameters
    ----------
    length_m : float
        Length along the track [m], positive.
    start_curvature_per_m, end_curvature_per_m : float
        Curvature at both ends [1/m], positive to the left (counter-clockwise).
    """

    length_m: float
    start_curvature_per_m: float = 0.0
    end_curvature_per_m: float = 0.0

    @classmethod
    def from_radii(
        cls, length_m: float, start_radius_m: float | None, end_radius_m: float | None
    ) -> Element:
        """Make an element from radii [m], positive to the right as in TTOBench; None = straight."""

        def curvature(radius_m: float | None) -> float:
            return 0.0 if radius_m is None else -1.0 / radius_m

        return cls(length_m, curvature(start_radius_m), curvature(end_radius_m))


def _arc(curvature: FloatArray, s: FloatArray) -> npt.NDArray[np.complex128]:
    half_turn = 0.5 * curvature * s
    chord: npt.NDArray[np.complex128] = s * np.sinc(half_turn / np.pi) * np.exp(1j * half_turn)
    return chord


def _clothoid(k0: FloatArray, c: FloatArray, s: FloatArray) -> npt.NDArray[np.complex128]:
    sign = np.sign(c)
    scale = np.sqrt(np.pi / np.abs(c))
    sin_0, cos_0 = fresnel(k0 / c / scale)
    sin_1, cos_1 = fresnel((s + k0 / c) / scale)
    turn = np.exp(-0.5j * k0 * k0 / c)
    result: npt.NDArray[np.complex128] = (
        turn * scale * ((cos_1 - cos_0) + 1j * sign * (sin_1 - sin_0))
    )
    return result


def _quadrature(k0: FloatArray, c: FloatArray, s: FloatArray) -> npt.NDArray[np.complex128]:
    most_turn = np.max((np.abs(k0) + np.abs(c * s)) * np.abs(s), initial=0.0)
    panels = max(1, int(np.ceil(most_turn)))
    total = np.zeros(s.shape, dtype=np.complex128)
    width = s / panels
    for panel in range(panels):
        t = (panel + 0.5 + 0.5 * _NODES) * width[..., np.newaxis]
        phase = k0[..., np.newaxis] * t + 0.5 * c[..., np.newaxis] * t * t
        total += 0.5 * width * (np.exp(1j * phase) @ _WEIGHTS)
    return total


def _displacement(k0: FloatArray, c: FloatArray, s: FloatArray) -> npt.NDArray[np.complex128]:
    """Return int_0^s exp(i (k0 t + c t^2 / 2)) dt, all arguments of one shape [n]."""
    result = _arc(k0, s)
    bent = c != 0.0
    if not bent.any():
        return result
    if not bent.all():
        k0, c, s = k0[bent], c[bent], s[bent]
    # Rounding of the large phase kappa0^2 / 2c, and cancellation of values near one half.
    with np.errstate(over="ignore"):  # infinite for the smallest rates: not the Fresnel form
        scale = np.sqrt(np.pi / np.abs(c))
        error = np.finfo(np.float64).eps * scale * (1.0 + 0.5 * k0 * k0 / np.abs(c))
    well = error < _FRESNEL_ERROR_M
    if well.all():
        result[bent] = _clothoid(k0, c, s)
        return result
    values = np.empty(s.shape, dtype=np.complex128)
    values[well] = _clothoid(k0[well], c[well], s[well])
    values[~well] = _quadrature(k0[~well], c[~well], s[~well])
    result[bent] = values
    return result


class Alignment:
    """Plane curve through a sequence of elements.

    Position and heading are continuous at every joint by construction; curvature need not be.

    Parameters
    ----------
    elements : sequence of Element
        At least one, in order of chainage.
    x_m, y_m : float
        Start in the map frame [m] (x east, y north).
    heading_rad : float
        Heading at the start [rad], counter-clockwise from east.

    Raises
    ------
    ValueError
        If there is no element, or one of them has no positive finite length.

    Examples
    --------
    A quarter circle to the right from the origin towards east:

    >>> quarter = Alignment([Element.from_radii(0.5 * np.pi * 100.0, 100.0, 100.0)])
    >>> x_m, y_m, heading_rad = quarter.pose(quarter.length_m)
    >>> bool(np.allclose([x_m, y_m, heading_rad], [100.0, -100.0, -np.pi / 2]))
    True
    """

    def __init__(
        self,
        elements: Sequence[Element],
        *,
        x_m: float = 0.0,
        y_m: float = 0.0,
        heading_rad: float = 0.0,
    ) -> None:
        if not elements:
            raise ValueError("an alignment needs at least one element")
        lengths = np.array([e.length_m for e in elements], dtype=np.float64)
        k0 = np.array([e.start_curvature_per_m for e in elements], dtype=np.float64)
        k1 = np.array([e.end_curvature_per_m for e in elements], dtype=np.float64)
        for values, what in ((lengths, "length"), (k0, "curvature"), (k1, "curvature")):
            if not np.isfinite(values).all():
                raise ValueError(f"{what} of an element is not finite")
        if not (lengths > 0.0).all():
            raise ValueError(f"length of an element must be positive, not {lengths.min()} m")
        self.elements = tuple(elements)
        self._k0 = k0
        self._rate = (k1 - k0) / lengths
        self._joints_m = np.concatenate(([0.0], np.cumsum(lengths)))
        turns = 0.5 * (k0 + k1) * lengths
        self._theta0 = heading_rad + np.concatenate(([0.0], np.cumsum(turns)))
        chords = _displacement(k0, self._rate, lengths) * np.exp(1j * self._theta0[:-1])
        self._z0 = complex(x_m, y_m) + np.concatenate(([0.0], np.cumsum(chords)))

    @property
    def length_m(self) -> float:
        """Length of the curve [m]."""
        return float(self._joints_m[-1])

    @property
    def joints_m(self) -> FloatArray:
        """Chainages of the element ends [elements + 1], the first is 0 [m]."""
        joints: FloatArray = self._joints_m.copy()
        return joints

    def moved(self, x_m: float, y_m: float, heading_rad: float) -> Alignment:
        """Return the same curve with another start pose."""
        return Alignment(self.elements, x_m=x_m, y_m=y_m, heading_rad=heading_rad)

    def _element_at(self, chainage_m: npt.ArrayLike) -> tuple[npt.NDArray[Any], FloatArray]:
        chainage = np.asarray(chainage_m, dtype=np.float64)
        inside = (chainage >= -_TOLERANCE_M) & (chainage <= self.length_m + _TOLERANCE_M)
        if not inside.all():
            worst = chainage[~inside].flat[0] if chainage.ndim else chainage
            raise ValueError(f"chainage {worst} m is off the track (0 ... {self.length_m} m)")
        chainage = np.minimum(np.maximum(chainage, 0.0), self.length_m)
        # Only inner joints are searched: the end of the track belongs to the last element.
        index = np.searchsorted(self._joints_m[1:-1], chainage, side="right")
        return index, chainage - self._joints_m[index]

    def pose(self, chainage_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Position and heading at chainages.

        Parameters
        ----------
        chainage_m : array_like [...]
            Chainages [m], 0 ... length.

        Returns
        -------
        x_m, y_m, heading_rad : float64 [...]
            Map frame; the heading is continuous along the track, not wrapped.

        Raises
        ------
        ValueError
            If a chainage is off the track or not a number.
        """
        index, s = self._element_at(chainage_m)
        shape = s.shape
        index, s = index.reshape(-1), s.reshape(-1)
        k0, rate, theta0 = self._k0[index], self._rate[index], self._theta0[index]
        z = self._z0[index] + np.exp(1j * theta0) * _displacement(k0, rate, s)
        heading = theta0 + k0 * s + 0.5 * rate * s * s
        return z.real.reshape(shape), z.imag.reshape(shape), heading.reshape(shape)

    def curvature_per_m(self, chainage_m: npt.ArrayLike) -> FloatArray:
        """Curvature [1/m] at chainages [...], positive to the left."""
        index, s = self._element_at(chainage_m)
        curvature: FloatArray = self._k0[index] + self._rate[index] * s
        return curvature
