"""Where a train is on its line, from the Doppler shifts of any number of reference stations.

The shift of the tone of station k, of frequency f_k, is

    z_k = -(f_k / c) v C_k(s, v) + (f_k / f) delta + noise of variance V_k,

``C_k`` the mean of dR_k/ds at ``s ± v tau`` (`doppler_plan.TonePlan.averaging_time_s`). Speed v
and offset delta are all but linear in it, so for each chainage s of a grid the best ones are
known at once, and with them the cost

    J(s) = min over v, delta of sum_k (z_k - ...)^2 / V_k + priors.

Its minima are refined by Gauss and Newton in (s, v, delta). Nothing is divided by a shift or by a
speed, so that neither standstill nor a station abeam is special (S1, claims 4 to 6, divide by the
second shift). Wide priors keep what the stations leave open finite: no train runs faster than
`TonePlan.max_speed_mps`, no receiver is further off than `TonePlan.max_offset_ppm`.

A position is given only where it deserves trust; `NoFixReason` says why not.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from rail_signals.arrays import FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S

from .shift_cost import ShiftCost
from .shift_kernel import cost_profile, deepest_minima
from .station_kernel import gather_received, nearest_stations
from .surveyed_line import SurveyedLine
from .tone_plan import TonePlan

#: A second minimum is another answer unless it is so much less likely: exp(-25 / 2).
_CLEARLY_WORSE = 25.0
#: A speed is told from standstill by so many of its standard deviations.
_MOVING_SIGMAS = 5.0
#: Probability that a right answer is refused as inconsistent.
_CHI_SQUARE_RISK = 1e-6
_MOST_CANDIDATES = 4
#: The cost may differ by so much from its parabola two sigma away, where that is 4.
_BENT = 1.0


class NoFixReason(IntEnum):
    """Why there is no position."""

    NONE = 0
    TOO_FEW_STATIONS = 1
    """Fewer than two tones were found."""
    STANDSTILL = 2
    """The speed cannot be told from zero: shifts carry no position."""
    GEOMETRY = 3
    """The position would be too uncertain, as between stations far away or abeam of one."""
    AMBIGUOUS = 4
    """Another place fits the shifts as well."""
    INCONSISTENT = 5
    """No place fits the shifts."""
    OFF_TRACK = 6
    """The best place is an end of the line or of the window."""


@dataclass(frozen=True)
class DopplerSolution:
    """Chainage [m], speed [m/s] along it, offset of the receiver [Hz], and their covariance.

    ``covariance`` float64 [3, 3] in this order; ``chi_square`` the cost that is left; ``freedom``
    how many measurements there were beyond what was asked for.
    """

    chainage_m: float
    speed_mps: float
    offset_hz: float
    covariance: FloatArray
    chi_square: float
    freedom: int

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the chainage [m]."""
        return sqrt(float(self.covariance[0, 0]))


@dataclass(frozen=True)
class Answer:
    """A fix, or why there is none."""

    reason: NoFixReason
    fix: DopplerSolution | None = None


@dataclass(frozen=True)
class Prior:
    """What is known beforehand of a figure: mean and standard deviation."""

    mean: float
    sigma: float


