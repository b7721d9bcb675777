"""Which readings are evidence: checks that every one passes before a filter sees it.

A reading is rejected, for this tick and without any consequence for the next, if it is not finite,
beyond what any railway has, of a covariance that is not positive definite, from the future, too
old, older than the one before, or sent again.

**Frozen sensors.** A measurement has noise. A range or a Doppler fix with the values of the one
before, bit for bit, was most likely not measured again, and of several in a row that is certain.
This holds at a stand as well, where nothing else tells a frozen range from a healthy one: the noise
of a healthy one is drawn anew for each reading, and ranges of 0.1 m of noise sent in steps of
0.01 m repeat themselves by chance with a probability of 0.028, five times in a row once in 1.6
million. Who would take the frozen one for evidence would take one measurement for thousands, and
hold a position for monitored that is not. Wheels that stand, or keep their speed, do repeat
themselves, and so do joints: they are held against the other sensors instead.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from enum import Enum
from math import nan
from typing import Any, Final, NamedTuple, TypeAlias, TypeVar

import numpy as np

from .filter_bank import BoolArray, Values
from .readings import BlockEntry, DopplerFix, RangeFix, TickMeasurements, WheelSpeed
from .settings import Sensor

#: Of one train, or of each run [..., 1].
Flags: TypeAlias = bool | BoolArray

MOST_M: Final = 1e7
"""No chainage is further from zero, and no standard deviation of one is larger."""
MOST_MPS: Final = 200.0
"""No train and no wheel is faster."""
SAME_TIME_S: Final = 1e-6
"""Times that differ by no more are the same."""


class Rejection(Enum):
    """Why a reading is no evidence."""

    NOT_FINITE = "not finite"
    IMPLAUSIBLE = "implausible"
    BAD_VARIANCE = "covariance not positive definite"
    FUTURE = "from the future"
    TOO_OLD = "too old"
    BACKWARDS = "older than the one before"
    REPEATED = "sent again"
    FROZEN = "frozen"


class UnusedReading(NamedTuple):
    """A reading of this tick that is not used; ``which`` of the runs [..., 1]."""

    sensor: Sensor
    why: Rejection
    which: Flags


class _Content(NamedTuple):
    """What the checks look at in a reading of any sensor."""

    chainage_m: Values
    speed_mps: Values
    variance_m2: Values = 1.0
    covariance_m2ps: Values = 0.0
    speed_variance_m2ps2: Values = 1.0
    lasting_m: Values = 0.0
    label: Values = 0.0


class _Last(NamedTuple):
    """Time and values of the last valid reading, NaN before it, and how many had these values."""

    stamp_s: Values = nan
    chainage_m: Values = nan
    speed_mps: Values = nan
    alike: Values = 0.0


Reading = TypeVar("Reading", RangeFix, DopplerFix, BlockEntry, WheelSpeed)
#: What takes the place of values that are not looked at; 0 if not named.
_HARMLESS: Final = {"variance_m2": 1.0, "speed_variance_m2ps2": 1.0}
#: Sensors with noise, whose values hardly ever repeat themselves.
_NOISY: Final = frozenset({Sensor.RANGE, Sensor.DOPPLER})


class ReadingScreen:
    """Keeps out what is no evidence, and counts it.

    Everything is a float of one train, or an array [..., 1] of many runs; the checks are the same.

    Parameters
    ----------
    oldest_s : float
        Age that a reading may have.
    most_alike : int
        So many readings in a row of a sensor with noise are not of the same values.

    Attributes
    ----------
    rejected : list of UnusedReading
        Of the last tick.
    counts : Counter of (Sensor, Rejection)
        Since the beginning.
    """

    def __init__(self, oldest_s: float, most_alike: int) -> None:
        self._oldest_s, self._most_alike = oldest_s, most_alike
        self._last = [_Last() for _ in Sensor]
        self.rejected: list[UnusedReading] = []
        self.counts: Counter[tuple[Sensor, Rejection]] = Counter()

    def screen(self, time_s: float, readings: TickMeasurements) -> TickMeasurements:
        """Those of the readings of a tick that are evidence."""
        self.rejected = []
        ranging, doppler, block, wheels = readings
        with np.errstate(over="ignore", invalid="ignore"):
            return TickMeasurements(
                ranging
                and self._evidence(
                    Sensor.RANGE,
                    time_s,
                    ranging,
                    _Content(
                        ranging.chainage_m,
                        0.0,
                        ranging.variance_m2,
                        lasting_m=ranging.lasting_m,
                        label=ranging.station,
                    ),
                ),
                doppler and self._evidence(Sensor.DOPPLER, time_s, doppler, _Content(*doppler[:5])),
                block and self._evidence(Sensor.BLOCK, time_s, block, _Content(block.joint_m, 0.0)),
                wheels
                and self._evidence(
                    Sensor.ODOMETER, time_s, wheels, _Content(0.0, wheels.speed_mps)
                ),
            )

    def _evidence(
        self, sensor: Sensor, time_s: float, reading: Reading, content: _Content
    ) -> Reading | None:
        """The reading where it is evidence; None where that is nowhere."""
        evidence = self._where_evidence(sensor, time_s, reading.age_s, reading.present, content)
        if evidence is reading.present:
            return reading
        if evidence is False:
            return None
        fields: dict[str, Any] = {
            name: _where(evidence, values, _HARMLESS.get(name, 0.0))
            for name, values in reading._asdict().items()
        }
        fields["present"] = evidence
        return reading._replace(**fields)

    def _where_evidence(
        self, sensor: Sensor, time_s: float, age_s: Values, present: Flags, content: _Content
    ) -> Flags:
        """Which readings are evidence: `present` itself if all are."""
        valid, rejected_before = present, len(self.rejected)
        last, stamp_s = self._last[sensor], time_s - age_s
        for why, passed in self._checks(age_s, stamp_s - last.stamp_s, content):
            if passed is not True:
                valid = self._sift(sensor, why, valid, passed)
        alike = 1.0 + last.alike * (
            (content.chainage_m == last.chainage_m) & (content.speed_mps == last.speed_mps)
        )
        now = _Last(stamp_s, content.chainage_m, content.speed_mps, alike)
        if valid is not True:
            now = _Last(*(_where(valid, *pair) for pair in zip(now, last, strict=True)))
        self._last[sensor] = now
        evidence, measures = valid, alike < self._most_alike
        if measures is not True and sensor in _NOISY:
            evidence = self._sift(sensor, Rejection.FROZEN, valid, measures)
        return present if len(self.rejected) == rejected_before else evidence

    def _sift(self, sensor: Sensor, why: Rejection, valid: Flags, passed: Flags) -> Flags:
        """Those of the valid that pass a check; the others are rejected."""
        left = valid & passed
        # Unequal rather than "and not": the same for a bool and for an array of them.
        failed = valid != left
        if failed is not False and (count := int(np.count_nonzero(failed))):
            self.rejected.append(UnusedReading(sensor, why, failed))
            self.counts[sensor, why] += count
        return left

    def _checks(
        self, age_s: Values, since_s: Values, content: _Content
    ) -> Sequence[tuple[Rejection, Flags]]:
        """What a valid reading passes, in the order in which the reasons are given.

        NaN compares with nothing, so every check is one that it fails. The time since the last
        reading is NaN before there is one, and passes.
        """
        s, v, var_s, covariance, var_v, lasting, label = content
        finite = 0.0 * (age_s + s + v + var_s + covariance + var_v + lasting + label) == 0.0
        return (
            (Rejection.NOT_FINITE, finite),
            (
                Rejection.IMPLAUSIBLE,
                _within(s, MOST_M)
                & _within(v, MOST_MPS)
                & _within(var_s, MOST_M**2)
                & _within(lasting, MOST_M),
            ),
            (
                Rejection.BAD_VARIANCE,
                (var_v > 0.0) & (covariance * covariance < var_s * var_v),
            ),
            (Rejection.FUTURE, age_s >= -SAME_TIME_S),
            (Rejection.TOO_OLD, age_s <= self._oldest_s),
            (Rejection.BACKWARDS, _not(since_s < -SAME_TIME_S)),
            (Rejection.REPEATED, _not(since_s <= SAME_TIME_S)),
        )


def _within(values: Values, most: float) -> Flags:
    return (values >= -most) & (values <= most)


def _not(flags: Flags) -> Flags:
    return flags != True  # noqa: E712  for a bool and an array of them alike


def _where(which: Flags, new: Values, old: Values) -> Values:
    if isinstance(which, bool):
        return new if which else old
    return np.where(which, new, old)
