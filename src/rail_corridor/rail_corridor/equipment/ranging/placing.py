"""The two ways of placing stations along the tracks: by rule and by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from rail_corridor.errors import InputError
from rail_world.line.network import Network

from .fouling import FoulingPoint
from .section import SHORTEST_ZONE_M, StationPlan

MOST_ZONES: Final = 1000


@dataclass(frozen=True)
class Place:
    """A station of one track, before the zones are known."""

    at_m: float
    station: str
    zone: str
    branch: str | None = None  # the branch that leaves there


def tracks_in_order(network: Network) -> list[str]:
    """Tracks that start the network first, then branches by junction, parents before them."""
    order = [name for name in network.tracks if network.parent_junction(name) is None]
    waiting = [junction for junction in network.junctions]
    while waiting:
        ready = next(junction for junction in waiting if junction.track in order)
        waiting.remove(ready)
        order.append(ready.branch)
    return order


def _first_m(track: str, fouling: dict[str, FoulingPoint]) -> float:
    return fouling[track].branch_m if track in fouling else 0.0


def find_anchors(
    network: Network, track: str, fouling: dict[str, FoulingPoint]
) -> list[tuple[float, str | None]]:
    """Places where a station must stand: chainage [m] and the branch that leaves there."""
    anchors: list[tuple[float, str | None]] = [(_first_m(track, fouling), None)]
    leaving = sorted(
        (p for p in fouling.values() if p.track == track), key=lambda point: point.track_m
    )
    length_m = network.tracks[track].length_m
    ends = [*(point.track_m for point in leaving[1:]), length_m]
    for point, end_m in zip(leaving, ends, strict=False):
        if min(point.track_m - anchors[-1][0], end_m - point.track_m) < SHORTEST_ZONE_M:
            raise InputError(
                f"the branch clears {track} at {point.track_m:.1f} m, less than"
                f" {SHORTEST_ZONE_M:g} m from the next station or the end",
                field=f"junctions.{point.junction}.at_m",
                value=point.at_m,
            )
        anchors.append((point.track_m, point.branch))
    return anchors


def place_automatically(
    network: Network,
    order: Sequence[str],
    anchors: dict[str, list[tuple[float, str | None]]],
    fouling: dict[str, FoulingPoint],
    zone_length_m: float,
) -> dict[str, list[Place]]:
    """Divide every track equally between its anchors, number stations and zones as they come."""
    places: dict[str, list[Place]] = {}
    at_junction: dict[str, str] = {}
    stations = zones = 0
    for track in order:
        here = anchors[track]
        ends_m = [at_m for at_m, _ in here[1:]] + [network.tracks[track].length_m]
        places[track] = []
        for (start_m, branch), end_m in zip(here, ends_m, strict=True):
            parts = max(1, math.ceil((end_m - start_m) / zone_length_m - 1e-9))
            if zones + parts > MOST_ZONES:
                raise InputError(
                    f"makes more than {MOST_ZONES} zones",
                    field="stations.zone_length_m",
                    value=zone_length_m,
                )
            for part in range(parts):
                zones += 1
                if not places[track] and track in fouling:
                    name = at_junction[track]
                else:
                    stations += 1
                    name = f"wrs{stations}"
                leaves = branch if part == 0 else None
                if leaves is not None:
                    at_junction[leaves] = name
                at_m = start_m + part * (end_m - start_m) / parts
                places[track].append(Place(at_m, name, f"zone{zones}", leaves))
    return places


def place_by_hand(
    network: Network,
    order: Sequence[str],
    anchors: dict[str, list[tuple[float, str | None]]],
    fouling: dict[str, FoulingPoint],
    plan: StationPlan,
) -> dict[str, list[Place]]:
    """Take the stations as they are given; junctions name theirs by the branch."""
    positions = plan.positions or ()
    places: dict[str, list[Place]] = {track: [] for track in order}
    fields: dict[str, str] = {}
    for index, position in enumerate(positions):
        field = f"stations.positions.{index}"
        if position.name in fields:
            raise InputError("another station has it", field=f"{field}.name", value=position.name)
        fields[position.name] = field
        if position.junction is not None:
            point = fouling.get(position.junction)
            if point is None:
                raise InputError(
                    "no junction starts such a branch",
                    field=f"{field}.junction",
                    value=position.junction,
                )
            if places[point.branch] and places[point.branch][0].at_m == point.branch_m:
                raise InputError(
                    "another station stands there",
                    field=f"{field}.junction",
                    value=position.junction,
                )
            places[point.track].append(
                Place(point.track_m, position.name, position.zone or "", point.branch)
            )
            places[point.branch].insert(
                0, Place(point.branch_m, position.name, position.branch_zone or "")
            )
            continue
        track, at_m = position.track or "", position.at_m or 0.0
        if track not in places:
            raise InputError("there is no such track", field=f"{field}.track", value=track)
        length_m = network.tracks[track].length_m
        if at_m > length_m - SHORTEST_ZONE_M:
            raise InputError(
                f"is off {track}, whose last zone must begin before"
                f" {length_m - SHORTEST_ZONE_M:.1f} m",
                field=f"{field}.at_m",
                value=at_m,
            )
        places[track].append(Place(at_m, position.name, position.zone or ""))
    return _completed(order, places, anchors, fouling)


def _completed(
    order: Sequence[str],
    places: dict[str, list[Place]],
    anchors: dict[str, list[tuple[float, str | None]]],
    fouling: dict[str, FoulingPoint],
) -> dict[str, list[Place]]:
    """Sort the places of every track, see that the first is there, and name unnamed zones."""
    occupied = {place.zone for here in places.values() for place in here}
    free = (f"zone{n}" for n in range(1, 10_000) if f"zone{n}" not in occupied)
    for track in order:
        first_m = anchors[track][0][0]
        here = sorted(places[track], key=lambda place: place.at_m)
        if not here or here[0].at_m != first_m:
            where = f"junction: {track}" if track in fouling else f"at_m: 0 of {track}"
            raise InputError(
                f"no station stands where {track} begins; give one with {where}",
                field="stations.positions",
                value=[place.station for place in here],
            )
        places[track] = [Place(p.at_m, p.station, p.zone or next(free), p.branch) for p in here]
    return places


def check_spacing(network: Network, places: dict[str, list[Place]], plan: StationPlan) -> None:
    """Raise InputError for zones that are too short, or of one name."""
    seen: set[str] = set()
    for track, here in places.items():
        ends_m = [place.at_m for place in here[1:]] + [network.tracks[track].length_m]
        for place, end_m in zip(here, ends_m, strict=True):
            if place.zone in seen:
                raise InputError(
                    "two zones have this name", field="stations.positions", value=place.zone
                )
            seen.add(place.zone)
            if end_m - place.at_m < SHORTEST_ZONE_M:
                raise InputError(
                    f"{place.zone} on {track} from {place.at_m:.1f} to {end_m:.1f} m is shorter"
                    f" than {SHORTEST_ZONE_M:g} m",
                    field="stations.positions" if plan.positions else "stations.zone_length_m",
                    value=place.station if plan.positions else plan.zone_length_m,
                )