class DopplerSolver:
    """Finds positions on one line.

    Parameters
    ----------
    plan : TonePlan
    line : SurveyedLine
    stations_m : float [stations, 3]
        Places of the antennas of all stations of the line [m].
    slots : int [stations]
        Slots of their tones.
    worst_sigma_m : float
        A position more uncertain than this is not given [m].
    grid_m : float
        Step of the search [m]: a fraction of the least distance between track and stations.

    Raises
    ------
    ValueError
        If the arrays do not fit together.
    """

    def __init__(
        self,
        plan: TonePlan,
        line: SurveyedLine,
        stations_m: ArrayLike,
        slots: ArrayLike,
        *,
        worst_sigma_m: float = 50.0,
        grid_m: float = 5.0,
    ) -> None:
        self.plan, self.line = plan, line
        self.stations_m = np.asarray(stations_m, dtype=np.float64)
        self.slots: NDArray[np.int64] = np.asarray(slots, dtype=np.int64)
        if self.stations_m.shape != (self.slots.size, 3):
            raise ValueError(
                f"stations_m must be [{self.slots.size}, 3], got {self.stations_m.shape}"
            )
        self._worst_m = worst_sigma_m
        cells = max(2, int(np.ceil((line.end_m - line.start_m) / grid_m)))
        self._grid_m = np.linspace(line.start_m, line.end_m, cells + 1)
        #: Step of the search [m].
        self.grid_step_m = (line.end_m - line.start_m) / cells
        self._rates = line.rates(self.stations_m, self._grid_m).T.copy()  # [station, point]
        offsets = np.array([plan.slot_offset_hz(int(slot)) for slot in self.slots])
        tones_hz = plan.carrier_hz + offsets
        # Shift per speed and per offset at the carrier.
        self._effects = np.stack(
            [-tones_hz / SPEED_OF_LIGHT_M_PER_S, tones_hz / plan.carrier_hz], axis=1
        )
        self._widest = Prior(0.0, 1e-6 * plan.max_offset_ppm * plan.carrier_hz or 1e-6)
        feet = np.argmin(np.abs(line.distances(self.stations_m, self._grid_m)), axis=0)
        #: Chainage beside which each station stands [m].
        self.feet_m: FloatArray = self._grid_m[feet]
        alike = [np.sort(self.feet_m[self.slots == slot]) for slot in np.unique(self.slots)]
        #: Least distance between two stations that share a tone, infinite if none do [m].
        self.cycle_m = min((float(np.diff(f).min()) for f in alike if f.size > 1), default=inf)

    def stations_of(self, slots: ArrayLike, near_m: float) -> NDArray[np.int64]:
        """Station of each slot that stands nearest to a chainage; -1 where there is none."""
        asked = np.atleast_1d(np.asarray(slots, dtype=np.int64))
        return nearest_stations(asked, self.slots, self.feet_m, float(near_m))

    def stretches(
        self, slots: ArrayLike, window_m: tuple[float, float]
    ) -> list[tuple[float, float]]:
        """Parts of a window on the line, in each of which `stations_of` is the same throughout."""
        low_m, high_m = max(self.line.start_m, window_m[0]), min(self.line.end_m, window_m[1])
        edges = {low_m, high_m}
        for slot in np.unique(np.asarray(slots, dtype=np.int64)):
            alike_m = np.sort(self.feet_m[self.slots == slot])
            middles_m = 0.5 * (alike_m[1:] + alike_m[:-1])
            edges.update(middles_m[(middles_m > low_m) & (middles_m < high_m)].tolist())
        ends_m = sorted(edges)
        return list(pairwise(ends_m))

    def solve(
        self,
        stations: ArrayLike,
        shift_hz: ArrayLike,
        variance_hz2: ArrayLike,
        *,
        window_m: tuple[float, float] | None = None,
        direction: int = 0,
        offset: Prior | None = None,
        speed: Prior | None = None,
    ) -> Answer:
        """Position from the shifts of one block.

        Parameters
        ----------
        stations : int [n]
            Numbers of the stations.
        shift_hz, variance_hz2 : float [n]
            Shifts from the middles of the slots and their variances [Hz], [Hz^2].
        window_m : (float, float), optional
            Chainages between which the train is known to be.
        direction : {1, -1, 0}
            In which direction it may run; 0 = not known.
        offset, speed : Prior, optional
            What is known of the receiver's offset at the carrier [Hz], and of the speed [m/s].

        Returns
        -------
        Answer
            Never a place off the line or outside of the window.

        Raises
        ------
        ValueError
            If the arrays do not fit together, hold what is not finite, or there is no such
            station.
        """
        number = np.asarray(stations, dtype=np.int64)
        z = np.asarray(shift_hz, dtype=np.float64)
        variance = np.asarray(variance_hz2, dtype=np.float64)
        if not (z.shape == variance.shape == number.shape and z.ndim == 1):
            raise ValueError(f"shapes differ: {number.shape}, {z.shape}, {variance.shape}")
        received = np.empty((z.size, 7))
        if not gather_received(number, z, variance, self.stations_m, self._effects, received):
            raise ValueError(
                f"stations must be numbers below {self.slots.size}; shift_hz and variance_hz2"
                " must be finite, variances above zero"
            )
        if z.size < 2:
            return Answer(NoFixReason.TOO_FEW_STATIONS)
        measured = _Measured(self, number, received, offset, speed)
        low_m, high_m = self.line.start_m, self.line.end_m
        if window_m is not None:
            low_m, high_m = max(low_m, window_m[0]), min(high_m, window_m[1])
        first = int(self._grid_m.searchsorted(low_m))
        last = int(self._grid_m.searchsorted(high_m, side="right"))
        if last - first < 3:
            return Answer(NoFixReason.OFF_TRACK)
        places_m = self._grid_m[first:last]
        standing, cost, v = measured.profile(self._rates, first, last, direction)
        ends = [i for i, j in ((0, 1), (-1, -2)) if cost[i] < cost[j]]
        least, order = deepest_minima(cost, _MOST_CANDIDATES)
        if standing <= least + _MOVING_SIGMAS**2:
            return Answer(NoFixReason.STANDSTILL)
        solutions = measured.refine(places_m[order].tolist(), v[order].tolist(), (low_m, high_m))
        if direction:
            solutions = [f for f in solutions if f.speed_mps * direction > 0.0]
        if not solutions:
            return Answer(NoFixReason.OFF_TRACK if ends else NoFixReason.GEOMETRY)
        best = solutions[0]
        if any(cost[i] < best.chi_square + _CLEARLY_WORSE for i in ends):
            return Answer(NoFixReason.OFF_TRACK)
        if best.freedom > 0 and best.chi_square > chdtri(best.freedom, _CHI_SQUARE_RISK):
            return Answer(NoFixReason.INCONSISTENT)
        if abs(best.speed_mps) < _MOVING_SIGMAS * sqrt(float(best.covariance[1, 1])):
            return Answer(NoFixReason.STANDSTILL)
        if not best.sigma_m <= self._worst_m or measured.bent(best):
            return Answer(NoFixReason.GEOMETRY)
        for other in solutions[1:]:
            apart_m = abs(other.chainage_m - best.chainage_m)
            if apart_m > 4.0 * best.sigma_m and other.chi_square < best.chi_square + _CLEARLY_WORSE:
                return Answer(NoFixReason.AMBIGUOUS)
        return Answer(NoFixReason.NONE, best)


