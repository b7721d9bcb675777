"""The line that a positioner knows: places and tangents by chainage, and the stations beside it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class SurveyedLine:
    """Centre line as points at equal steps of chainage, between them cubic.

    On an arc of radius R the interpolation errs by ``step^4 / 384 R^3``: for 5 m and 200 m less
    than a micrometre.

    Parameters
    ----------
    chainage_m : float [points]
        Equally spaced, increasing [m].
    x_m, y_m, z_m : float [points]
        Places [m].
    heading_rad : float [points]
        Direction of increasing chainage, anticlockwise from east [rad].

    Raises
    ------
    ValueError
        If the arrays do not fit together, or the chainages are not equally spaced.

    Examples
    --------
    >>> s = np.arange(0.0, 101.0, 10.0)
    >>> line = SurveyedLine(s, s, 0.0 * s, 0.0 * s, 0.0 * s)
    >>> place, tangent, _ = line.at([25.0])
    >>> np.allclose(place, [[25.0, 0.0, 0.0]]), np.allclose(tangent, [[1.0, 0.0, 0.0]])
    (True, True)
    """

    chainage_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray

    def __post_init__(self) -> None:
        """Validate."""
        count = self.chainage_m.size
        for name in ("chainage_m", "x_m", "y_m", "z_m", "heading_rad"):
            values = getattr(self, name)
            if values.shape != (count,) or not np.isfinite(values).all():
                raise ValueError(f"{name} must be {count} finite numbers, got {values.shape}")
        if count < 2 or not np.allclose(np.diff(self.chainage_m), self.step_m, atol=1e-6):
            raise ValueError("chainage_m must be two or more equal steps")
        if not self.step_m > 0.0:
            raise ValueError(f"chainage_m must increase, got steps of {self.step_m!r}")

    @cached_property
    def step_m(self) -> float:
        """Distance of the points [m]."""
        return float(self.chainage_m[-1] - self.chainage_m[0]) / (self.chainage_m.size - 1)

    @cached_property
    def start_m(self) -> float:
        """First chainage [m]."""
        return float(self.chainage_m[0])

    @cached_property
    def end_m(self) -> float:
        """Last chainage [m]."""
        return float(self.chainage_m[-1])

    @cached_property
    def _points(self) -> FloatArray:
        return np.stack([self.x_m, self.y_m, self.z_m], axis=1)

    @cached_property
    def _slopes(self) -> FloatArray:
        """Derivatives of the places by chainage [points, 3]."""
        rise = np.gradient(self.z_m, self.chainage_m)
        return np.stack([np.cos(self.heading_rad), np.sin(self.heading_rad), rise], axis=1)

    @cached_property
    def _cubics(self) -> FloatArray:
        """Coefficients of the powers of the part of a step, [segment, power, 3]."""
        p0, p1 = self._points[:-1], self._points[1:]
        m0, m1 = self._slopes[:-1] * self.step_m, self._slopes[1:] * self.step_m
        return np.stack([p0, m0, 3 * (p1 - p0) - 2 * m0 - m1, 2 * (p0 - p1) + m0 + m1], axis=1)

    @cached_property
    def cubics(self) -> FloatArray:
        """The cubics of each segment flat: [segment, 12] [m]."""
        return np.ascontiguousarray(self._cubics.reshape(-1, 12))

    def at(self, chainage_m: ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Places and their first and second derivatives by chainage [..., 3].

        Past an end the line goes on straight.
        """
        out = self._derivatives(np.asarray(chainage_m, dtype=np.float64))
        return out[..., 0, :], out[..., 1, :], out[..., 2, :]

    def _derivatives(self, chainage_m: FloatArray) -> FloatArray:
        """Place, first and second derivative, [..., 3, 3]."""
        steps = (chainage_m - self.start_m) / self.step_m
        index = np.minimum(np.maximum(steps, 0.0), self.chainage_m.size - 2).astype(np.int64)
        whole = steps - index
        t = np.minimum(np.maximum(whole, 0.0), 1.0)
        beyond = whole - t
        powers = np.zeros((*t.shape, 3, 4))
        powers[..., 0, 0] = powers[..., 1, 1] = 1.0
        powers[..., 0, 1] = t
        powers[..., 2, 2] = 2.0
        square = t * t
        powers[..., 0, 2] = square
        powers[..., 0, 3] = square * t
        powers[..., 1, 2] = 2.0 * t
        powers[..., 1, 3] = 3.0 * square
        powers[..., 2, 3] = 6.0 * t
        out: FloatArray = np.matmul(powers, self._cubics[index])
        if beyond.any():
            out[..., 0, :] += beyond[..., None] * out[..., 1, :]
            out[beyond != 0.0, 2] = 0.0
        out[..., 1, :] *= 1.0 / self.step_m
        out[..., 2, :] *= 1.0 / self.step_m**2
        return out

    def rates(self, stations_m: FloatArray, chainage_m: ArrayLike) -> FloatArray:
        """How fast the distances grow with the chainage, dR/ds [..., stations].

        Parameters
        ----------
        stations_m : float [stations, 3]
            Places of the antennas [m].
        """
        out = self._derivatives(np.asarray(chainage_m, dtype=np.float64))
        line = out[..., 0:1, :] - stations_m
        along = np.einsum("...sk,...k->...s", line, out[..., 1, :])
        return np.asarray(along / np.sqrt(np.einsum("...k,...k->...", line, line)))

    def distances(self, stations_m: FloatArray, chainage_m: ArrayLike) -> FloatArray:
        """Distances [..., stations] [m]."""
        line = self.at(chainage_m)[0][..., None, :] - stations_m
        return np.asarray(np.sqrt((line * line).sum(axis=-1)))
