"""Speed limits of a track as the front of a train meets them.

A limit holds as long as any part of the train is in it. With the limit l(x) of the track at x,
counted in the direction of travel, and W from the worst rear to the worst front, the front may
run at

    L(s) = min of l(x) for s - W <= x <= s

so a step down stays where it is and a step up comes W later.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import ceil, inf

from rail_msgs_py.train_radio.fixed_point import check_identity, check_number
from rail_msgs_py.train_radio.movement_authority import (
    FASTEST_MPS,
    FURTHEST_M,
    MOST_STEPS,
    LimitStep,
)

#: Longer tracks and intervals would bring steps past what a telegram can say.
LONGEST_M = 0.4 * FURTHEST_M
_MOST_PROFILES = 512
_MOST_CACHED = 64
_SAME_M = 1e-6


@dataclass(frozen=True)
class Segment:
    """One track, with chainages from 0 to its length.

    Parameters
    ----------
    number : int
        As in the telegrams, 0 to 65535.
    name : str
    length_m : float
        At most 4e5.
    limits : tuple of (from_m, limit_mps)
        In rising order; the first holds before its chainage too.

    Raises
    ------
    ValueError
        If a value is out of its range or the limits are missing or out of order.
    """

    number: int
    name: str
    length_m: float
    limits: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_identity("number", self.number)
        if not 0.0 < self.length_m <= LONGEST_M:
            raise ValueError(f"length_m: {self.length_m} is not a length up to {LONGEST_M}")
        if not self.limits:
            raise ValueError(f"limits: there is none on {self.name}")
        before_m = -inf
        for from_m, limit_mps in self.limits:
            check_number("from_m", from_m, -LONGEST_M, LONGEST_M)
            check_number("limit_mps", limit_mps, 0.0, FASTEST_MPS)
            if from_m <= before_m:
                raise ValueError(f"limits: {from_m} m after {before_m} m is out of order")
            before_m = from_m

    @property
    def fastest_mps(self) -> float:
        """Highest limit."""
        return max(limit_mps for _, limit_mps in self.limits)


@dataclass(frozen=True)
class SpeedRestriction:
    """A lower limit on a stretch of a segment for some time.

    Parameters
    ----------
    segment : int
    from_m, to_m : float
        Chainages, rising.
    limit_mps : float
    from_s, to_s : float
        Times, rising; it holds from the first up to the second.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    segment: int
    from_m: float
    to_m: float
    limit_mps: float
    from_s: float
    to_s: float

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_identity("segment", self.segment)
        check_number("limit_mps", self.limit_mps, 0.0, FASTEST_MPS)
        for low, high in (("from_m", "to_m"), ("from_s", "to_s")):
            if not getattr(self, low) < getattr(self, high):
                raise ValueError(f"{high}: {getattr(self, high)} is not after {low}")


def restricted(segment: Segment, restrictions: Iterable[SpeedRestriction]) -> Segment:
    """Segment with the limits that restrictions leave of its own.

    >>> line = Segment(1, "up", 5000.0, ((0.0, 20.0),))
    >>> restricted(line, [SpeedRestriction(1, 1000.0, 1500.0, 10.0, 0.0, 60.0)]).limits
    ((0.0, 20.0), (1000.0, 10.0), (1500.0, 20.0))
    """
    held = list(restrictions)
    starts = [from_m for from_m, _ in segment.limits]
    own = [limit_mps for _, limit_mps in segment.limits]
    inner = {place for each in held for place in (each.from_m, each.to_m) if place > starts[0]}
    limits: list[tuple[float, float]] = []
    for place in sorted({*starts, *inner}):
        limit_mps = min(
            own[bisect_right(starts, place) - 1],
            *(each.limit_mps for each in held if each.from_m <= place < each.to_m),
            inf,
        )
        if not limits or limit_mps != limits[-1][1]:
            limits.append((place, limit_mps))
    return replace(segment, limits=tuple(limits))


