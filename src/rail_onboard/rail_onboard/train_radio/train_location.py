"""Where the front of the train is: ranges told over the radio, carried on by the odometer.

With s the chainage times the direction of travel, what is known is an interval [l, h] that holds
the front. The odometer counts d while the train truly runs between (1 - e) d and (1 + e) d, so

    l += (1 - e) d,    h += (1 + e) d,

or, where it is in doubt, by the bounds of physics (see ``odometer_watch``). A range, true at a past
time, is carried on in the same way from the odometer's reading at that time.

**Not known → located.** Without an interval, ranges make one as soon as ``LOCATING`` of them in a
row agree with the odometer and with each other; a single one may be another train's.

**A range that agrees** with what is known and is narrower is intersected with it:

- The front is in both intervals if either bound holds, so in the intersection, whatever the order
  in which the ranges come.
- ``h``, the worst place for the supervision, is then never moved forwards by a range, only by the
  odometer: the permitted speed does not jump down because the noise of a range changed its sign.
- One that is not narrower is left alone: at a stand every one of a thousand ranges would otherwise
  cut a bit off, and an intersection of n intervals of probability 1 - p each is good for 1 - n p
  only. As it is, the odometer must widen the interval before a range is used again, so n is
  bounded by the distance run, and all but the last few of the n are widened far beyond p.

**A range that contradicts** it is one of two that are wrong: the hull of both is taken. The next
range that agrees with the old interval heals it. Ranges that go on to contradict it, and agree with
each other, are believed alone in the end, but only where a slide or spin that could not be seen may
have put the train so far: within ``UNSEEN_M``, and ``UNSEEN_PART`` of the way since a range last
agreed. ``DOUBTED`` of them are enough if the odometer has been in doubt since, ``DRIFTED`` if not.
So a range that is wrong by more, as that of a station beyond a dead one, is never believed at a
stand, and of a train that runs only if it is wrong alike for twice the way by which it is wrong.
Until then the front is in the hull, which holds it if either is right.

**Odometer and range are compared** over windows of ``WINDOW_S`` or more: a way between two ranges
that the wheels cannot have counted puts the odometer in doubt, one of ``PROVING_M`` that they have
counted ends all doubt.
Where the wheels step, slide or spin may just have ended: the interval grows by what they may have
miscounted since a range last agreed.

Between two ticks the odometer is interpolated linearly. Where the speed goes from v0 to v1 without
turning, the distance at the fraction x of a tick t is at most x (1 - x) |v1 - v0| t off that line
(v0 held up to x, v1 from there on); this is added to the uncertainty.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from math import inf, isfinite
from typing import NamedTuple

from rail_onboard.track_code.supervision import STANDSTILL_MPS

from .location_interval import (
    DOUBTED,
    DRIFTED,
    LOCATING,
    LONGEST_WINDOW_S,
    PROVING_M,
    SAME_PLACE_M,
    UNSEEN_M,
    UNSEEN_PART,
    WINDOW_S,
    Confirmation,
    Interval,
)
from .location_interval import NOWHERE as NOWHERE
from .location_interval import Location as Location
from .odometer_watch import OdometerWatch, RunningLimits


class _Reading(NamedTuple):
    time_s: float
    distance_m: float
    speed_mps: float
    least_m: float  # run since the start, at the least and at the most
    most_m: float


class _Run(NamedTuple):
    """Way run since a time: counted, least and most, and what interpolation adds to these [m]."""

    counted_m: float
    least_m: float
    most_m: float
    slack_m: float


class _Range(NamedTuple):
    time_s: float
    low_m: float
    high_m: float
    counter_m: float  # of the odometer at that time


class TrainLocation:
    """Keeps the interval in which the front of the train is.

    For a train that runs one way: one that turns back needs a new object, as its front is another.

    Parameters
    ----------
    odometer_error : float
        Bound, such as four standard deviations, of the difference between the distance run and
        the one counted, relative to the one counted; from 0 to below 1. (Wheels that count
        1 ± x of the way have x / (1 - x).)
    direction : {1, -1}
        1 if the train travels towards greater chainages. The odometer counts up either way.
    limits : RunningLimits, optional
        What the train can do; without it the odometer is believed.
    history_s : float
        How old a range may be [s].
    most_readings : int
        How many readings of the odometer are kept at most, however short the ticks.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Examples
    --------
    >>> where = TrainLocation(0.01)
    >>> where.update(0.0, 500.0, 20.0), where.update(1.0, 520.0, 20.0)
    (True, True)
    >>> where.place(0.5, 1000.0, 2.0)
    True
    >>> here = where.location(1.0)
    >>> here.position_m, round(here.uncertainty_m, 3), here.valid
    (1010.0, 2.1, True)
    """

    def __init__(
        self,
        odometer_error: float,
        *,
        direction: int = 1,
        limits: RunningLimits | None = None,
        history_s: float = 10.0,
        most_readings: int = 1024,
    ) -> None:
        if not 0.0 <= odometer_error < 1.0:
            raise ValueError(f"odometer_error: {odometer_error} is not from 0 to below 1")
        if direction not in (1, -1):
            raise ValueError(f"direction: {direction} is neither 1 nor -1")
        if not 0.0 < history_s < inf:
            raise ValueError(f"history_s: {history_s} is not above zero")
        if most_readings < 2:
            raise ValueError(f"most_readings: {most_readings} is less than two")
        self._error, self._direction, self._history_s = odometer_error, direction, history_s
        self._readings: deque[_Reading] = deque(maxlen=most_readings)
        self._watch = OdometerWatch(odometer_error, limits)
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on."""
        self._readings.clear()
        self._watch.reset()
        self._known: Interval | None = None
        self._ranged: Interval | None = None  # by ranges alone, not believed yet
        self._agreed: _Range | None = None  # the last one that agreed with what was known
        self._compared: _Range | None = None  # where the window of the comparison begins
        self._doubt_s = -inf  # when the odometer was last in doubt

    @property
    def consistent(self) -> bool:
        """Whether nothing contradicts what is known."""
        return self._known is None or self._ranged is None

    @property
    def odometer_doubted(self) -> bool:
        """Whether the wheels cannot count what the train runs."""
        return self._watch.doubted

    @property
    def fastest_mps(self) -> float:
        """The fastest that the train may run [m/s]."""
        return self._watch.fastest_mps

    def update(
        self, time_s: float, distance_m: float, speed_mps: float, *, braked: bool = False
    ) -> bool:
        """Take a reading of the odometer.

        Parameters
        ----------
        time_s, distance_m : float
            If one of them steps backwards the odometer is not the same any more, and everything
            is forgotten [s], [m].
        speed_mps : float
            Of either sign [m/s].
        braked : bool
            Whether a brake has been demanded since the reading before.

        Returns
        -------
        bool
            Whether it was taken; one that is not finite is not.
        """
        if not (isfinite(time_s) and isfinite(distance_m) and isfinite(speed_mps)):
            return False
        last = self._readings[-1] if self._readings else None
        if last is not None and (time_s < last.time_s or distance_m < last.distance_m):
            self.reset()
            last = None
        if last is None:
            self._watch.step(0.0, 0.0, abs(speed_mps), braked)
            self._readings.append(_Reading(time_s, distance_m, abs(speed_mps), 0.0, 0.0))
            return True
        least_m, most_m = self._watch.step(
            time_s - last.time_s, distance_m - last.distance_m, abs(speed_mps), braked
        )
        self._widen_for_step(time_s, distance_m)
        for interval in (self._known, self._ranged):
            if interval is not None:
                interval.low_m += least_m
                interval.high_m += most_m
        if time_s == last.time_s:
            self._readings.pop()
        run = last.least_m + least_m, last.most_m + most_m
        self._readings.append(_Reading(time_s, distance_m, abs(speed_mps), *run))
        if self._watch.doubted:
            self._doubt_s = time_s
        # One reading from before the history is kept, to interpolate from.
        while len(self._readings) > 1 and self._readings[1].time_s <= time_s - self._history_s:
            self._readings.popleft()
        return True

    def _widen_for_step(self, time_s: float, distance_m: float) -> None:
        """Allow for a slide or spin that nobody saw begin, and that this step may have ended."""
        stepped, agreed, known = self._watch.stepped, self._agreed, self._known
        if stepped is None:
            return
        self._compared = None
        if agreed is None or known is None:
            return
        before_mps, after_mps = stepped
        counted_m = max(0.0, self._readings[-1].distance_m - agreed.counter_m)
        if after_mps < before_mps:
            known.low_m -= (1.0 - after_mps / before_mps) * counted_m
        elif before_mps > STANDSTILL_MPS:
            most_m = max(0.0, after_mps * (time_s - agreed.time_s) - counted_m)
            known.high_m += min((after_mps / before_mps - 1.0) * counted_m, most_m)

    def place(self, time_s: float, position_m: float, uncertainty_m: float) -> bool:
        """Take a place that is known for sure, such as data entry; parameters as of `fix`."""
        return self._take(time_s, position_m, uncertainty_m, sure=True)

    def fix(self, time_s: float, position_m: float, uncertainty_m: float) -> bool:
        """Take a range.

        Parameters
        ----------
        time_s : float
            When it was true, not after the latest reading of the odometer [s].
        position_m, uncertainty_m : float
            The front was within ``position_m`` ± ``uncertainty_m`` [m].

        Returns
        -------
        bool
            Whether it was accepted: it is finite and neither from the future nor from before the
            history. An accepted range need not change anything.
        """
        return self._take(time_s, position_m, uncertainty_m, sure=False)

    def _take(self, time_s: float, position_m: float, uncertainty_m: float, *, sure: bool) -> bool:
        if not (isfinite(position_m) and 0.0 <= uncertainty_m < inf):
            return False
        run = self._run_since(time_s)
        if run is None:
            return False
        s = self._direction * position_m
        low_m, high_m = s - uncertainty_m, s + uncertainty_m
        counter_m = self._readings[-1].distance_m - run.counted_m
        told = _Range(time_s, low_m - run.slack_m, high_m + run.slack_m, counter_m)
        low_m, high_m = low_m + run.least_m, high_m + run.most_m
        if sure:
            self._believe(Interval(low_m, high_m), told)
            return True
        self._compare(told)
        known = self._known
        if known is not None and known.overlaps(low_m, high_m):
            known.take(low_m, high_m)
            self._ranged = None
            if uncertainty_m <= UNSEEN_M or self._agreed is None:
                self._agreed = told
            return True
        self._collect(low_m, high_m, told)
        return True

    def _believe(self, interval: Interval, told: _Range) -> None:
        self._known, self._ranged, self._agreed = interval, None, told

    def _collect(self, low_m: float, high_m: float, told: _Range) -> None:
        """Take a range that what is known, if anything is, contradicts."""
        ranged = self._ranged
        if ranged is not None and ranged.overlaps(low_m, high_m):
            ranged.take(low_m, high_m)
            ranged.ranges += 1
        else:
            ranged = self._ranged = Interval(low_m, high_m, 1, told.time_s)
        needed = self._needed(ranged)
        if needed is None or ranged.ranges < needed.ranges:
            return
        if told.time_s - ranged.since_s >= needed.span_s - 1e-6:
            self._believe(ranged, told)

    def _needed(self, ranged: Interval) -> Confirmation | None:
        """How many ranges in a row are believed against what is known; None if none are."""
        known, agreed = self._known, self._agreed
        if known is None:
            return LOCATING
        if agreed is None:
            return DRIFTED
        unseen_m = UNSEEN_M + UNSEEN_PART * (self._readings[-1].distance_m - agreed.counter_m)
        if not known.overlaps(ranged.low_m - unseen_m, ranged.high_m + unseen_m):
            return None
        return DOUBTED if self._doubt_s >= agreed.time_s else DRIFTED

    def _compare(self, told: _Range) -> None:
        """Compare the way between two ranges with what the wheels counted."""
        since = self._compared
        if since is None or told.time_s < since.time_s:
            if since is None:
                self._compared = told
            return
        counted_m = told.counter_m - since.counter_m
        most_m, least_m = told.high_m - since.low_m, told.low_m - since.high_m
        slack_m = self._error * abs(counted_m)
        if not least_m - slack_m <= counted_m <= most_m + slack_m:
            self._watch.suspect()
            self._doubt_s = self._readings[-1].time_s
            self._compared = told
            return
        elapsed_s = told.time_s - since.time_s
        if elapsed_s < WINDOW_S:
            return
        if counted_m >= PROVING_M:
            self._watch.trust()
        elif counted_m <= SAME_PLACE_M:
            self._watch.bound(max(0.0, most_m) / elapsed_s)
        elif elapsed_s < LONGEST_WINDOW_S:
            return  # the longer the way, the more it tells
        self._compared = told

    def location(self, time_s: float) -> Location:
        """Place of the front at a time from the history up to the latest reading.

        Later than that nothing is known any more: an odometer that has fallen silent is a fault.
        """
        run, known = self._run_since(time_s), self._known
        if run is None or known is None:
            return NOWHERE
        low_m, high_m = known.low_m, known.high_m
        if self._ranged is not None:
            low_m, high_m = min(low_m, self._ranged.low_m), max(high_m, self._ranged.high_m)
        # Backwards the front is the further away the more the train has truly run.
        low_m, high_m = low_m - run.most_m, high_m - run.least_m
        middle_m = low_m + 0.5 * (high_m - low_m)
        return Location(self._direction * middle_m, 0.5 * (high_m - low_m), True)

    def _run_since(self, time_s: float) -> _Run | None:
        """Way run since a time; None if not known."""
        readings = self._readings
        if not readings or not readings[0].time_s <= time_s <= readings[-1].time_s:
            return None
        last = readings[-1]
        if last.time_s - time_s > self._history_s:
            return None
        at = bisect_right(readings, time_s, key=lambda reading: reading.time_s) - 1
        before = readings[at]
        if before.time_s == time_s:
            part, slack_m, after = 0.0, 0.0, before
        else:
            after = readings[at + 1]
            tick_s = after.time_s - before.time_s
            part = (time_s - before.time_s) / tick_s
            slack_m = part * (1.0 - part) * abs(after.speed_mps - before.speed_mps) * tick_s

        def since(last_m: float, before_m: float, after_m: float) -> float:
            return last_m - before_m - part * (after_m - before_m)

        return _Run(
            since(last.distance_m, before.distance_m, after.distance_m),
            since(last.least_m, before.least_m, after.least_m) - slack_m,
            since(last.most_m, before.most_m, after.most_m) + slack_m,
            slack_m,
        )
