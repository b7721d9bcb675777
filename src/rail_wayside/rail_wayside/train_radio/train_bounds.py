"""Between which places a train surely is: location reports, checked by phase ranging.

Everything here counts along the direction of travel: u = direction times chainage.

===================== =======================================================================
[rear_m, front_m]     what the train may occupy by the newest knowledge, both ends the worst
report [lo, hi]       its front by the newest valid report (at first: by the dispatcher)
proven [lo, hi]       its front by the newest report that could follow from the one before
ranged [lo, hi]       its front by phase ranging, k sigma to either side
reserve_m             furthest that the front can be or come: the end of any authority that the
                      train may still hold, and beyond it on sight since a person's release
===================== =======================================================================

With the highest speed V and the roll-back M (the margin behind a train), the front that was in
[lo, hi] is tau later in [lo - min(M, V tau), hi + V tau]. A report that cannot follow from the
proven one, or that a range contradicts, is not believed alone: the train occupies the hull of
both until they agree. The rear is never moved on by a speed, and moves back only in such a hull
or if the train turns out to be longer.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf

from rail_msgs_py.train_radio.fixed_point import check_direction, check_identity, check_number, up
from rail_msgs_py.train_radio.train_report import (
    FURTHEST_M,
    LONGEST_TRAIN_M,
    PER_METRE_COARSE,
    LocationReport,
)

from .authority import IssuedAuthority
from .speed_profile import AuthorityLimits

#: A range confirms a report that is at most this much older or younger.
CONFIRM_S = 2.0
#: Places closer than that are the same: far below what a telegram can say.
SAME_M = 1e-6


class Trouble(Enum):
    """What does not fit."""

    INVALID = "position not valid"
    INTEGRITY = "integrity not confirmed"
    SEGMENT = "reports another segment or direction"
    LEAP = "report does not follow from the ones before"
    RANGE = "report and range disagree"
    RANGE_SEGMENT = "ranged on another segment"
    LENGTH = "longer than known"
    OVERRUN = "beyond its authority"
    ORDER = "order of trains inverted"


@dataclass(frozen=True)
class TrainStart:
    """What the dispatcher knows of a train when it enters service.

    Parameters
    ----------
    number : int
        As in the telegrams, 0 to 65535.
    name : str
    length_m : float
        Nominal; counts rounded up to the resolution of a location report.
    direction : int
        1 towards greater chainages, -1 towards smaller ones.
    segment : int
        Track.
    front_m : float or None
        Chainage of the front, None = not known: the train is nowhere until it reports.
    uncertainty_m : float
        Half-width of the interval of the front.
    since_s : float
        Time at which it stood there.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    number: int
    name: str
    length_m: float
    direction: int
    segment: int
    front_m: float | None = None
    uncertainty_m: float = 0.0
    since_s: float = 0.0

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_identity("number", self.number)
        check_identity("segment", self.segment)
        check_direction(self.direction)
        if not 0.0 < self.length_m <= LONGEST_TRAIN_M:
            raise ValueError(f"length_m: {self.length_m} is not a length of a train")
        if self.front_m is not None:
            check_number("front_m", self.front_m, -FURTHEST_M, FURTHEST_M)
        check_number("uncertainty_m", self.uncertainty_m, 0.0, FURTHEST_M)
        check_number("since_s", self.since_s, -1e12, 1e12)


