"""Effort and slip, detected from the wheels' own speed.

A wheel speed less its mean over the last T seconds, with exponential weights, is T times a steady
acceleration (for ticks of length t, ``t / (1 - exp(-t / T))`` times). Wheels that pull or brake
creep; wheels that change their speed faster than any train can, slip or slide. How much is reckoned
with goes by the speed that the train may still have: wheels that slide turn too slowly for it, and
it falls no faster than a train can brake.
"""

from __future__ import annotations

import numpy as np

from .filter_bank import FloatArray
from .readings import WheelSpeed
from .settings import OdometerModel

#: Over which the mean is taken: for effort, and for slip, which is faster and more [s].
_MEANS_S = (1.0, 0.3)
#: A change of speed that the coefficient of the scale follows, or two percent.
_STEADY_MPS = 0.3


class SlipDetector:
    """Keeps the sigma of the slip to be reckoned with.

    Parameters
    ----------
    model : OdometerModel
    shape : tuple of int
        Of the runs.
    """

    def __init__(self, model: OdometerModel, shape: tuple[int, ...] = ()) -> None:
        self._model = model
        column = (2, *(1 for _ in shape), 1)
        self._means_s = np.array(_MEANS_S).reshape(column)
        self._limits_mps2 = np.array([model.effort_mps2, model.limit_mps2]).reshape(column)
        self._shape = (*shape, 1)
        self._step_s, self._weight = 0.0, np.zeros(column)
        self._limits_mps = self._limits_mps2 * self._means_s
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._mean_mps = np.full((2, *self._shape), np.nan)
        self._started = self._busy = False
        self._left_s = np.zeros((2, *self._shape))
        self._fastest_mps: FloatArray = np.zeros(self._shape)
        self.slip_mps: FloatArray = np.full(self._shape, self._model.creep_mps)
        """Sigma of the slip [..., 1]."""
        self.most_mps: FloatArray = np.full(self._shape, np.inf)
        """Speed that a train does not exceed whose wheels creep as much as under full effort.

        Infinite [..., 1] while they slip or slide, and without a reading. Effort is always
        reckoned with: it is with the brakes on that a speed read too low does harm.
        """
        self.steady_mps: FloatArray = np.zeros(self._shape)
        """Speed of the wheels, of some time ago: it stands still while they keep theirs [..., 1].

        The coefficient of the scale. Were it the latest speed, or a mean of the last ones, its
        noise would be in the gain of the scale while that of the same readings is in the
        innovation: the mean of their product drives the scale away, though wheels alone say
        nothing about it. Two percent of a scale of two percent are no loss.
        """

    def update(self, step_s: float, reading: WheelSpeed | None) -> None:
        """Take the reading of a tick, or none, `step_s` after that of the one before."""
        model = self._model
        if reading is None:
            self._left_s -= step_s
            self.most_mps = np.full(self._shape, np.inf)
            return
        wheel_mps = np.abs(reading.speed_mps)
        if reading.present is not True:
            wheel_mps = np.where(reading.present, wheel_mps, self._mean_mps[1])
        change_mps = wheel_mps - self._mean_mps
        mean_mps = self._mean_mps[1]
        self.steady_mps = np.where(
            np.abs(mean_mps - self.steady_mps) > np.maximum(0.02 * mean_mps, _STEADY_MPS),
            mean_mps,
            self.steady_mps,
        )
        if step_s != self._step_s:
            self._step_s, self._weight = step_s, -np.expm1(-step_s / self._means_s)
            if step_s > 0.0:
                self._limits_mps = self._limits_mps2 * step_s / self._weight
        self._mean_mps = self._mean_mps + self._weight * change_mps
        if not self._started:
            # A mean that is not there yet is NaN, with which nothing compares.
            self._mean_mps = np.where(np.isnan(change_mps), wheel_mps, self._mean_mps)
            self.steady_mps = np.where(np.isnan(change_mps[1]), wheel_mps, self.steady_mps)
            self._started = not np.isnan(self._mean_mps).any()
        self._fastest_mps = np.fmax(self._fastest_mps - model.limit_mps2 * step_s, wheel_mps)
        seen = np.abs(change_mps) > self._limits_mps
        slip_mps = model.creep * self._fastest_mps + model.creep_mps
        if self._busy or seen.any():
            self._left_s = np.where(seen, model.hold_s, self._left_s - step_s)
            effort, slip = self._left_s > 0.0
            efforts_mps = model.effort_creep * self._fastest_mps + model.effort_creep_mps
            slips_mps = model.slip * self._fastest_mps + model.slip_mps
            slip_mps = np.where(slip, slips_mps, np.where(effort, efforts_mps, slip_mps))
            self._busy = bool(effort.any() or slip.any())
        self.slip_mps = slip_mps
        trusted = reading.present & (self._left_s[1] <= 0.0)
        creep_mps = model.effort_creep * wheel_mps + model.effort_creep_mps
        self.most_mps = np.where(trusted, wheel_mps + creep_mps, np.inf)
