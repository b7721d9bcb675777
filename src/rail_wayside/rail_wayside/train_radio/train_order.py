"""Trains of one track in the order of their chainages, which none of them can change."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from itertools import pairwise

from .speed_profile import AuthorityLimits, Segment, SpeedRestriction, restricted
from .train_bounds import TrainBounds


class TrainOrder:
    """Trains of one track.

    The order comes from the places at which trains enter service and is kept from then on; a
    train surely past its neighbour is not sorted anew but an inversion, which is a danger.

    Parameters
    ----------
    segment : Segment
    restrictions : iterable of SpeedRestriction
        Those on this segment.
    """

    def __init__(self, segment: Segment, restrictions: Iterable[SpeedRestriction] = ()) -> None:
        self.segment = segment
        self._restrictions = tuple(restrictions)
        self._limits: dict[tuple[SpeedRestriction, ...], AuthorityLimits] = {}
        #: Places (chainages) of trains that should not be here: name, from, to; by (train, ranged).
        self.strays: dict[tuple[int, bool], tuple[str, float, float]] = {}
        self._order: list[TrainBounds] = []

    def end_m(self, direction: int) -> float:
        """End of the track along a direction (direction times chainage)."""
        return self.segment.length_m if direction > 0 else 0.0

    def limits_at(self, time_s: float) -> AuthorityLimits:
        """Limits with the restrictions that hold at a time."""
        held = tuple(each for each in self._restrictions if each.from_s <= time_s < each.to_s)
        limits = self._limits.get(held)
        if limits is None:
            limits = AuthorityLimits(restricted(self.segment, held))
            self._limits[held] = limits
        return limits

    def insert(self, bounds: TrainBounds) -> None:
        """Give a train its place in the order; among equals the one that entered first is ahead."""
        find = bisect_left if bounds.direction > 0 else bisect_right
        self._order.insert(find(self._order, _key(bounds), key=_key), bounds)
        self._link()

    def remove(self, bounds: TrainBounds) -> None:
        """Take a train out."""
        if bounds in self._order:
            self._order.remove(bounds)
            self._link()

    def _link(self) -> None:
        for bounds in self._order:
            bounds.below = bounds.above = None
        for lower, upper in pairwise(self._order):
            lower.above, upper.below = upper, lower

    def before_strays(self, bounds: TrainBounds, margin_m: float) -> tuple[float, str] | None:
        """Nearest end, along its direction, before the strays that a train has not passed."""
        nearest: tuple[float, str] | None = None
        for (train, _), (name, low_m, high_m) in self.strays.items():
            near_m, far_m = (low_m, high_m) if bounds.direction > 0 else (-high_m, -low_m)
            if train == bounds.start.number or far_m <= bounds.rear_m:
                continue
            if nearest is None or near_m - margin_m < nearest[0]:
                nearest = near_m - margin_m, f"stray {name}"
        return nearest


def _key(bounds: TrainBounds) -> tuple[float, int]:
    return sum(bounds.centre_m), -bounds.direction * bounds.rank


def inverted(bounds: TrainBounds) -> bool:
    """Whether a train is surely past one of its neighbours."""
    below, above = bounds.below, bounds.above
    return (below is not None and below.centre_m[0] > bounds.centre_m[1]) or (
        above is not None and bounds.centre_m[0] > above.centre_m[1]
    )
