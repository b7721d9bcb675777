"""The cost of a place by Doppler shifts, and its minimum by Gauss and Newton."""

from __future__ import annotations

from dataclasses import dataclass
from math import isinf

from rail_signals.arrays import FloatArray

from .shift_kernel import (
    Known,
    Symmetric,
    Unknowns,
    cost_minimum,
    newton_step,
    shift_cost,
)
from .surveyed_line import SurveyedLine


@dataclass(frozen=True)
class Minimum:
    """A minimum of the cost, and the covariance [3, 3] by its parabola there."""

    at: Unknowns
    cost: float
    covariance: FloatArray


class ShiftCost:
    """The cost of a place, a speed and an offset.

    Parameters
    ----------
    line : SurveyedLine
    received : float [stations, 7]
        Of each station of a block the antenna x, y, z [m], the shift [Hz], one over its
        variance [1/Hz^2], and `per_mps` and `scale` on which it depends: the shift is
        ``per_mps v C(s, v) + scale delta``, C the mean rate.
    averaging_time_s : float
        `doppler_plan.TonePlan.averaging_time_s`.
    known : (float, float, float, float)
        Speed and offset known beforehand: mean, and one over the variance, of each.
    """

    def __init__(
        self, line: SurveyedLine, received: FloatArray, averaging_time_s: float, known: Known
    ) -> None:
        per_m = 1.0 / line.step_m
        self._setting = (line.cubics, line.start_m, per_m, received, averaging_time_s, known)

    def __call__(self, at: Unknowns) -> float:
        """Weighted squares of what is left of shifts and priors."""
        return shift_cost(*self._setting, at)

    def step(self, at: Unknowns) -> tuple[Unknowns, float, Symmetric]:
        """Step of Gauss and Newton, the cost where it leads, and the normal matrix.

        The cost is that of a parabola.
        """
        return newton_step(*self._setting, at)

    def minimum(self, at: Unknowns, window_m: tuple[float, float], worst: float) -> Minimum | None:
        """The minimum near a place.

        None if it is not within the window, its cost is above `worst`, or it is not reached.
        """
        found, cost, covariance = cost_minimum(*self._setting, at, *window_m, worst)
        return None if isinf(cost) else Minimum(found, cost, covariance)
