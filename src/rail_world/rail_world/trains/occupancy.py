"""Where trains are, truly: the stretches of tracks that each takes up, and who is in whose way.

A train lies on every track of its route that is under it. Where a branch leaves its track the two
stay within each other's clearance for a way, the fouling stretch: what is there on the one is in
the way on the other as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf
from typing import NamedTuple

import numpy as np

from rail_world.line.network import Network
from rail_world.line.route import Route

#: Centre lines closer than this are in each other's clearance [m].
CLEARANCE_M = 3.5
_FURTHEST_FOULING_M = 500.0
_STEP_M = 1.0
_SHARED_M = 1e-3


class Stretch(NamedTuple):
    """A part of a track that a train takes up: chainages [m]."""

    track: str
    low_m: float
    high_m: float


class Fouling:
    """How far each branch stays within the clearance of the track it leaves.

    Parameters
    ----------
    network : Network
    """

    def __init__(self, network: Network) -> None:
        self._onto: dict[str, tuple[str, float, float]] = {}
        for junction in network.junctions:
            branch, track = network.tracks[junction.branch], network.tracks[junction.track]
            reach_m = min(_FURTHEST_FOULING_M, branch.length_m, track.length_m - junction.at_m)
            way_m = np.arange(0.0, max(reach_m, 0.0), _STEP_M)
            mine, theirs = branch.pose(way_m), track.pose(junction.at_m + way_m)
            apart_m = np.hypot(mine.x_m - theirs.x_m, mine.y_m - theirs.y_m)
            clear = np.flatnonzero(apart_m >= CLEARANCE_M)
            fouling_m = float(way_m[clear[0]]) if clear.size else max(reach_m, 0.0)
            self._onto[junction.branch] = junction.track, junction.at_m, fouling_m

    def stretches(self, route: Route, low_m: float, high_m: float) -> Iterator[Stretch]:
        """What a train takes up between two path distances of its route."""
        for leg in route.legs:
            low = max(low_m - leg.path_start_m, 0.0)
            high = min(high_m - leg.path_start_m, leg.end_m)
            if high < low or (high == low and low_m < high_m):
                continue
            name = leg.track.name
            yield Stretch(name, low, high)
            if (onto := self._onto.get(name)) is not None and low < onto[2]:
                yield Stretch(onto[0], onto[1] + low, onto[1] + min(high, onto[2]))


class Occupant(NamedTuple):
    """A train on the line.

    Parameters
    ----------
    train : int
        Its index.
    stretches : tuple of Stretch
    direction : {1, -1}
        It runs towards increasing or decreasing chainage.
    speed_mps : float
        Magnitude.
    """

    train: int
    stretches: tuple[Stretch, ...]
    direction: int
    speed_mps: float


def overlaps(occupants: Sequence[Occupant]) -> Iterator[tuple[int, int, Stretch]]:
    """Pairs of trains that are in the same place, the lower index first, and the place."""
    flat = sorted((stretch, one.train) for one in occupants for stretch in one.stretches)
    for number, (stretch, index) in enumerate(flat):
        for other, other_index in flat[number + 1 :]:
            if other.track != stretch.track or other.low_m > stretch.high_m - _SHARED_M:
                break
            if other_index != index:
                shared = Stretch(stretch.track, other.low_m, min(stretch.high_m, other.high_m))
                yield min(index, other_index), max(index, other_index), shared


def next_ahead(
    route: Route, front_m: float, direction: int, train: int, occupants: Sequence[Occupant]
) -> tuple[float, int]:
    """Way from a front to the first other train on its route ahead, and which it is.

    To one that comes towards it, half the way: the other needs the other half. Infinite, and the
    train itself, if there is none.
    """
    nearest = inf, train
    for leg in route.legs:
        for other in occupants:
            if other.train == train:
                continue
            for track, low, high in other.stretches:
                if track != leg.track.name or low > leg.end_m:
                    continue
                near_m = leg.path_start_m + (low if direction > 0 else min(high, leg.end_m))
                far_m = leg.path_start_m + (min(high, leg.end_m) if direction > 0 else low)
                if direction * (far_m - front_m) <= 0.0:
                    continue
                gap_m = max(0.0, direction * (near_m - front_m))
                comes = other.direction != direction and other.speed_mps > 0.0
                nearest = min(nearest, (0.5 * gap_m if comes else gap_m, other.train))
    return nearest
