"""Piecewise constant quantities along a track: speed limits and gradients."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rail_signals.arrays import FloatArray


class StepProfile:
    """A quantity that is constant from each point to the next.

    Outside, the first and the last value go on.

    Parameters
    ----------
    starts_m : sequence of float
        Where each value begins [m], strictly increasing.
    values : sequence of float
        The values, in any unit.

    Examples
    --------
    >>> gradient = StepProfile([0.0, 100.0], [10.0, -5.0])
    >>> gradient.at([50.0, 100.0, 900.0]).tolist()
    [10.0, -5.0, -5.0]
    >>> gradient.integral([100.0, 200.0]).tolist()
    [1000.0, 500.0]
    """

    def __init__(self, starts_m: Sequence[float], values: Sequence[float]) -> None:
        self.starts_m: FloatArray = np.array(starts_m, dtype=np.float64)
        self.values: FloatArray = np.array(values, dtype=np.float64)
        if self.starts_m.ndim != 1 or self.starts_m.size == 0:
            raise ValueError("a profile needs at least one point")
        if self.starts_m.shape != self.values.shape:
            raise ValueError(f"{self.starts_m.size} positions, but {self.values.size} values")
        if not np.all(np.diff(self.starts_m) > 0.0):
            raise ValueError("positions of a profile must increase")
        steps = np.diff(self.starts_m) * self.values[:-1]
        self._integrals = np.concatenate(([0.0], np.cumsum(steps)))

    def _index(self, position_m: FloatArray) -> npt.NDArray[np.intp]:
        index = np.searchsorted(self.starts_m, position_m, side="right") - 1
        return np.maximum(index, 0)

    def at(self, position_m: npt.ArrayLike) -> FloatArray:
        """Value at positions [...]; at a step the value that begins there."""
        values: FloatArray = self.values[self._index(np.asarray(position_m, dtype=np.float64))]
        return values

    def integral(self, position_m: npt.ArrayLike) -> FloatArray:
        """Integral from the first point to positions [...], in units of the value times metres."""
        position = np.asarray(position_m, dtype=np.float64)
        index = self._index(position)
        integral: FloatArray = self._integrals[index] + self.values[index] * (
            position - self.starts_m[index]
        )
        return integral

    def lowered(self, from_m: float, to_m: float, value: float) -> StepProfile:
        """The profile with no more than a value between two positions."""
        starts_m = np.unique(np.concatenate((self.starts_m, [from_m, to_m])))
        values = self.at(starts_m)
        inside = (starts_m >= from_m) & (starts_m < to_m)
        values[inside] = np.minimum(values[inside], value)
        return StepProfile(starts_m.tolist(), values.tolist())

    def part(self, from_m: float, to_m: float) -> list[tuple[float, float]]:
        """List (start, value) of the steps between two positions, the first at ``from_m``."""
        inner = (self.starts_m > from_m) & (self.starts_m < to_m)
        steps = [(from_m, float(self.at(from_m)))]
        steps += zip(self.starts_m[inner].tolist(), self.values[inner].tolist(), strict=True)
        return steps
