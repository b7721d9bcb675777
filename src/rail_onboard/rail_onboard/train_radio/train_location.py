"""Where the front of the train is: fixes told over the radio, carried on by the odometer.

With s the chainage times the direction of travel, what is known is an interval [l, h] that holds
the front. The odometer counts d while the train truly runs between (1 - e) d and (1 + e) d, so

    l += (1 - e) d,    h += (1 + e) d.

A fix, true at a past time, is carried on in the same way from the odometer's reading at that time.
A narrower one is used, and then **intersected** with what is known:

- The front is in both intervals if either bound holds, so in the intersection, whatever the order
  in which the fixes come.
- ``h``, the worst place for the supervision, is then never moved forwards by a fix, only by the
  odometer: the permitted speed does not jump down because the noise of a fix changed its sign.
- A fix that is not narrower is left alone: at a stand every one of a thousand fixes would
  otherwise cut a bit off, and an intersection of n intervals of probability 1 - p each is good for
  1 - n p only. As it is, the odometer must widen the interval before a fix is used again, so n is
  bounded by the distance run, and all but the last few of the n are widened far beyond p.

An empty intersection means that one of the two is wrong, and it is not known which: the hull of
both is taken, and flagged. The next fix that agrees with the hull and is narrower heals it.

Between two ticks the odometer is interpolated linearly. Where the speed goes from v0 to v1 without
turning, the distance at the fraction x of a tick t is at most x (1 - x) |v1 - v0| t off that line
(v0 held up to x, v1 from there on); this is added to the uncertainty.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class Location:
    """Place of the front of a train.

    Parameters
    ----------
    position_m : float
        Chainage.
    uncertainty_m : float
        The front is within ``position_m`` ± this.
    valid : bool
        Whether the two mean anything.
    """

    position_m: float
    uncertainty_m: float
    valid: bool


#: Nothing is known.
NOWHERE = Location(0.0, inf, False)


class _Reading(NamedTuple):
    time_s: float
    distance_m: float
    speed_mps: float


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
    history_s : float
        How old a fix may be [s].
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
    >>> where.fix(0.5, 1000.0, 2.0)
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
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on."""
        self._readings.clear()
        self._low_m, self._high_m = -inf, inf  # of s, at the latest reading
        self.consistent = True
        """Whether the last fix agreed with what was known before it."""

    def update(self, time_s: float, distance_m: float, speed_mps: float) -> bool:
        """Take a reading of the odometer.

        Parameters
        ----------
        time_s, distance_m : float
            If one of them steps backwards the odometer is not the same any more, and everything
            is forgotten [s], [m].
        speed_mps : float
            Of either sign [m/s].

        Returns
        -------
        bool
            Whether it was taken; one that is not finite is not.
        """
        if not (isfinite(time_s) and isfinite(distance_m) and isfinite(speed_mps)):
            return False
        if self._readings:
            last = self._readings[-1]
            if time_s < last.time_s or distance_m < last.distance_m:
                self.reset()
            else:
                run_m = distance_m - last.distance_m
                self._low_m += (1.0 - self._error) * run_m
                self._high_m += (1.0 + self._error) * run_m
                if time_s == last.time_s:
                    self._readings.pop()
        self._readings.append(_Reading(time_s, distance_m, abs(speed_mps)))
        # One reading from before the history is kept, to interpolate from.
        while len(self._readings) > 1 and self._readings[1].time_s <= time_s - self._history_s:
            self._readings.popleft()
        return True

    def fix(self, time_s: float, position_m: float, uncertainty_m: float) -> bool:
        """Take a fix.

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
            history. An accepted fix need not change anything.
        """
        if not (isfinite(position_m) and 0.0 <= uncertainty_m < inf):
            return False
        counted = self._run_since(time_s)
        if counted is None:
            return False
        run_m, slack_m = counted
        s = self._direction * position_m
        half_m = uncertainty_m + slack_m
        low_m = s - half_m + (1.0 - self._error) * run_m
        high_m = s + half_m + (1.0 + self._error) * run_m
        self.consistent = low_m <= self._high_m and high_m >= self._low_m
        if not self.consistent:
            self._low_m, self._high_m = min(low_m, self._low_m), max(high_m, self._high_m)
        elif high_m - low_m < self._high_m - self._low_m:
            self._low_m, self._high_m = max(low_m, self._low_m), min(high_m, self._high_m)
        return True

    def location(self, time_s: float) -> Location:
        """Place of the front at a time from the history up to the latest reading.

        Later than that nothing is known any more: an odometer that has fallen silent is a fault.
        """
        counted = self._run_since(time_s)
        if counted is None or self._high_m == inf:
            return NOWHERE
        run_m, slack_m = counted
        # Backwards the front is the further away the more the train has truly run.
        low_m = self._low_m - (1.0 + self._error) * run_m - slack_m
        high_m = self._high_m - (1.0 - self._error) * run_m + slack_m
        middle_m = low_m + 0.5 * (high_m - low_m)
        return Location(self._direction * middle_m, 0.5 * (high_m - low_m), True)

    def _run_since(self, time_s: float) -> tuple[float, float] | None:
        """Distance counted since a time, and how far it may be off [m]; None if not known."""
        readings = self._readings
        if not readings or not readings[0].time_s <= time_s <= readings[-1].time_s:
            return None
        last = readings[-1]
        if last.time_s - time_s > self._history_s:
            return None
        at = bisect_right(readings, time_s, key=lambda reading: reading.time_s) - 1
        before = readings[at]
        if before.time_s == time_s:
            return last.distance_m - before.distance_m, 0.0
        after = readings[at + 1]
        tick_s = after.time_s - before.time_s
        part = (time_s - before.time_s) / tick_s
        distance_m = before.distance_m + part * (after.distance_m - before.distance_m)
        slack_m = part * (1.0 - part) * abs(after.speed_mps - before.speed_mps) * tick_s
        return last.distance_m - distance_m, slack_m
