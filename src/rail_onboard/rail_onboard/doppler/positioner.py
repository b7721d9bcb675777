"""A train's positions by Doppler shifts, block after block.

Tones repeat along the line: there are fewer slots than stations. The same shifts then fit at
several places, a **cycle** of slots apart, to the last hertz where the line is straight. Which of
them it is nothing in the shifts tells, only where the train was before. A positioner that has just
been switched on does not know that, and one that had no fix for long has lost it. Such a one looks
everywhere that the train may be, and has no position until

- all but one of the places are refuted by the shifts, in three blocks in a row, or
- it is told where to look, by somebody who knows it to a fraction of the cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.doppler.receiver import ToneReceiver, ToneShifts
from rail_signals.doppler.solver import Answer, DopplerSolution, DopplerSolver, NoFixReason, Prior

#: The half-width of the window up to which the nearest stations are the right ones, per cycle.
_SURE = 0.25
#: What is told is believed so much beyond its ends [m].
_BESIDE_M = 50.0
#: Stretches that are searched overlap, so that no place is at an end of all that hold it [m].
_OVERLAP_M = 25.0
#: So many blocks in a row must leave the same single place.
_CONFIRMED = 3
#: A train whose shifts cannot be told from those of standing is no faster [m/s].
_STANDING_MPS = 5.0
#: These answers say that the train is not in the stretch that was searched.
_REFUTED = frozenset(
    {NoFixReason.OFF_TRACK, NoFixReason.INCONSISTENT, NoFixReason.TOO_FEW_STATIONS}
)


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
    gathers_mps2 : float
        The train gathers speed no faster [m/s^2].
    """

    fastest_mps: float
    placed_m: float = 50.0
    walk_hz: float = 0.5
    station_hz: float = 0.026
    gathers_mps2: float = 1.6


class DopplerPositioner:
    """Finds tones, then the place; remembers the receiver's offset and where to look.

    The place of the block before is used as a window only, so that the positions are those of
    the shifts alone. What the receiver is off by changes slowly and is carried on as a prior.

    Parameters
    ----------
    receiver : ToneReceiver
    solver : DopplerSolver
    tracking : Tracking
    start_m : float, optional
        Chainage where the train is put into service [m]; None where it is not known.
    direction : {1, -1, 0}
        In which it runs; 0 = not known.
    """

    def __init__(
        self,
        receiver: ToneReceiver,
        solver: DopplerSolver,
        tracking: Tracking,
        start_m: float | None,
        direction: int = 0,
    ) -> None:
        self._receiver, self._solver, self._tracking = receiver, solver, tracking
        self._direction = direction
        line = solver.line
        self._near_m = 0.5 * (line.start_m + line.end_m) if start_m is None else start_m
        self._half_m = inf if start_m is None else tracking.placed_m
        self._pace_mps = tracking.fastest_mps
        self._offset: Prior | None = None
        self._only: DopplerSolution | None = None
        self._only_blocks = 0
        #: Tones found in the last block.
        self.tones = 0

    @property
    def near_m(self) -> float:
        """Middle of where it looks: the last place, or where the train was put into service [m]."""
        return self._near_m

    @property
    def sure(self) -> bool:
        """Whether it knows which of the stations that share a tone it receives."""
        return self._half_m <= _SURE * self._solver.cycle_m

    def tell(self, low_m: float, high_m: float) -> None:
        """Be told between which chainages the train is; of use only while it is not sure [m]."""
        half_m = 0.5 * (high_m - low_m) + _BESIDE_M
        if not self.sure and half_m <= _SURE * self._solver.cycle_m:
            self._near_m, self._half_m = 0.5 * (low_m + high_m), half_m

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
        self._pace_mps += tracking.gathers_mps2 * step_s
        self._pace_mps = min(self._pace_mps, tracking.fastest_mps)
        self._half_m += self._pace_mps * step_s
        if self._offset is not None:
            spread = sqrt(self._offset.sigma**2 + tracking.walk_hz**2 * step_s)
            self._offset = Prior(self._offset.mean, spread)
        self.tones = 0
        if block is None:
            return Answer(NoFixReason.TOO_FEW_STATIONS)
        shifts = self._receiver.estimate(block)
        self.tones = len(shifts)
        window_m = self._near_m - self._half_m, self._near_m + self._half_m
        if self.sure:
            answer = self._solve(shifts, self._near_m, window_m)
        else:
            answer = self._search(shifts, window_m, step_s)
        if answer.reason is NoFixReason.NONE and answer.fix is not None:
            self._follow(answer.fix)
        elif answer.reason is NoFixReason.STANDSTILL:
            self._pace_mps = min(self._pace_mps, _STANDING_MPS)
        return answer

    def _follow(self, fix: DopplerSolution) -> None:
        self._near_m = fix.chainage_m
        self._half_m = self._tracking.placed_m + 6.0 * fix.sigma_m
        self._pace_mps = abs(fix.speed_mps) + 6.0 * sqrt(float(fix.covariance[1, 1]))
        self._offset = Prior(fix.offset_hz, float(np.sqrt(fix.covariance[2, 2])))
        self._only, self._only_blocks = None, 0

    def _solve(self, shifts: ToneShifts, near_m: float, window_m: tuple[float, float]) -> Answer:
        """Answer of the stations that are nearest to a place."""
        stations = self._solver.stations_of(shifts.slots, near_m)
        known = stations >= 0
        return self._solver.solve(
            stations[known],
            shifts.shift_hz[known],
            shifts.variance_hz2[known] + self._tracking.station_hz**2,
            window_m=window_m,
            direction=self._direction,
            offset=self._offset,
        )

    def _search(self, shifts: ToneShifts, window_m: tuple[float, float], step_s: float) -> Answer:
        """The only place in a wide window, once several blocks agree that it is."""
        answers = [
            self._solve(shifts, 0.5 * (low_m + high_m), (low_m - _OVERLAP_M, high_m + _OVERLAP_M))
            for low_m, high_m in self._solver.stretches(shifts.slots, window_m)
        ]
        left = [answer for answer in answers if answer.reason not in _REFUTED]
        fix = left[0].fix if len(left) == 1 else None
        if fix is None:
            self._only, self._only_blocks = None, 0
            if not left:
                return max(answers, key=lambda a: a.reason, default=Answer(NoFixReason.OFF_TRACK))
            if all(answer.reason is NoFixReason.STANDSTILL for answer in left):
                return left[0]
            return left[0] if len(left) == 1 else Answer(NoFixReason.AMBIGUOUS)
        before = self._only
        same = before is not None and abs(fix.chainage_m - before.chainage_m) <= (
            self._tracking.placed_m + 6.0 * fix.sigma_m + self._tracking.fastest_mps * step_s
        )
        self._only, self._only_blocks = fix, self._only_blocks + 1 if same else 1
        if self._only_blocks < _CONFIRMED:
            return Answer(NoFixReason.AMBIGUOUS)
        return Answer(NoFixReason.NONE, fix)