class _Profile:
    """Limits for the front of trains of one width, in one direction."""

    __slots__ = ("_told", "limits_mps", "places_m", "steps")

    def __init__(self, segment: Segment, direction: int, width_m: float) -> None:
        starts, limits = along_limits(segment, direction)
        places = {starts[0]}
        for at in range(1, len(starts)):
            rises = limits[at] > limits[at - 1]
            places.add(starts[at] + (width_m if rises else 0.0))
        # Entry k holds from place k on; entry 0 from the beginning of all.
        self.places_m: list[float] = []
        self.limits_mps: list[float] = []
        for place in sorted(places):
            # At a rise the rear is on the boundary: what ends there counts no more.
            first = max(bisect_right(starts, place - width_m + _SAME_M) - 1, 0)
            stop = max(bisect_right(starts, place), first + 1)
            low = min(limits[first:stop])
            if not self.limits_mps or low != self.limits_mps[-1]:
                self.places_m.append(place)
                self.limits_mps.append(low)
        self.steps = [
            LimitStep(direction * place, low)
            for place, low in zip(self.places_m, self.limits_mps, strict=True)
        ]
        self._told: dict[tuple[int, int], tuple[LimitStep, ...]] = {}

    def ahead(self, front_m: float, end_m: float) -> tuple[float, tuple[LimitStep, ...]]:
        """Limit at the front, and the steps between it and the end."""
        places = self.places_m
        first = bisect_right(places, front_m)
        if first == 0:
            first = 1
        stop = max(bisect_left(places, end_m), first)
        steps = self._told.get((first, stop))
        if steps is None:
            steps = tuple(self.steps[first : min(stop, first + MOST_STEPS)])
            if stop > first + MOST_STEPS:
                # The last step that can be told must stand for all that cannot.
                low = min(self.limits_mps[first + MOST_STEPS - 1 : stop])
                steps = (*steps[:-1], LimitStep(steps[-1].from_m, low))
            if len(self._told) >= _MOST_CACHED:
                self._told.clear()
            self._told[first, stop] = steps
        return self.limits_mps[first - 1], steps


class AuthorityLimits:
    """Limits of one segment for trains of any width in either direction.

    Parameters
    ----------
    segment : Segment

    Examples
    --------
    >>> limits = AuthorityLimits(Segment(1, "up", 5000.0, ((0.0, 10.0), (1000.0, 20.0))))
    >>> limits.ahead(1, 700.0, 900.0, 4000.0)
    (10.0, (LimitStep(from_m=1200.0, limit_mps=20.0),))
    """

    def __init__(self, segment: Segment) -> None:
        self._segment = segment
        self._profiles: dict[tuple[int, int], _Profile] = {}

    def ahead(
        self, direction: int, rear_m: float, front_m: float, end_m: float
    ) -> tuple[float, tuple[LimitStep, ...]]:
        """Limit [m/s] in force from rear to front, and the steps ahead before the end.

        All places are along the direction of travel: direction times chainage. The interval
        counts in whole metres, rounded up. Where there are more steps than fit, the last one
        has the lowest limit of those it stands for.
        """
        width = ceil(front_m - rear_m)
        if not 0 <= width <= LONGEST_M:
            width = int(min(max(width, 0), LONGEST_M))
        profile = self._profiles.get((direction, width))
        if profile is None:
            if len(self._profiles) >= _MOST_PROFILES:
                self._profiles.clear()
            profile = _Profile(self._segment, direction, float(width))
            self._profiles[direction, width] = profile
        return profile.ahead(front_m, end_m)


def along_limits(segment: Segment, direction: int) -> tuple[list[float], list[float]]:
    """Places [m] along the direction from which each limit [m/s] holds, rising."""
    starts = [from_m for from_m, _ in segment.limits]
    limits = [limit_mps for _, limit_mps in segment.limits]
    if direction > 0:
        return starts, limits
    # Backwards, a limit begins where the next one up the chainage does.
    ends = [*starts[1:], max(segment.length_m, starts[-1] + 1.0)]
    return [-end for end in reversed(ends)], limits[::-1]