class _Measured:
    """The shifts of a block, and what they say of any place."""

    def __init__(
        self,
        solver: DopplerSolver,
        number: NDArray[np.int64],
        received: FloatArray,
        offset: Prior | None,
        speed: Prior | None,
    ) -> None:
        self._number, self._received = number, received
        self._informed = (offset is not None) + (speed is not None)
        offset = offset or solver._widest
        speed = speed or Prior(0.0, 2.0 * solver.plan.max_speed_mps)
        self._known = (speed.mean, speed.sigma**-2, offset.mean, offset.sigma**-2)
        self.cost = ShiftCost(
            solver.line, self._received, solver.plan.averaging_time_s, self._known
        )

    def profile(
        self, rates: FloatArray, first: int, last: int, direction: int
    ) -> tuple[float, FloatArray, FloatArray]:
        """Cost of standing; least cost and best speed at places of the grid (`cost_profile`)."""
        return cost_profile(
            rates, self._number, first, last, self._received, self._known, direction
        )

    def refine(
        self, places_m: list[float], speeds_mps: list[float], window_m: tuple[float, float]
    ) -> list[DopplerSolution]:
        """Minima near places at speeds, the best first; none that leaves the window."""
        solutions = []
        best = inf
        for s, v in zip(places_m, speeds_mps, strict=True):
            here = self.cost.minimum((s, v, self._known[2]), window_m, best + 2.0 * _CLEARLY_WORSE)
            if here is not None:
                solutions.append(here)
                best = min(best, here.cost)
        solutions.sort(key=lambda minimum: minimum.cost)
        freedom = len(self._number) + self._informed - 3
        return [DopplerSolution(*m.at, m.covariance, m.cost, freedom) for m in solutions]

    def bent(self, fix: DopplerSolution) -> bool:
        """Whether the cost is no parabola within two sigma, so that the covariance misleads."""
        ds, dv, dd = (2.0 / fix.sigma_m * fix.covariance[0]).tolist()
        s, v, delta = fix.chainage_m, fix.speed_mps, fix.offset_hz
        sides = (s + ds, v + dv, delta + dd), (s - ds, v - dv, delta - dd)
        return any(abs(self.cost(side) - fix.chi_square - 4.0) > _BENT for side in sides)


def speed_from_shift(
    plan: TonePlan, slot: int, shift_hz: float, rate: float, *, offset_hz: float = 0.0
) -> float:
    """Speed from one shift at a known place (S1, claim 7) [m/s]; infinite abeam.

    Parameters
    ----------
    rate : float
        dR/ds of the station at the place.
    """
    tone_hz = plan.tone_hz(slot)
    own_hz = shift_hz - tone_hz / plan.carrier_hz * offset_hz
    return inf if rate == 0.0 else -own_hz * SPEED_OF_LIGHT_M_PER_S / (tone_hz * rate)
