"""The readings of one tick, as places on the line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .zone_map import ZoneMap


@dataclass(frozen=True)
class ReadingPlace:
    """Where a reading of a zone is on its line."""

    zone: str
    chainage_m: float
    variance_m2: float


class ReadingPlaces:
    """The readings of one tick; each is compared only with what is in its neighbourhood."""

    def __init__(self, zone_map: ZoneMap, places: Sequence[ReadingPlace]) -> None:
        self._map, self.all = zone_map, places
        self._in_zone: dict[str, list[int]] = {}
        for number, place in enumerate(places):
            self._in_zone.setdefault(place.zone, []).append(number)

    def __getitem__(self, number: int) -> ReadingPlace:
        return self.all[number]

    def of(self, zone: str) -> Sequence[int]:
        """Numbers of the readings of a zone."""
        return self._in_zone.get(zone, ())

    def from_place(self, zone: str, chainage_m: float) -> Iterator[tuple[int, float]]:
        """Number of, and signed distance along the line to, each reading in reach of a place."""
        near = (number for to in self._map.in_reach_of(zone) for number in self.of(to))
        for number in sorted(near):
            there = self.all[number]
            distance_m = self._map.path_distance_m(zone, chainage_m, there.zone, there.chainage_m)
            assert distance_m is not None
            yield number, distance_m

    def distances_m(self) -> dict[tuple[int, int], float]:
        """Signed distance along the line from one reading to another, of all that have one."""
        return {
            (number, other): distance_m
            for number, place in enumerate(self.all)
            for other, distance_m in self.from_place(place.zone, place.chainage_m)
            if other != number
        }
