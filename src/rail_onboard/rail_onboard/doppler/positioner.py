"""A train's positions by Doppler shifts, block after block."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.doppler.receiver import ToneReceiver
from rail_signals.doppler.solver import Answer, DopplerSolver, NoFixReason, Prior


@dataclass(frozen=True)
class Tracking:
    """How a positioner carries knowledge from block to block.

    Parameters
    ----------
    fastest_mps : float
        The train is no faster [m/s].
    placed_m : float
        How far off the first place may be [m].
    walk_hz : float
        Random walk of the receiver's offset, standard deviation after a second [Hz].
    station_hz : float
        Standard deviation of the oscillator of a station [Hz].
    """

    fastest_mps: float
    placed_m: float = 50.0
    walk_hz: float = 0.5
    station_hz: float = 0.026


class DopplerPositioner:
    """Finds tones, then the place; remembers the receiver's offset and where to look.

    The place of the block before is used as a window only, so that the positions are those of
    the shifts alone. What the receiver is off by changes slowly and is carried on as a prior.

    Parameters
    ----------
    receiver : ToneReceiver
    solver : DopplerSolver
    tracking : Tracking
    start_m : float
        Chainage where the train is put into service [m].
    direction : {1, -1, 0}
        In which it runs; 0 = not known.
    """

    def __init__(
        self,
        receiver: ToneReceiver,
        solver: DopplerSolver,
        tracking: Tracking,
        start_m: float,
        direction: int = 0,
    ) -> None:
        self._receiver, self._solver, self._tracking = receiver, solver, tracking
        self._direction = direction
        self._near_m, self._half_m = start_m, tracking.placed_m
        self._offset: Prior | None = None
        #: Tones found in the last block.
        self.tones = 0

    @property
    def near_m(self) -> float:
        """The last place, or where the train was put into service [m]."""
        return self._near_m

    def locate(self, block: ArrayLike | None, step_s: float) -> Answer:
        """Position at the middle of a block.

        Parameters
        ----------
        block : complex [samples], or None
            What was received; None if nothing was.
        step_s : float
            Time since the block before [s].
        """
        tracking = self._tracking
        self._half_m += tracking.fastest_mps * step_s
        if self._offset is not None:
            spread = sqrt(self._offset.sigma**2 + tracking.walk_hz**2 * step_s)
            self._offset = Prior(self._offset.mean, spread)
        self.tones = 0
        if block is None:
            return Answer(NoFixReason.TOO_FEW_STATIONS)
        shifts = self._receiver.estimate(block)
        self.tones = len(shifts)
        stations = self._solver.stations_of(shifts.slots, self._near_m)
        known = stations >= 0
        answer = self._solver.solve(
            stations[known],
            shifts.shift_hz[known],
            shifts.variance_hz2[known] + tracking.station_hz**2,
            window_m=(self._near_m - self._half_m, self._near_m + self._half_m),
            direction=self._direction,
            offset=self._offset,
        )
        fix = answer.fix
        if answer.reason is NoFixReason.NONE and fix is not None:
            self._near_m = fix.chainage_m
            self._half_m = tracking.placed_m + 6.0 * fix.sigma_m
            self._offset = Prior(fix.offset_hz, float(np.sqrt(fix.covariance[2, 2])))
        return answer
