"""A bank of Kalman filters on the chainage of a train, one for each set of sensors left out.

All filters have the same seven states:

    s, v, a      chainage [m], speed [m/s], acceleration [m/s^2] along it
    k            relative error of the wheels' scale
    u            speed by which the wheels slip [m/s]
    b            bias of the range [m]
    d            bias of the Doppler position, over the sigma stated with it

The last four are Gauss-Markov processes: what a sensor is wrong by for long has a sigma of its
own, so no number of readings makes a filter believe that it is not there. The first filter uses
every sensor; one more leaves out each of them, and one each pair. Readings enter one scalar at a
time with the gains that are optimal, for which Joseph's form is ``P - g g' / S``: computed from one
vector g it stays symmetric to the last bit, and positive while the prior variance over that of the
noise is far below 1e16 (at most 1e10 here).

Arrays are [state, ..., filter] and [state, state, ..., filter] where ``...`` are independent runs:
with the states first NumPy's inner loops run over runs and filters instead of over seven states.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from itertools import combinations
from math import ceil, log2
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from .filter_kernel import predict_filters, take_scalar
from .settings import LocalizerSettings, MotionModel, Sensor

FloatArray: TypeAlias = NDArray[np.float64]
BoolArray: TypeAlias = NDArray[np.bool_]
Values: TypeAlias = float | FloatArray
#: A row of the measurement matrix: states and their coefficients; None is one.
MeasurementRow: TypeAlias = Sequence[tuple[int, Values | None]]

STATES: Final = 7
S, V, A, SCALE, SLIP, RANGE_BIAS, DOPPLER_BIAS = range(STATES)

FILTERS: Final = tuple(
    frozenset(left_out) for size in range(3) for left_out in combinations(Sensor, size)
)
"""Sensors left out by each filter: none, each one, each pair."""
USES: Final[BoolArray] = np.array([[s not in out for out in FILTERS] for s in Sensor])
"""Which filters use a sensor [sensor, filter]."""

PRIOR_M: Final = 1e4
"""Sigma of the chainage before the first fix, about that fix."""
PRIOR_MPS: Final = 30.0
"""Sigma of the speed when nothing is known of it."""
LOST_M: Final = 1e3
"""A filter less sure of its chainage than this begins anew with the next fix."""


class UpdateResult(NamedTuple):
    """What became of a scalar reading.

    Attributes
    ----------
    refused : bool [..., filter], optional
        Offered, but outside of the gate; None if no filter would refuse it.
    innovation, variance : float64 [..., filter]
        Reading less its prediction, and the variance of that.
    """

    refused: BoolArray | None
    innovation: FloatArray
    variance: FloatArray


Outcomes: TypeAlias = tuple[UpdateResult, ...]
"""Of a reading, one for each of its scalars."""


@lru_cache(maxsize=16)
def singer(step_s: float, motion: MotionModel) -> tuple[FloatArray, FloatArray]:
    """Transition of (s, v, a) over a step and the covariance added in it, each [3, 3].

    White noise of density ``2 sigma^2 / T`` drives ``da/dt = -a / T + w`` (Singer, IEEE Trans.
    AES-6(4), 1970); integrated by the exponential of a block matrix (Van Loan, IEEE Trans.
    AC-23(3), 1978).

    Examples
    --------
    >>> transition, added = singer(0.1, MotionModel(0.8, 5.0))
    >>> bool(abs(transition[2, 2] - np.exp(-0.02)) < 1e-15)
    True
    >>> bool(abs(added[2, 2] - 0.8**2 * (1.0 - np.exp(-0.04))) < 1e-15)
    True
    """
    rate = 1.0 / motion.correlation_s
    drift = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -rate]])
    block = np.zeros((6, 6))
    block[:3, :3], block[3:, 3:] = -drift, drift.T
    block[2, 5] = 2.0 * motion.acceleration_mps2**2 * rate
    # Half of the block grows where the other one decays: long steps are doubled from short ones.
    halvings = max(0, ceil(log2(step_s * rate))) if step_s > 0.0 else 0
    integrated = expm(block * (step_s / 2**halvings))
    transition = integrated[3:, 3:].T
    added = transition @ integrated[:3, 3:]
    for _ in range(halvings):
        added = transition @ added @ transition.T + added
        transition = transition @ transition
    added = 0.5 * (added + added.T)
    for matrix in (transition, added):
        matrix.setflags(write=False)
    return transition, added


def combine(row: MeasurementRow, by_state: FloatArray) -> FloatArray:
    """Sum of what belongs to the states of a row, times its coefficients.

    Examples
    --------
    >>> float(combine([(S, None), (V, 2.0)], np.arange(7.0) + 1.0))
    5.0
    """
    state, coefficient = row[0]
    total: FloatArray = by_state[state]
    if coefficient is not None:
        total = coefficient * total
    for state, coefficient in row[1:]:
        total = total + (by_state[state] if coefficient is None else coefficient * by_state[state])
    return total


def _plain(values: Iterable[Values | None]) -> list[float] | None:
    """Floats, one for None; None if a value is not the same for all filters.

    Examples
    --------
    >>> _plain([None, 2.0, np.array([3.0])]), _plain([np.zeros(11)])
    ([1.0, 2.0, 3.0], None)
    """
    numbers: list[float] = []
    for value in values:
        if value is None:
            numbers.append(1.0)
        elif isinstance(value, float):
            numbers.append(value)
        elif np.size(value) == 1:
            numbers.append(float(np.asarray(value).item()))
        else:
            return None
    return numbers


class FilterBank:
    """States and covariances of all filters of all runs.

    Parameters
    ----------
    settings : LocalizerSettings
    shape : tuple of int
        Of the runs; empty for one train.

    Attributes
    ----------
    x, p : float64 [state, ..., filter], [state, state, ..., filter]
    variances : float64 [state, ..., filter]
        The diagonal of `p`, a view.
    known : bool [..., filter]
        Whether there is a position; without it the others mean nothing.
    most : float64 [4, 1...]
        Variances of k, u, b and d when nothing is known of them, that of u infinite.
    """

    def __init__(self, settings: LocalizerSettings, shape: tuple[int, ...] = ()) -> None:
        self._motion, self._alone = settings.motion, not shape
        self._gate2 = settings.claim.threshold(1) ** 2
        motion, wheels = settings.motion, settings.odometer
        bias_m, doppler = settings.ranging.bias_m, settings.doppler
        settled = np.array([0.0, 0.0, 0.0, wheels.scale**2, 0.0, bias_m**2, doppler.correlated**2])
        self._prior = settled + np.array(
            [
                PRIOR_M**2,
                PRIOR_MPS**2,
                motion.acceleration_mps2**2,
                0.0,
                wheels.creep_mps**2,
                0.0,
                0.0,
            ]
        )
        lengths_m = np.full(STATES, np.inf)
        lengths_m[SCALE] = wheels.scale_length_m
        lengths_m[RANGE_BIAS] = settings.ranging.bias_length_m
        lengths_m[DOPPLER_BIAS] = doppler.length_m
        times_s = np.full(STATES, np.inf)
        times_s[A], times_s[SLIP] = motion.correlation_s, wheels.correlation_s
        column = (STATES, *(1 for _ in shape), 1)
        # Decay of every state with the distance run and with time, and what variances settle at.
        self._per_m, self._per_s = -1.0 / lengths_m.reshape(column), -1.0 / times_s.reshape(column)
        self._settled = np.empty((STATES, *shape, 1))
        self._settled[...] = settled.reshape(column)
        self.most = np.where(settled > 0.0, settled, np.inf)[SCALE:].reshape(-1, *column[1:])
        filters = (*shape, len(FILTERS))
        self._corner = (3, 3, *(1 for _ in filters))
        self.x = np.zeros((STATES, *filters))
        self.p = np.zeros((STATES, STATES, *filters))
        self.variances: FloatArray = np.einsum("ii...->i...", self.p)
        self.known = np.zeros(filters, dtype=np.bool_)
        self._all_known = False
        self.forget(~self.known)

    def forget(self, which: BoolArray) -> None:
        """Let filters [..., filter] know nothing."""
        self.known[which] = False
        self._all_known = False
        self.x[:, which] = 0.0
        self.p[:, :, which] = np.diag(self._prior)[:, :, None]

    def place(
        self,
        which: BoolArray,
        chainage_m: Values,
        sigma_m: float,
        speed_mps: float,
        sigma_mps: float,
    ) -> None:
        """Put all filters of some runs [...] where the train is known to be."""
        which = np.broadcast_to(which[..., None], self.known.shape)
        self.forget(which)
        self.x[S][which] = np.broadcast_to(chainage_m, which.shape)[which]
        self.x[V][which] = speed_mps
        self.variances[S][which], self.variances[V][which] = sigma_m**2, sigma_mps**2
        self.known |= which

    def predict(self, step_s: float, slip_mps: Values, new_station: bool | BoolArray) -> None:
        """Let time pass.

        Parameters
        ----------
        step_s : float
            From the tick before to this one.
        slip_mps : float or float64 [..., 1]
            Sigma that the slip tends to.
        new_station : bool or bool [..., 1]
            Whether ranges come from another station now, with a bias of its own.
        """
        x, p = self.x, self.p
        transition, added = singer(step_s, self._motion)
        self._settled[SLIP] = np.square(slip_mps)
        if self._alone:
            anew = RANGE_BIAS if new_station is not False and np.any(new_station) else -1
            pace = self._per_m, self._per_s, self._settled
            predict_filters(x, p, step_s, transition, added, *pace, anew)
            return
        decay = np.exp(self._per_m * (step_s * np.abs(x[V])) + step_s * self._per_s)
        if new_station is not False:
            decay[RANGE_BIAS] *= np.logical_not(new_station)

        # F = D L: the shear L of (s, v, a), then the decay D of every state. Rows are copied into
        # columns, so that the matrix stays symmetric to the last bit.
        shear = transition[:2]
        x[:2] = (shear @ x[:3].reshape(3, -1)).reshape(x[:2].shape)
        x *= decay
        rows = (shear @ p[:3].reshape(3, -1)).reshape(p[:2].shape)
        corner = rows[:, :3]
        rows[:, :2] = (shear @ corner.reshape(2, 3, -1)).reshape(rows[:, :2].shape)
        rows[V, S] = rows[S, V]
        p[:2] = rows
        p[:, :2] = rows.swapaxes(0, 1)
        p *= decay[:, None] * decay

        p[:3, :3] += added.reshape(self._corner)
        decay *= decay
        self.variances += self._settled * (1.0 - decay)

    def take(
        self, row: MeasurementRow, reading: Values, variance: Values, use: BoolArray
    ) -> UpdateResult:
        """Take a scalar reading ``reading = row x + noise``.

        Parameters
        ----------
        row : MeasurementRow
            Coefficients, each a float or float64 [..., 1 or filter].
        reading, variance : float or float64 [..., 1 or filter]
            The reading, finite even where it is not used, and the variance of its noise.
        use : bool [..., filter]
            Which filters it is offered to.
        """
        if self._alone and (numbers := _plain((reading, variance, *(c for _, c in row)))):
            return self._take_alone([state for state, _ in row], numbers, use)
        g = combine(row, self.p)
        innovation = reading - combine(row, self.x)
        total = combine(row, g) + variance
        weight = 1.0 / np.sqrt(total)
        normal = innovation * weight
        inside = normal * normal <= self._gate2
        refused = None
        if not inside.all():
            refused = use & ~inside
            use = use & inside
        g = g * (weight * use)
        self.x += g * normal
        self.p -= g[:, None] * g
        return UpdateResult(refused, innovation, total)

    def _take_alone(
        self, states: Sequence[int], numbers: Sequence[float], use: BoolArray
    ) -> UpdateResult:
        """Take a reading of one train: its value and variance, and the coefficients."""
        reading, variance, *factors = numbers
        refused = np.empty(use.shape, dtype=np.bool_)
        innovation, total = np.empty(use.shape), np.empty(use.shape)
        outside = take_scalar(
            self.x,
            self.p,
            np.array(states),
            np.array(factors),
            reading,
            variance,
            self._gate2,
            use,
            refused,
            innovation,
            total,
        )
        return UpdateResult(refused if outside else None, innovation, total)

    def start(self, chainage_m: Values, use: BoolArray) -> None:
        """Let filters that know no position begin about a fix, to be taken right after."""
        if self._all_known:
            return
        fresh = use & ~self.known
        if fresh.any():
            self._open(fresh)
            self.x[S][fresh] = np.broadcast_to(chainage_m, fresh.shape)[fresh]
            self.known |= fresh

    def lose(self) -> None:
        """Give up the positions that have become too uncertain; at the end of a tick."""
        widest2 = self.variances[S].max()
        if self._all_known and widest2 <= LOST_M**2:
            return
        self.known &= self.variances[S] <= LOST_M**2
        self._all_known = bool(self.known.all())
        if widest2 > 4.0 * PRIOR_M**2:
            self._open(self.variances[S] > 4.0 * PRIOR_M**2)

    def _open(self, which: BoolArray) -> None:
        """Let filters know nothing of the position, and nothing by it."""
        self.p[S, :, which] = 0.0
        self.p[:, S, which] = 0.0
        self.variances[S][which] = PRIOR_M**2
