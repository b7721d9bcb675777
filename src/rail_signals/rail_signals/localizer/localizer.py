"""Where a train is, from all that it hears: the localizer on board.

It fuses positions by phase ranging, positions and speeds by Doppler shifts, the joints passed when
track codes change, and the speed of the wheels, and claims an interval that holds the train even
if any one of them is wrong. What it does with a tick is `LocalizerCore`; here readings that cannot
be used are kept out, and counted.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from enum import Enum
from math import inf, isfinite
from typing import Final

from .core import LocalizerCore
from .protection_level import Estimate, Reason, Status
from .readings import BlockReading, DopplerReading, OdometerReading, RangeReading, TickReadings
from .settings import LocalizerSettings, Sensor

MOST_M: Final = 1e7
"""No chainage is further from zero."""
MOST_MPS: Final = 200.0
"""No train and no wheel is faster."""
_SAME_TIME_S: Final = 1e-6


class Ignored(Enum):
    """Why a reading was not used."""

    NOT_FINITE = "not finite"
    IMPLAUSIBLE = "implausible"
    BAD_VARIANCE = "variance not above zero"
    FUTURE = "from the future"
    TOO_OLD = "too old"
    BACKWARDS = "older than the one before"
    REPEATED = "the same as the one before"


@dataclass(frozen=True)
class RangeFix:
    """Chainage by phase ranging, true at ``stamp_s``; ``station`` tells which one measured it."""

    stamp_s: float
    chainage_m: float
    variance_m2: float
    station: int = 0


@dataclass(frozen=True)
class DopplerFix:
    """Chainage and speed by Doppler shifts, positive with chainage, with their covariance."""

    stamp_s: float
    chainage_m: float
    speed_mps: float
    variance_m2: float
    covariance_m2ps: float
    speed_variance_m2ps2: float


@dataclass(frozen=True)
class BlockEntry:
    """A new block was noticed at ``stamp_s``, entered by the joint at ``joint_m``."""

    stamp_s: float
    joint_m: float


@dataclass(frozen=True)
class WheelSpeed:
    """Speed of the wheels at ``stamp_s``, positive in the direction of travel.

    A distance counted over a tick, divided by the tick, is the speed in the middle of it.
    """

    stamp_s: float
    speed_mps: float


@dataclass(frozen=True)
class Localization:
    """Where the train is at ``time_s``.

    Parameters
    ----------
    time_s : float
    position_m, low_m, high_m : float
        Chainage and the interval that holds it; NaN and infinite if not available.
    speed_mps, speed_low_mps, speed_high_mps : float
        The same of the speed, positive with chainage.
    sigma_m : float
        Standard deviation of the position if no sensor is faulty.
    status : Status
    reason : Reason
        Why the status is no better.
    found : bool
        Whether a sensor is known to be faulty.
    excluded, uncovered : frozenset of Sensor
        Sensors left out, and those whose fault the interval does not survive.
    """

    time_s: float
    position_m: float
    low_m: float
    high_m: float
    speed_mps: float
    speed_low_mps: float
    speed_high_mps: float
    sigma_m: float
    status: Status
    reason: Reason
    found: bool
    excluded: frozenset[Sensor]
    uncovered: frozenset[Sensor]

    @property
    def protection_m(self) -> float:
        """Protection level: the train is within ``position_m`` ± this; infinite if unavailable."""
        if self.status is Status.UNAVAILABLE:
            return inf
        return max(self.high_m - self.position_m, self.position_m - self.low_m)


class Localizer:
    """The localizer of one train that runs one way.

    Parameters
    ----------
    settings : LocalizerSettings
        Assumptions about motion, sensors and faults.

    Examples
    --------
    >>> localizer = Localizer(LocalizerSettings())
    >>> localizer.tick(0.0, wheels=WheelSpeed(0.0, 20.0)).reason.name
    'NO_FIX'
    >>> localizer.place(1000.0, 1.0, speed_mps=20.0)
    >>> for tick in range(1, 11):
    ...     now_s = tick / 10
    ...     here = localizer.tick(
    ...         now_s,
    ...         ranging=RangeFix(now_s, 1000.0 + 20.0 * now_s, 0.02),
    ...         wheels=WheelSpeed(now_s, 20.0),
    ...     )
    >>> round(here.position_m), here.low_m < 1020.0 < here.high_m, here.status.name
    (1020, True, 'PROTECTED')
    """

    def __init__(self, settings: LocalizerSettings) -> None:
        self._settings = settings
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on."""
        self._core = LocalizerCore(self._settings)
        self._time_s = -inf
        self._last: dict[Sensor, tuple[float, float, float]] = {}
        self.ignored: Counter[tuple[Sensor, Ignored]] = Counter()
        """How many readings were not used, and why."""

    def place(
        self, chainage_m: float, sigma_m: float, *, speed_mps: float = 0.0, sigma_mps: float = 0.05
    ) -> None:
        """Say where the train is, from outside: taken as true by every filter.

        No fault of a sensor is guarded against by it, and none makes it wrong.

        Raises
        ------
        ValueError
            If a figure is not finite or a sigma not above zero.
        """
        self._core.place(chainage_m, sigma_m, speed_mps=speed_mps, sigma_mps=sigma_mps)

    def tick(
        self,
        time_s: float,
        *,
        ranging: RangeFix | None = None,
        doppler: DopplerFix | None = None,
        block: BlockEntry | None = None,
        wheels: WheelSpeed | None = None,
    ) -> Localization:
        """Take what came since the tick before, and say where the train is now.

        A reading that cannot be used is ignored and counted in `ignored`.

        Raises
        ------
        ValueError
            If the time is not finite or not later than that of the tick before.
        """
        if not (isfinite(time_s) and time_s > self._time_s):
            raise ValueError(f"time_s: {time_s} is not later than {self._time_s}")
        step_s = 0.0 if self._time_s == -inf else time_s - self._time_s
        self._time_s = time_s
        readings = TickReadings(
            None if ranging is None else self._range(ranging),
            None if doppler is None else self._doppler(doppler),
            None if block is None else self._block(block),
            None if wheels is None else self._wheels(wheels),
        )
        return _localization(time_s, self._core.step(step_s, readings))

    def _range(self, fix: RangeFix) -> RangeReading | None:
        age_s = self._age_s(
            Sensor.RANGE, fix.stamp_s, (fix.chainage_m, 0.0), (fix.variance_m2, 1.0, 0.0)
        )
        if age_s is None:
            return None
        return RangeReading(fix.chainage_m, fix.variance_m2, age_s, float(fix.station))

    def _doppler(self, fix: DopplerFix) -> DopplerReading | None:
        covariance = (fix.variance_m2, fix.speed_variance_m2ps2, fix.covariance_m2ps)
        told = (fix.chainage_m, fix.speed_mps)
        age_s = self._age_s(Sensor.DOPPLER, fix.stamp_s, told, covariance)
        if age_s is None:
            return None
        variance_m2, speed_variance, covariance_m2ps = covariance
        return DopplerReading(*told, variance_m2, covariance_m2ps, speed_variance, age_s)

    def _block(self, entry: BlockEntry) -> BlockReading | None:
        age_s = self._age_s(Sensor.BLOCK, entry.stamp_s, (entry.joint_m, 0.0))
        return None if age_s is None else BlockReading(entry.joint_m, age_s)

    def _wheels(self, told: WheelSpeed) -> OdometerReading | None:
        age_s = self._age_s(Sensor.ODOMETER, told.stamp_s, (0.0, told.speed_mps))
        return None if age_s is None else OdometerReading(told.speed_mps, age_s)

    def _age_s(
        self,
        sensor: Sensor,
        stamp_s: float,
        told: tuple[float, float],
        covariance: tuple[float, float, float] = (1.0, 1.0, 0.0),
    ) -> float | None:
        """Age of a reading; None if it is not to be used."""
        why = self._objection(sensor, stamp_s, told, covariance)
        if why is not None:
            self.ignored[sensor, why] += 1
            return None
        self._last[sensor] = (stamp_s, *told)
        return round(max(0.0, self._time_s - stamp_s), 9)

    def _objection(
        self,
        sensor: Sensor,
        stamp_s: float,
        told: tuple[float, float],
        covariance: tuple[float, float, float],
    ) -> Ignored | None:
        chainage_m, speed_mps = told
        first, second, mixed = covariance
        if not (isfinite(stamp_s) and isfinite(chainage_m) and isfinite(speed_mps)):
            return Ignored.NOT_FINITE
        if not (isfinite(first) and isfinite(second) and isfinite(mixed)):
            return Ignored.NOT_FINITE
        if abs(chainage_m) > MOST_M or abs(speed_mps) > MOST_MPS:
            return Ignored.IMPLAUSIBLE
        if not (first > 0.0 and second > 0.0 and mixed * mixed <= first * second):
            return Ignored.BAD_VARIANCE
        if stamp_s > self._time_s + _SAME_TIME_S:
            return Ignored.FUTURE
        if self._time_s - stamp_s > self._settings.claim.oldest_s:
            return Ignored.TOO_OLD
        last = self._last.get(sensor)
        if last is None:
            return None
        if stamp_s < last[0]:
            return Ignored.BACKWARDS
        # A measurement has noise: the same figures again are no new measurement, even of a train
        # at a stand. Wheels that stand or keep their speed do repeat themselves, joints may.
        measured = sensor in (Sensor.RANGE, Sensor.DOPPLER)
        if stamp_s == last[0] or (measured and told == last[1:]):
            return Ignored.REPEATED
        return None


def _localization(time_s: float, told: Estimate) -> Localization:
    return Localization(
        time_s,
        float(told.position_m),
        float(told.low_m),
        float(told.high_m),
        float(told.speed_mps),
        float(told.speed_low_mps),
        float(told.speed_high_mps),
        float(told.sigma_m),
        Status(int(told.status)),
        Reason(int(told.reason)),
        bool(told.found),
        _sensors(told.excluded.tolist()),
        _sensors(told.uncovered.tolist()),
    )


def _sensors(flags: list[bool]) -> frozenset[Sensor]:
    return _NONE if not any(flags) else frozenset(s for s in Sensor if flags[s])


_NONE: Final[frozenset[Sensor]] = frozenset()