class TrainBounds:
    """Where one train may be.

    Parameters
    ----------
    start : TrainStart
    rank : int
        Its place in the order in which trains enter service, the first ahead.
    fastest_mps : float
        V, that the train surely does not exceed.
    roll_back_m : float
        M.
    sigmas : float
        k of the ranges.
    standing_mps : float
        A train reported no faster stands.
    """

    def __init__(
        self,
        start: TrainStart,
        *,
        rank: int = 0,
        fastest_mps: float,
        roll_back_m: float,
        sigmas: float,
        standing_mps: float,
    ) -> None:
        self.start = start
        self.direction, self.rank = start.direction, rank
        self.length_m = up(start.length_m, PER_METRE_COARSE) / PER_METRE_COARSE
        self._fastest_mps, self._roll_back_m = fastest_mps, roll_back_m
        self._sigmas, self._standing_mps = sigmas, standing_mps
        self.placed = False
        self.rear_m = self.front_m = 0.0
        #: Least and greatest chainage of the middle of the train, by the newest report.
        self.centre_m = (0.0, 0.0)
        self.as_leader, self.as_oncoming = f"rear of {start.name}", f"{start.name} oncoming"
        #: Neighbours on the track, towards smaller and greater chainages.
        self.below: TrainBounds | None = None
        self.above: TrainBounds | None = None
        self._known_s = -inf  # of front_m
        #: How much further ahead than it reports the train may be.
        self.lead_m = 0.0
        self.invalid = self.no_integrity = self.strayed = self.leap = self.clash = False
        self.longer = self.overrun = False
        self._last_report_s = -inf
        #: Time of the newest range, on this track or another.
        self.ranged_s = -inf
        self._kept_m = 0.0  # worst rear of the proven reports
        self._proven = self._report = self._range = (-inf, 0.0, 0.0)
        self._report_rear_m = 0.0
        #: Time and speed of a release to run on sight that is in force.
        self._on_sight: tuple[float, float] | None = None
        #: Time of the newest report of a train that stands.
        self.stood_s = -inf
        self._start_m = -inf  # furthest front of a train that has not moved on an authority
        self._leap_s = self._clash_s = -inf
        #: End of the authority in force, and of a longer one that it may not have superseded.
        self.end_m = self.held_m = -inf
        self._issued_s = self._held_until_s = -inf
        #: Limits of the newest authority.
        self.limits: AuthorityLimits | None = None
        #: The newest authority, and the rear and front it was made for.
        self.granted: tuple[float, float, IssuedAuthority] | None = None
        if start.front_m is not None:
            at_m = start.direction * start.front_m
            self._place((start.since_s, at_m - start.uncertainty_m, at_m + start.uncertainty_m))

    def _place(self, where: tuple[float, float, float]) -> None:
        self.placed = True
        self._proven = self._report = where
        self._start_m = where[2]
        self._kept_m = self._report_rear_m = where[1] - self.length_m
        self._hull()

    @property
    def heard(self) -> bool:
        """Whether any report of it was taken."""
        return self._last_report_s > -inf

    @property
    def reserve_m(self) -> float:
        """Furthest that the front can be or come on the authorities that the train may hold.

        A report only says where the front may be; beyond where it was at first it comes only by
        an authority, unless a report proves that it went without.
        """
        furthest_m = max(self.end_m, self.held_m, self._start_m) + self.lead_m
        return max(furthest_m, self.front_m) if self.leap or self.clash else furthest_m

    def reserve_at_m(self, time_s: float) -> float:
        """`reserve_m` at a time: on sight a train passes it."""
        if self._on_sight is None:
            return self.reserve_m
        since_s, speed_mps = self._on_sight
        beyond_m = speed_mps * max(time_s - max(since_s, self._known_s), 0.0)
        return max(self.reserve_m, self.front_m) + beyond_m

    def front_at_m(self, time_s: float) -> float:
        """Furthest place of the front at a time.

        At the highest speed since the newest knowledge, but not past its authority or, on sight,
        no further beyond it than the speed on sight has brought it.
        """
        furthest_m = self.front_m + self._fastest_mps * max(time_s - self._known_s, 0.0)
        return min(furthest_m, self.reserve_at_m(time_s))

    def front_between_m(self, time_s: float) -> tuple[float, float]:
        """Least and furthest place of the front at a time."""
        low_m = self._report[1]
        if self.leap:
            low_m = min(low_m, self._proven[1])
        if self.clash:
            low_m = min(low_m, self._range[1])
        low_m -= self._roll_back_m
        return low_m, max(low_m, self.front_at_m(time_s))

    def release(self, time_s: float, speed_mps: float) -> None:
        """Take note that a person lets it run on sight from a time on, no faster than a speed."""
        self._on_sight = time_s, speed_mps

    def issue(self, time_s: float, end_m: float, validity_s: float) -> bool:
        """Take note of an authority given; whether it is shorter than the last one.

        The train may not get a shorter one: until the longer has expired and the train stands,
        all of it stays reserved.
        """
        last_m = self.end_m
        shorter = end_m < last_m - SAME_M
        if shorter:
            self.held_m = max(self.held_m, last_m)
            self._held_until_s = max(self._held_until_s, self._issued_s + validity_s)
        if end_m >= self.held_m:
            self.held_m = self._held_until_s = -inf
        self.end_m, self._issued_s = end_m, time_s
        return shorter

    def reissue(
        self, time_s: float, end_m: float, stop: bool, cause: str
    ) -> IssuedAuthority | None:
        """Give the newest authority again, if nothing changed."""
        if self.granted is None or end_m != self.end_m:
            return None
        rear_m, front_m, last = self.granted
        if rear_m != self.rear_m or front_m != self.front_m or last.cause != cause:
            return None
        if last.shortened or last.emergency_stop or stop:
            return None
        self._issued_s = time_s
        return last

    def report(self, time_s: float, report: LocationReport) -> bool:
        """Take a report of this train on its own track and in its direction, if it is newer."""
        if time_s <= self._last_report_s:
            return False
        self._last_report_s = time_s
        if report.speed_mps <= self._standing_mps:
            self.stood_s = time_s
        if report.on_sight and self._on_sight is None:
            self.release(time_s, self._fastest_mps)
        self.invalid = not report.position_valid
        if self.invalid:
            return True
        self.strayed = report.segment != self.start.segment or report.direction != self.direction
        if self.strayed:
            return True
        if self._on_sight is not None and not report.on_sight and time_s > self._on_sight[0]:
            self._on_sight = None
        at_m, half_m = self.direction * report.offset_m, report.uncertainty_m
        where = (time_s, at_m - half_m, at_m + half_m)
        self.longer = report.length_m > self.length_m
        if self.longer:
            self._kept_m -= report.length_m - self.length_m
            self.length_m = report.length_m
        self.no_integrity = not report.integrity_confirmed
        if not self.placed:
            self._place(where)
        self._note_front(where)
        self._report, self._report_rear_m = where, where[1] - self.length_m
        if self._apart(self._proven, where):
            if not self.leap:
                self.leap, self._leap_s = True, time_s
        else:
            self.leap = False
            self._proven = where
            if not self.no_integrity:
                self._kept_m = max(self._kept_m, self._report_rear_m)
            if report.speed_mps <= self._standing_mps and time_s >= self._held_until_s:
                self.held_m = self._held_until_s = -inf
        self._compare()
        self._hull()
        return True

    def _note_front(self, where: tuple[float, float, float]) -> None:
        """Bound of the front of a train that moves by authority alone, with a new report."""
        issued_m = max(self.end_m, self.held_m)
        furthest_m = max(issued_m, self._start_m) + self.lead_m + SAME_M
        self.overrun = where[1] > furthest_m and issued_m > -inf
        if self.overrun or issued_m == -inf:
            self._start_m = where[2]

    def ranged(self, time_s: float, position_m: float, sigma_m: float) -> bool:
        """Take a chainage of the front by phase ranging, if it is newer."""
        if time_s <= self.ranged_s:
            return False
        self.ranged_s = time_s
        at_m, half_m = self.direction * position_m, self._sigmas * sigma_m
        self._range = (time_s, at_m - half_m, at_m + half_m)
        if self.placed:
            was_plain = not (self.clash or self.leap)
            self._compare()
            if self.clash or not was_plain:
                self._hull()
        return True

    def _apart(self, one: tuple[float, float, float], other: tuple[float, float, float]) -> bool:
        """Whether the front cannot have been in both intervals (time, lo, hi)."""
        if one[1] <= other[2] and other[1] <= one[2]:
            return False  # even with no time to move
        if one[0] > other[0]:
            one, other = other, one
        at_s, low_m, high_m = other
        before_s, least_m, most_m = one
        run_m = self._fastest_mps * (at_s - before_s) + SAME_M
        if low_m > most_m + run_m:
            return True
        return high_m < least_m and high_m < least_m - min(self._roll_back_m + SAME_M, run_m)

    def _compare(self) -> None:
        """Compare report and range."""
        at_s = self._range[0]
        if at_s > -inf:
            if self._apart(self._report, self._range):
                self.clash, self._clash_s = True, at_s
            elif at_s > self._clash_s:
                self.clash = False
                if self.leap:
                    self._confirm(at_s)

    def _confirm(self, range_s: float) -> None:
        """Believe a report that does not follow from the ones before, as a new range agrees."""
        if range_s < self._leap_s or abs(self._report[0] - range_s) > CONFIRM_S:
            return
        self.leap = False
        self._proven = self._report
        if not self.no_integrity or self._report_rear_m < self._kept_m:
            self._kept_m = self._report_rear_m

    def _hull(self) -> None:
        at_s, low_m, high_m = self._report
        rear_m, front_m = self._kept_m, high_m
        if self.leap:
            before_s, _, most_m = self._proven
            rear_m = min(rear_m, self._report_rear_m)
            front_m = max(front_m, most_m + self._fastest_mps * (at_s - before_s))
        if self.clash:
            before_s, least_m, most_m = self._range
            rear_m = min(rear_m, least_m - self.length_m)
            front_m = max(front_m, most_m + self._fastest_mps * max(at_s - before_s, 0.0))
        self.rear_m, self.front_m = rear_m, front_m
        half_m = 0.5 * self.length_m
        self.centre_m = (
            (low_m - half_m, high_m - half_m)
            if self.direction > 0
            else (half_m - high_m, half_m - low_m)
        )
        self.lead_m = front_m - high_m
        self._known_s = at_s
