"""Moving block: movement authorities from where trains surely are (IEEE 1474.1).

Trains on a track keep their order, as none can pass another. So the end of a train's authority
is set by its neighbour ahead alone, by the end of the track, and by what is where no train
should be:

======================== ====================================================================
neighbour, same way      its worst rear, less the margin, which is the overlap
neighbour, oncoming      the furthest it was ever let or may be, less the margin: who was
                         given a stretch first keeps it, and neither is let into the other's
end of the track         less the end margin; the overlap reaches to the buffer, and the train may
                         come to the end at a release speed
stray position           where a train reports, or is ranged, off its own track
======================== ====================================================================

A train that may be further ahead than it reports (see `rail_wayside.train_radio.train_bounds`) is
told an end
that is nearer by as much. An end that comes back towards the train is said to be shortened; that
happens only if something got worse.

**After a restart** of the zone controller nothing is known: neither where trains are nor which
authorities they hold. On a track no authority is given until the old ones have expired, and every
train of the track has since reported that it stands, or has been found not to be there (`Opening`).

All times are those of one clock; a difference of clocks is part of the uncertainty of a report.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from math import inf
from typing import Final

from rail_msgs_py.train_radio.movement_authority import FASTEST_MPS, FURTHEST_M, LONGEST_S
from rail_msgs_py.train_radio.train_report import LocationReport

from .authority import IssuedAuthority, to_telegram
from .opening import Opening
from .speed_profile import Segment, SpeedRestriction
from .train_bounds import TrainBounds, TrainStart, Trouble
from .train_order import TrainOrder, inverted

__all__ = ["IssuedAuthority", "MovingBlock", "Segment", "TrainStart", "Trouble", "to_telegram"]

#: How far authorities reach past the end of a track for trains that go on.
BEYOND_M: Final = 2000.0


class MovingBlock:
    """Movement authorities for every train of a control area.

    Parameters
    ----------
    segments : iterable of Segment
    trains : iterable of TrainStart
        Those at the same place in the order in which they go, the first ahead.
    margin_m : float
        Kept behind a train and between oncoming ones; no train rolls back further.
    end_margin_m : float
        Kept before the end of a track.
    buffer_m : float
        From the end of a track to what must not be touched there.
    overspeed_mps : float
        By how much a train may exceed the highest limit of its track at most.
    sigmas : float
        A range is believed within that many standard deviations.
    validity_s : float
        Of an authority.
    standing_mps : float
        A train that reports no more than that stands; what it still rolls, the margin covers.
    leaving : collection of int
        Numbers of the trains that go on to the next control area: for them the track does not end.
    restrictions : iterable of SpeedRestriction
        Temporary ones; each is told while it holds.

    Raises
    ------
    ValueError
        If a parameter is out of range, a number is given twice or a segment is not known.

    Examples
    --------
    >>> track = Segment(1, "up", 5000.0, ((0.0, 20.0),))
    >>> trains = [TrainStart(7, "T7", 150.0, 1, 1, 200.0), TrainStart(8, "T8", 100.0, 1, 1, 900.0)]
    >>> zone = MovingBlock([track], trains, margin_m=10.0)
    >>> zone.report(8, 5.0, LocationReport(8, 1, 1000.0, 1, 20.0, 3.0, 100.0, True, True))
    True
    >>> authority = zone.authority(7, 5.0)
    >>> authority.end_m, authority.cause
    (887.0, 'rear of T8')
    """

    def __init__(
        self,
        segments: Iterable[Segment],
        trains: Iterable[TrainStart] = (),
        *,
        margin_m: float = 10.0,
        end_margin_m: float = 20.0,
        buffer_m: float = 0.0,
        overspeed_mps: float = 3.0,
        sigmas: float = 6.0,
        validity_s: float = 4.0,
        standing_mps: float = 0.1,
        leaving: Collection[int] = (),
        restrictions: Iterable[SpeedRestriction] = (),
    ) -> None:
        for name, value, most in (
            ("margin_m", margin_m, FURTHEST_M),
            ("end_margin_m", end_margin_m, FURTHEST_M),
            ("buffer_m", buffer_m, FURTHEST_M),
            ("overspeed_mps", overspeed_mps, FASTEST_MPS),
            ("sigmas", sigmas, 100.0),
            ("validity_s", validity_s, LONGEST_S),
            ("standing_mps", standing_mps, 1.0),
        ):
            if not 0.0 <= value <= most:
                raise ValueError(f"{name}: {value} is not from 0 to {most:g}")
        self._margin_m, self._end_margin_m, self._buffer_m = margin_m, end_margin_m, buffer_m
        self._overspeed_mps, self._sigmas = overspeed_mps, sigmas
        self._validity_s, self._standing_mps = validity_s, standing_mps
        self._leaving = frozenset(leaving)
        temporary = list(restrictions)
        self._train_orders: dict[int, TrainOrder] = {}
        for segment in segments:
            if segment.number in self._train_orders:
                raise ValueError(f"segments: number {segment.number} is given twice")
            mine = [each for each in temporary if each.segment == segment.number]
            self._train_orders[segment.number] = TrainOrder(segment, mine)
        self._trains: dict[int, TrainBounds] = {}
        self._rank = 0
        self._opening: Opening | None = None
        for train in trains:
            self.add(train)

    @property
    def trains(self) -> tuple[int, ...]:
        """Numbers of the trains in service."""
        return tuple(self._trains)

    def add(self, start: TrainStart) -> None:
        """Take a train into service.

        Raises
        ------
        ValueError
            If its number is in use or its segment is not known.
        """
        if start.number in self._trains:
            raise ValueError(f"number: train {start.number} is in service already")
        if start.segment not in self._train_orders:
            raise ValueError(f"segment: {start.segment} of train {start.number} is not known")
        line = self._train_orders[start.segment]
        self._rank += 1
        bounds = TrainBounds(
            start,
            rank=self._rank,
            fastest_mps=line.segment.fastest_mps + self._overspeed_mps,
            roll_back_m=self._margin_m,
            sigmas=self._sigmas,
            standing_mps=self._standing_mps,
        )
        self._trains[start.number] = bounds
        if bounds.placed:
            line.insert(bounds)

    def restart(self, time_s: float) -> None:
        """Know nothing of places and authorities: the controller was switched on at that time."""
        starts = [replace(bounds.start, front_m=None) for bounds in self._trains.values()]
        for bounds in tuple(self._trains.values()):
            self.remove(bounds.start.number)
        self._rank = 0
        for start in starts:
            self.add(start)
        self._opening = Opening(time_s, self._validity_s)

    def sweep(self, time_s: float, segment: int, clear: bool) -> None:
        """Take note whether ranging found every train of a track, and no other, at a time."""
        if self._opening is not None:
            self._opening.sweep(time_s, segment, clear)

    def missing(self, segment: int, time_s: float) -> tuple[str, ...]:
        """Names of trains for which a track waits after a restart; empty if it waits for none."""
        if self._opening is None:
            return ()
        there = [each for each in self._trains.values() if each.start.segment == segment]
        return self._opening.missing(segment, time_s, there)

    def everywhere(self, train: int, time_s: float) -> bool:
        """Whether a train without a place is the only one of its track that is not accounted for.

        Then a range that belongs to no other train is its own.
        """
        bounds = self._trains.get(train)
        if bounds is None or bounds.placed or not bounds.invalid or self._opening is None:
            return False
        there = [
            each for each in self._trains.values() if each.start.segment == bounds.start.segment
        ]
        silent = self._opening.silent(time_s)
        return all(each is bounds or each.placed or (silent and not each.heard) for each in there)

    def release(self, train: int, time_s: float, speed_mps: float) -> None:
        """Take note that a person lets a train run on sight from a time on."""
        bounds = self._trains.get(train)
        if bounds is not None:
            bounds.release(time_s, speed_mps)

    def front_between(self, train: int, time_s: float) -> tuple[float, float] | None:
        """Least and greatest chainage of the front at a time, None if not known."""
        bounds = self._trains.get(train)
        if bounds is None or not bounds.placed or bounds.strayed:
            return None
        ends = [bounds.direction * at_m for at_m in bounds.front_between_m(time_s)]
        return min(ends), max(ends)

    def place_of(self, train: int) -> tuple[int, int, bool] | None:
        """Segment and direction of a train in service, and whether its reports are valid."""
        bounds = self._trains.get(train)
        if bounds is None:
            return None
        return bounds.start.segment, bounds.direction, bounds.placed and not bounds.invalid

    def remove(self, train: int) -> None:
        """Forget a train that has left."""
        bounds = self._trains.pop(train, None)
        if bounds is None:
            return
        self._train_orders[bounds.start.segment].remove(bounds)
        self._forget_strays(train, False)
        self._forget_strays(train, True)

    def report(self, train: int, time_s: float, report: LocationReport) -> bool:
        """Take the location report of a train, true at `time_s`.

        Returns whether it was taken: from a train in service, its own, newer than the last. A
        train that is whole and proven past the end of the track is removed.
        """
        bounds = self._trains.get(train)
        if bounds is None or report.train != train:
            return False
        strayed, placed = bounds.strayed, bounds.placed
        if not bounds.report(time_s, report):
            return False
        if bounds.strayed and not bounds.invalid:
            self._forget_strays(train, False)
            if (line := self._train_orders.get(report.segment)) is not None:
                ends = (report.rear_m, report.front_m)
                line.strays[train, False] = (bounds.start.name, min(ends), max(ends))
            return True
        if strayed and not bounds.strayed:
            self._forget_strays(train, False)
        line = self._train_orders[bounds.start.segment]
        if bounds.placed and not placed:
            line.insert(bounds)
        if bounds.rear_m > line.end_m(bounds.direction) and not (bounds.leap or bounds.clash):
            self.remove(train)
        return True

    def ranged(
        self, train: int, time_s: float, segment: int, position_m: float, sigma_m: float
    ) -> bool:
        """Take the chainage of a train's front by phase ranging, with its standard deviation.

        An infinite deviation, or what is not a chainage, says nothing. Returns whether it was
        taken.

        Raises
        ------
        ValueError
            If the deviation is negative or NaN.
        """
        if not sigma_m >= 0.0:
            raise ValueError(f"sigma_m: {sigma_m} is not a standard deviation")
        bounds = self._trains.get(train)
        if bounds is None or sigma_m == inf or not -FURTHEST_M <= position_m <= FURTHEST_M:
            return False
        if segment != bounds.start.segment:
            line = self._train_orders.get(segment)
            if line is None or time_s <= bounds.ranged_s:
                return False
            bounds.ranged_s = time_s
            self._forget_strays(train, True)
            half_m = self._sigmas * sigma_m + bounds.length_m
            line.strays[train, True] = (
                bounds.start.name,
                position_m - half_m,
                position_m + half_m,
            )
            return True
        if not bounds.ranged(time_s, position_m, sigma_m):
            return False
        self._forget_strays(train, True)
        return True

    def occupied(self, train: int, time_s: float) -> tuple[float, float] | None:
        """Worst rear and worst front [m, chainage] at a time, None if not known."""
        bounds = self._trains.get(train)
        if bounds is None or not bounds.placed:
            return None
        return bounds.direction * bounds.rear_m, bounds.direction * bounds.front_at_m(time_s)

    def authority(self, train: int, time_s: float) -> IssuedAuthority | None:
        """Issue the authority of a train at a time; it occupies what it is given.

        None if it is not in service, its place is not known, it reports another track, or its track
        waits for trains after a restart.
        """
        bounds = self._trains.get(train)
        if bounds is None or not bounds.placed or bounds.strayed:
            return None
        number, direction = bounds.start.segment, bounds.direction
        if self.missing(number, time_s):
            return None
        line = self._train_orders[number]
        end_m = line.end_m(direction) - self._end_margin_m
        if train in self._leaving:
            end_m += BEYOND_M
        cause, overlap_m, release = "end of the track", self._end_margin_m + self._buffer_m, True
        ahead = bounds.above if direction > 0 else bounds.below
        if ahead is not None:
            before_m = ahead.rear_m
            if oncoming := ahead.direction != direction:
                before_m = -ahead.reserve_at_m(time_s)
            if before_m - self._margin_m < end_m:
                end_m = before_m - self._margin_m
                # Two that come towards each other share the margin.
                overlap_m, release = (0.5 if oncoming else 1.0) * self._margin_m, False
                cause = ahead.as_oncoming if oncoming else ahead.as_leader
        if line.strays:
            before = line.before_strays(bounds, self._margin_m)
            if before is not None and before[0] < end_m:
                (end_m, cause), overlap_m, release = before, self._margin_m, False
        stop = inverted(bounds)
        end_m -= bounds.lead_m
        if stop:
            end_m, cause = min(end_m, bounds.rear_m), Trouble.ORDER.value
            overlap_m, release = 0.0, False
        # What is told of limits changes with the restrictions in force.
        limits_changed = line.limits_at(time_s) is not bounds.limits
        bounds.limits = line.limits_at(time_s)
        if not limits_changed and (
            (same := bounds.reissue(time_s, end_m, stop, cause)) is not None
        ):
            return same
        shortened = bounds.issue(time_s, end_m, self._validity_s)
        limit_mps, steps = bounds.limits.ahead(direction, bounds.rear_m, bounds.front_m, end_m)
        authority = IssuedAuthority(
            train,
            number,
            direction,
            direction * end_m,
            limit_mps,
            steps,
            self._validity_s,
            stop,
            shortened,
            cause,
            overlap_m,
            release,
        )
        bounds.granted = bounds.rear_m, bounds.front_m, authority
        return authority

    def troubles(self, train: int) -> tuple[Trouble, ...]:
        """What does not fit about a train."""
        bounds = self._trains.get(train)
        if bounds is None:
            return ()
        ranged_off = any((train, True) in line.strays for line in self._train_orders.values())
        checks = (
            (bounds.invalid, Trouble.INVALID),
            (bounds.no_integrity, Trouble.INTEGRITY),
            (bounds.strayed, Trouble.SEGMENT),
            (bounds.leap, Trouble.LEAP),
            (bounds.clash, Trouble.RANGE),
            (ranged_off, Trouble.RANGE_SEGMENT),
            (bounds.longer, Trouble.LENGTH),
            (bounds.overrun, Trouble.OVERRUN),
            (inverted(bounds), Trouble.ORDER),
        )
        return tuple(trouble for is_so, trouble in checks if is_so)

    def _forget_strays(self, train: int, ranged: bool) -> None:
        for line in self._train_orders.values():
            if line.strays:
                line.strays.pop((train, ranged), None)
