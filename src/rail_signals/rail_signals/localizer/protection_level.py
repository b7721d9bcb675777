"""The interval that holds the train, and what it is good for."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import inf
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .filter_bank import BoolArray, FilterBank, FloatArray, S, V, Values
from .integrity_monitor import HYPOTHESES, IntegrityMonitor
from .settings import SENSORS, IntegrityClaim, Sensor

IntArray: TypeAlias = NDArray[np.int64]
#: Of the hypothesis that the wheels are faulty.
_WHEELS: Final = 1 + Sensor.ODOMETER.value
_NO_SENSOR: Final[frozenset[Sensor]] = frozenset()


class Status(IntEnum):
    """What a position is good for."""

    UNAVAILABLE = 0
    UNMONITORED = 1
    """Holds unless one of certain sensors is faulty."""
    PROTECTED = 2
    """Holds even if any one sensor is faulty."""


class ProtectionReason(IntEnum):
    """Why a position is not, or not fully, protected."""

    NONE = 0
    NO_FIX = 1
    """No position has been received yet, or the last is too long ago."""
    TOO_WIDE = 2
    """The interval would be wider than any that is given."""
    AMBIGUOUS = 3
    """A sensor is faulty, and without one that it may be the position is not known."""
    CONTRADICTION = 4
    """More than one sensor must be faulty."""
    TOO_FEW_SENSORS = 5
    """Without one of the sensors the position would not be known."""
    UNMONITORED_TOO_LONG = 6
    """The same, for longer than it is put up with."""


class Estimate(NamedTuple):
    """What is known of every run [...].

    Attributes
    ----------
    position_m, low_m, high_m : float64
        Chainage and the interval that holds it; NaN and infinite where not available.
    speed_mps, speed_low_mps, speed_high_mps : float64
        The same of the speed, positive with chainage.
    fastest_mps : float64
        Greatest speed of either direction, unless wheels deceive that have not been found out
        yet; see `ProtectionLevels`.
    sigma_m : float64
        Standard deviation of the position if no sensor is faulty.
    status, reason : int64
        As `Status` and `ProtectionReason`.
    detected : bool
        Whether a sensor is known to be faulty.
    wheels_doubted : bool
        Whether that may be the wheels, or they slip, slide, or send nothing.
    excluded : bool [..., sensor]
        Sensors that are left out.
    uncovered : bool [..., sensor]
        Sensors whose fault the interval does not survive.
    """

    position_m: FloatArray
    low_m: FloatArray
    high_m: FloatArray
    speed_mps: FloatArray
    speed_low_mps: FloatArray
    speed_high_mps: FloatArray
    fastest_mps: FloatArray
    sigma_m: FloatArray
    status: IntArray
    reason: IntArray
    detected: BoolArray
    wheels_doubted: BoolArray
    excluded: BoolArray
    uncovered: BoolArray

    @property
    def protection_m(self) -> FloatArray:
        """Protection level: within ``position_m`` ± this; infinite where not available."""
        level_m = np.maximum(self.high_m - self.position_m, self.position_m - self.low_m)
        return np.where(np.isnan(level_m), np.inf, level_m)


@dataclass(frozen=True)
class Localization:
    """What is known of one train: an `Estimate` in plain types.

    Parameters
    ----------
    position_m, low_m, high_m : float
        Chainage and the interval that holds it; NaN and infinite if not available.
    speed_mps, speed_low_mps, speed_high_mps : float
        The same of the speed, positive with chainage.
    fastest_mps : float
        As of `Estimate`.
    sigma_m : float
        Standard deviation of the position if no sensor is faulty.
    status : Status
    reason : ProtectionReason
        Why the status is no better.
    detected : bool
        Whether a sensor is known to be faulty.
    wheels_doubted : bool
        As of `Estimate`.
    excluded, uncovered : frozenset of Sensor
        Sensors left out, and those whose fault the interval does not survive.
    """

    position_m: float
    low_m: float
    high_m: float
    speed_mps: float
    speed_low_mps: float
    speed_high_mps: float
    fastest_mps: float
    sigma_m: float
    status: Status
    reason: ProtectionReason
    detected: bool
    wheels_doubted: bool
    excluded: frozenset[Sensor]
    uncovered: frozenset[Sensor]

    @classmethod
    def of(cls, estimate: Estimate) -> Localization:
        """Of the estimate of a localizer of one train."""
        return cls(
            float(estimate.position_m),
            float(estimate.low_m),
            float(estimate.high_m),
            float(estimate.speed_mps),
            float(estimate.speed_low_mps),
            float(estimate.speed_high_mps),
            float(estimate.fastest_mps),
            float(estimate.sigma_m),
            Status(int(estimate.status)),
            ProtectionReason(int(estimate.reason)),
            bool(estimate.detected),
            bool(estimate.wheels_doubted),
            _sensors(estimate.excluded.tolist()),
            _sensors(estimate.uncovered.tolist()),
        )

    @property
    def protection_m(self) -> float:
        """Protection level: the train is within ``position_m`` ± this; infinite if unavailable."""
        if self.status is Status.UNAVAILABLE:
            return inf
        return max(self.high_m - self.position_m, self.position_m - self.low_m)


def _sensors(flags: list[bool]) -> frozenset[Sensor]:
    # Nearly always none is: the members of an enumeration are slow to go through.
    return frozenset(sensor for sensor in Sensor if flags[sensor]) if any(flags) else _NO_SENSOR


class ProtectionLevels:
    """Turns the possible hypotheses into an interval.

    **A hypothesis that makes the interval too wide is no help.** Without sensor i the train may be
    known so badly that the hull is wider than any that is given, as after a long way on wheels
    that spun. The others hold it nevertheless, unless i is faulty: i is then uncovered, as where
    the filter without it is lost. Where nothing but the wheels is heard, theirs is lost at once.

    **The fastest speed.** Without the wheels a speed is that of ranges, and some metres per second
    uncertain at a stand as well. Nothing else that a train has can tell whether wheels have begun
    to deceive a second ago, and supervision that reckoned with it at all times would let no train
    move. The fastest speed is therefore that of the wheels and of their creep under full effort,
    until they are *doubted*: they slip or slide, send nothing, or a fault has been found that may
    be theirs. From then on it is that of the hull. The position rests on no such trust: while
    wheels deceive unseen the train stays within its interval.

    Parameters
    ----------
    claim : IntegrityClaim
    shape : tuple of int
        Of the runs.
    """

    def __init__(self, claim: IntegrityClaim, shape: tuple[int, ...] = ()) -> None:
        self._claim, self._sigmas = claim, claim.sigmas
        self._unmonitored_s = np.zeros(shape)
        none, all_well = np.zeros((*shape, SENSORS), np.bool_), np.zeros(shape, np.bool_)
        protected = np.full(shape, int(Status.PROTECTED))
        self._all_well = (protected, np.zeros(shape, np.int64), all_well)
        self._none_out = (none, none)
        for array in (*self._all_well, none):
            array.setflags(write=False)

    def estimate(
        self,
        bank: FilterBank,
        monitor: IntegrityMonitor,
        step_s: float,
        wheels_mps: Values = np.inf,
        silent: bool | BoolArray = False,
    ) -> Estimate:
        """What may be claimed at the end of a tick.

        Parameters
        ----------
        bank : FilterBank
        monitor : IntegrityMonitor
        step_s : float
            Since the tick before.
        wheels_mps : float or float64 [...]
            Fastest speed by the wheels, as of `SlipDetector`; infinite where they do not tell.
        silent : bool or bool [...]
            Whether nothing but the wheels has been heard for long.
        """
        at = bank.x[: V + 1, ..., :HYPOTHESES]
        sigma = np.sqrt(bank.variances[: V + 1, ..., :HYPOTHESES])
        half = self._sigmas * sigma
        low, high = at - half, at + half
        middle, sigma_m = at[..., 0].copy(), sigma[S, ..., 0]
        if monitor.quiet and bank.known[..., :HYPOTHESES].all():
            lowest, highest = low.min(axis=-1), high.max(axis=-1)
            # So narrow that each of the intervals is, and the hull about any middle.
            if (highest[S] - lowest[S]).max() <= self._claim.widest_m and not np.any(silent):
                self._unmonitored_s.fill(0.0)
                doubted = np.isinf(wheels_mps)
                fastest = np.where(doubted, _fastest(lowest[V], highest[V]), wheels_mps)
                well = (*self._all_well, doubted, *self._none_out)
                return _estimate(middle, lowest, highest, fastest, sigma_m, *well)

        covered = bank.known[..., :HYPOTHESES] & (half[S] <= self._claim.widest_m)
        possible = monitor.refuted_s <= 0.0
        healthy = possible[..., 0]
        reach = np.maximum(high[S] - middle[S][..., None], middle[S][..., None] - low[S])
        covered &= ~((healthy & covered[..., 0])[..., None] & (reach > self._claim.widest_m))
        covered[..., _WHEELS] &= ~(healthy & silent)
        excluded = monitor.excluded.sum(axis=-1)
        # One sensor is faulty at most: once it is excluded, none of the others is.
        considered = possible & ((excluded == 0)[..., None] | (np.arange(HYPOTHESES) == 0))
        hull = considered & covered
        doubted = monitor.excluded[..., Sensor.ODOMETER] | (~healthy & considered[..., _WHEELS])
        doubted |= np.isinf(wheels_mps)
        low = np.where(hull, low, np.inf).min(axis=-1)
        high = np.where(hull, high, -np.inf).max(axis=-1)
        with np.errstate(invalid="ignore"):
            middle = np.where(healthy, middle, 0.5 * (low + high))
            # Said so that NaN is too wide as well.
            wide = ~(np.maximum(high - middle, middle - low)[S] <= self._claim.widest_m)
        uncovered = considered[..., 1:] & ~covered[..., 1:]
        some = uncovered.any(axis=-1)
        contrary = ~possible.any(axis=-1) | (excluded > 1) | ((excluded == 1) & ~healthy)
        reason = np.full(wide.shape, int(ProtectionReason.NONE))
        # The last that applies is reported.
        for which, why in (
            (some, ProtectionReason.TOO_FEW_SENSORS),
            (wide | (healthy & ~covered[..., 0]), ProtectionReason.TOO_WIDE),
            (healthy & ~bank.known[..., 0], ProtectionReason.NO_FIX),
            (some & ~healthy, ProtectionReason.AMBIGUOUS),
            (contrary, ProtectionReason.CONTRADICTION),
        ):
            reason[which] = why
        few = reason == ProtectionReason.TOO_FEW_SENSORS
        self._unmonitored_s = np.where(few, self._unmonitored_s + step_s, 0.0)
        reason[self._unmonitored_s > self._claim.unmonitored_s] = (
            ProtectionReason.UNMONITORED_TOO_LONG
        )

        status = np.full(reason.shape, int(Status.UNAVAILABLE))
        status[reason == ProtectionReason.NONE] = Status.PROTECTED
        status[reason == ProtectionReason.TOO_FEW_SENSORS] = Status.UNMONITORED
        gone = status == Status.UNAVAILABLE
        low, high = np.where(gone, -np.inf, low), np.where(gone, np.inf, high)
        middle, sigma_m = np.where(gone, np.nan, middle), np.where(gone, np.inf, sigma_m)
        fastest = np.where(doubted, _fastest(low[V], high[V]), wheels_mps)
        fastest = np.where(gone, np.inf, fastest)
        detected = ~healthy | (excluded > 0)
        excluded_now = monitor.excluded.copy()
        good_for = (status, reason, detected, doubted, excluded_now, uncovered)
        return _estimate(middle, low, high, fastest, sigma_m, *good_for)


def _fastest(low_mps: FloatArray, high_mps: FloatArray) -> FloatArray:
    """Greatest speed of either direction."""
    return np.maximum(high_mps, -low_mps)


def _estimate(
    middle: FloatArray,
    low: FloatArray,
    high: FloatArray,
    fastest: FloatArray,
    sigma_m: FloatArray,
    status: IntArray,
    reason: IntArray,
    detected: BoolArray,
    doubted: BoolArray,
    excluded: BoolArray,
    uncovered: BoolArray,
) -> Estimate:
    return Estimate(
        *(middle[S], low[S], high[S], middle[V], low[V], high[V], fastest),
        *(sigma_m, status, reason, detected, doubted, excluded, uncovered),
    )
