"""Gradients of a track as a train of some length meets them, along its direction of travel.

The mass of a train lies between its front and its rear. As long as its place is only known as an
interval it counts as lying wholly on the worst gradient between the most advanced front and the
rearmost rear: with g(x) the gradient at x and W the width of all that,

    G(s) = min of g(x) for s - W <= x <= s

(the compensation of the gradient profile for the length of the train, ETCS SUBSET-026, 3.13.4.2
[M], with the uncertainty of the place added to the length). G is piecewise constant too: a fall
begins where the front comes to it and ends when the rear has left it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from itertools import pairwise
from math import ceil, inf, isfinite

from rail_signals.track_code.scales import GRAVITY_MPS2

_MOST_WIDTHS = 512
#: Ahead of a fall its share of what a train gathers before its brakes act rises from 0 [m].
_APPROACH_M = 300.0


class WidthGradients:
    """Worst gradients for a front, of one width: from ``starts_m[k]`` on ``permil[k]`` holds."""

    __slots__ = ("permil", "starts_m")

    def __init__(self, starts_m: list[float], permil: list[float], width_m: float) -> None:
        places = {-inf}
        for at in range(1, len(starts_m)):
            rises = permil[at] > permil[at - 1]
            places.add(starts_m[at] + (width_m if rises else 0.0))
        self.starts_m: list[float] = []
        self.permil: list[float] = []
        for place in sorted(places):
            rear_m = place - width_m
            first = max(bisect_right(starts_m, rear_m) - 1, 0)
            stop = max(bisect_right(starts_m, place), first + 1)
            low = min(permil[first:stop])
            if not self.permil or low != self.permil[-1]:
                self.starts_m.append(place)
                self.permil.append(low)

    def piece(self, s: float) -> int:
        """Piece in force just before a place."""
        at = bisect_right(self.starts_m, s) - 1
        return at - 1 if at > 0 and self.starts_m[at] == s else max(at, 0)


class GradientProfile:
    """Surveyed gradients of a track.

    Parameters
    ----------
    steps : iterable of (from_m, permil)
        Chainages in rising order from which each gradient holds; the first holds before it too.
        Uphill towards greater chainages is positive.
    direction : {1, -1}
        1 if the train travels towards greater chainages.

    Raises
    ------
    ValueError
        If there is none, or a number is not finite or out of order.

    Examples
    --------
    >>> profile = GradientProfile([(0.0, 0.0), (1000.0, -20.0), (1500.0, 5.0)])
    >>> worst = profile.of_width(200.0)
    >>> worst.starts_m, worst.permil
    ([-inf, 1000.0, 1700.0], [0.0, -20.0, 5.0])
    """

    def __init__(self, steps: Iterable[tuple[float, float]], direction: int = 1) -> None:
        rows = list(steps)
        if not rows:
            raise ValueError("gradients: there is none")
        if direction not in (1, -1):
            raise ValueError(f"direction: {direction} is neither 1 nor -1")
        if not all(isfinite(at_m) and isfinite(value) for at_m, value in rows):
            raise ValueError(f"gradients: {rows} are not places and permil")
        if any(after <= before for (before, _), (after, _) in pairwise(rows)):
            raise ValueError(f"gradients: {rows} are not in rising order")
        starts = [-inf, *(at_m for at_m, _ in rows[1:])]
        permil = [value for _, value in rows]
        if direction < 0:
            starts = [-inf, *(-at_m for at_m in reversed(starts[1:]))]
            permil = [-value for value in reversed(permil)]
        self._starts_m, self._permil = starts, permil
        self._ends_m = [*starts[1:], inf]
        self._widths: dict[int, WidthGradients] = {}

    @property
    def steepest_fall_permil(self) -> float:
        """Steepest fall anywhere, not negative."""
        return max(0.0, -min(self._permil))

    def of_width(self, width_m: float) -> WidthGradients:
        """Worst gradients for a front whose train lies within a width behind it.

        The width counts in whole metres, rounded up.
        """
        width = ceil(max(width_m, 0.0))
        found = self._widths.get(width)
        if found is None:
            if len(self._widths) >= _MOST_WIDTHS:
                self._widths.clear()
            found = WidthGradients(self._starts_m, self._permil, float(width))
            self._widths[width] = found
        return found

    def gathered_mps2(self, rear_m: float, front_m: float) -> float:
        """Most acceleration by a fall from a rear to a place ahead of the front, not negative.

        It rises linearly over the way to a fall that is still ahead, so that no permitted speed
        falls in a step where one comes into sight.
        """
        most = 0.0
        for start_m, end_m, permil in zip(self._starts_m, self._ends_m, self._permil, strict=True):
            if permil < 0.0 and end_m > rear_m:
                share = 1.0 - max(0.0, start_m - front_m) / _APPROACH_M
                most = max(most, -permil * share)
        return GRAVITY_MPS2 * 1e-3 * most


#: No gradient anywhere.
LEVEL = GradientProfile([(0.0, 0.0)])
