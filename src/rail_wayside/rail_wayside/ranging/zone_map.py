"""The wayside's map: zones in their order, and the table from distance to chainage of each.

The table is the database that the phase is looked up in (Jeong et al., section 3). It holds
the straight-line distance from the mast to the train antenna, which on a curve is shorter
than the way along the track, and beside the mast longer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray

#: How many zones away a train is still looked for.
NEIGHBOURHOOD = 3


@dataclass(frozen=True)
class MappedZone:
    """One zone: from its station to the next one along ``track``.

    ``chainage_m`` and ``distance_m`` [point] both increase; they may go on past the zone's end.
    """

    name: str
    site: str
    track: str
    start_m: float
    end_m: float
    chainage_m: FloatArray
    distance_m: FloatArray

    @property
    def length_m(self) -> float:
        """Length along the track."""
        return self.end_m - self.start_m

    def locate(self, range_m: float, variance_m2: float) -> tuple[float, float] | None:
        """Chainage and its variance of a range, None where no point of the map is that far.

        Closer to the mast than the track itself passes, the nearest point of the track is
        meant; but four sigma past the end of the table, or a metre more than that before its
        begin, nothing is: such a range is one beyond the unambiguous interval.
        """
        distance_m, chainage_m = self.distance_m, self.chainage_m
        excess_m = range_m - float(distance_m[-1])
        if excess_m > 0.0 and excess_m > 4.0 * variance_m2**0.5:
            return None
        if float(distance_m[0]) - range_m > 1.0 + 4.0 * variance_m2**0.5:
            return None
        place = int(np.searchsorted(distance_m, range_m))
        place = min(max(place, 1), distance_m.size - 1)
        d0, d1 = float(distance_m[place - 1]), float(distance_m[place])
        s0, s1 = float(chainage_m[place - 1]), float(chainage_m[place])
        per_metre = (s1 - s0) / (d1 - d0)
        inside_m = min(max(range_m, float(distance_m[0])), float(distance_m[-1]))
        return s0 + (inside_m - d0) * per_metre, variance_m2 * per_metre**2


class ZoneMap:
    """Zones by name, and the way from each to its neighbours.

    Parameters
    ----------
    zones : iterable of MappedZone
    following : mapping of zone to the zones that begin at its end
    """

    def __init__(self, zones: Iterable[MappedZone], following: Mapping[str, Iterable[str]]) -> None:
        self.zones = {zone.name: zone for zone in zones}
        self._ways: dict[str, dict[str, float]] = {}
        after = {name: tuple(following.get(name, ())) for name in self.zones}
        self.following = after
        before: dict[str, list[str]] = {name: [] for name in self.zones}
        for name, names in after.items():
            for other in names:
                before[other].append(name)
        for name in self.zones:
            self._ways[name] = self._walk(name, after, before)

    def _walk(
        self, name: str, after: Mapping[str, Iterable[str]], before: Mapping[str, Iterable[str]]
    ) -> dict[str, float]:
        """Distance from the start of a zone to the start of each zone of its neighbourhood."""
        matchings = {name: 0.0}
        ahead, behind = {name: 0.0}, {name: 0.0}
        for _ in range(NEIGHBOURHOOD):
            ahead = {
                other: offset + self.zones[here].length_m
                for here, offset in ahead.items()
                for other in after[here]
            }
            behind = {
                other: offset - self.zones[other].length_m
                for here, offset in behind.items()
                for other in before[here]
            }
            matchings = {**ahead, **behind, **matchings}
        return matchings

    def in_reach_of(self, zone: str) -> Iterable[str]:
        """Zones of the neighbourhood of one, itself too: those with a way along the line."""
        return self._ways[zone]

    def path_distance_m(
        self, zone: str, chainage_m: float, to: str, to_chainage_m: float
    ) -> float | None:
        """Signed distance along the line from one place to another, None if not in reach of it."""
        offset = self._ways[zone].get(to)
        if offset is None:
            return None
        here_m = chainage_m - self.zones[zone].start_m
        return offset + (to_chainage_m - self.zones[to].start_m) - here_m
