"""Where stations stand and which zone each of them watches.

A zone reaches from its station, towards increasing chainage, to the next station. Where a branch
leaves, a station stands at the fouling point, between the two tracks: it owns one zone on each,
and the zone before it ends there on both (Jeong et al., Figs 7 and 8).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rail_corridor.scenario.model import Scenario
from rail_corridor.scenario.section_fields import ChannelPair
from rail_world.line.network import Network

from .fouling import FoulingPoint, find_fouling_point
from .placing import (
    Place,
    check_spacing,
    find_anchors,
    place_automatically,
    place_by_hand,
    tracks_in_order,
)
from .section import CHANNELS, STATIONS, ChannelPlan, StationPlan

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Station:
    """One wayside ranging station.

    ``track`` and ``at_m`` say where it stands (at a junction: on the track the points lie on),
    ``zones`` which zones it owns, ``position_m`` where its antenna is in the map frame [m]: x, y
    and the altitude of the mast above that of the train antennas.
    """

    name: str
    track: str
    at_m: float
    zones: tuple[str, ...]
    position_m: Vector


@dataclass(frozen=True)
class Zone:
    """A part of a track that one station watches with one antenna.

    From ``start_m`` to ``end_m`` [m] of chainage. ``next`` are the zones that begin where it ends,
    ``previous`` is the one that ends where it begins. ``boresight`` is the unit vector from the
    mast to the middle of the zone, map frame.
    """

    name: str
    station: str
    track: str
    start_m: float
    end_m: float
    downlink_channel: int
    uplink_channel: int
    next: tuple[str, ...]
    previous: str | None
    boresight: Vector

    @property
    def length_m(self) -> float:
        """Length along the track [m]."""
        return self.end_m - self.start_m


@dataclass(frozen=True)
class Layout:
    """Every station and zone, and where branches become clear of their junctions."""

    stations: tuple[Station, ...]
    zones: tuple[Zone, ...]
    fouling_points: tuple[FoulingPoint, ...]

    @cached_property
    def _zones(self) -> dict[str, Zone]:
        return {zone.name: zone for zone in self.zones}

    @cached_property
    def _stations(self) -> dict[str, Station]:
        return {station.name: station for station in self.stations}

    @cached_property
    def _on_track(self) -> dict[str, tuple[Zone, ...]]:
        names = dict.fromkeys(zone.track for zone in self.zones)
        return {n: tuple(zone for zone in self.zones if zone.track == n) for n in names}

    def zone(self, name: str) -> Zone:
        """Return the zone of that name; KeyError if there is none."""
        return self._zones[name]

    def station(self, name: str) -> Station:
        """Return the station of that name; KeyError if there is none."""
        return self._stations[name]

    def zone_at(self, track: str, chainage_m: float) -> Zone:
        """Return the zone a point is in.

        At a station the zone that begins there; a branch, before its fouling point, lies in the
        zone of the track it leaves.
        """
        return self.place_at(track, chainage_m)[0]

    def place_at(self, track: str, chainage_m: float) -> tuple[Zone, float]:
        """Return the zone a point is in, and its chainage along the track of that zone [m]."""
        zones = self._on_track[track]
        if chainage_m < zones[0].start_m:
            for point in self.fouling_points:
                if point.branch == track:
                    chainage_m = min(point.at_m + chainage_m, math.nextafter(point.track_m, 0.0))
                    return self.place_at(point.track, chainage_m)
        inside = [zone for zone in zones if zone.start_m <= chainage_m]
        return (inside[-1] if inside else zones[0]), chainage_m


def layout_of(scenario: Scenario) -> Layout:
    """Stations and zones of a scenario; InputError if they cannot be placed."""
    return scenario.derive(_placed)


def _placed(scenario: Scenario) -> Layout:
    return place_stations(scenario.network, STATIONS.of(scenario), CHANNELS.of(scenario))


def place_stations(network: Network, plan: StationPlan, channels: ChannelPlan) -> Layout:
    """Place the stations of a network and give every zone its channels.

    Parameters
    ----------
    network : Network
        The tracks.
    plan : StationPlan
        The rule, or every station.
    channels : ChannelPlan
        Pairs that the zones of a track use in turn. Tracks that start at a junction use those for
        branches; a branch of a branch uses those for main tracks again, and so on.

    Raises
    ------
    InputError
        Names the field of the scenario file.
    """
    order = tracks_in_order(network)
    fouling = {
        junction.branch: find_fouling_point(network, index, plan.fouling_distance_m)
        for index, junction in enumerate(network.junctions)
    }
    anchors = {name: find_anchors(network, name, fouling) for name in order}
    if plan.positions is None:
        places = place_automatically(network, order, anchors, fouling, plan.zone_length_m or 0.0)
    else:
        places = place_by_hand(network, order, anchors, fouling, plan)
    check_spacing(network, places, plan)
    return _build(network, order, places, fouling, plan, channels)


def _build(
    network: Network,
    order: Sequence[str],
    places: dict[str, list[Place]],
    fouling: dict[str, FoulingPoint],
    plan: StationPlan,
    channels: ChannelPlan,
) -> Layout:
    masts = _masts(network, order, places, fouling, plan)
    previous: dict[str, str | None] = {}
    following: dict[str, list[str]] = {}
    owned: dict[str, list[str]] = {}
    for track in order:
        for index, place in enumerate(places[track]):
            if index:
                before: str | None = places[track][index - 1].zone
            elif track in fouling:
                before = _zone_before(places[fouling[track].track], track)
            else:
                before = None
            previous[place.zone] = before
            following.setdefault(place.zone, [])
            if before is not None:
                following[before].append(place.zone)
            owned.setdefault(place.station, []).append(place.zone)
    zones: list[Zone] = []
    for track in order:
        pairs = _pairs(network, track, channels)
        ends_m = [place.at_m for place in places[track][1:]] + [network.tracks[track].length_m]
        for index, (place, end_m) in enumerate(zip(places[track], ends_m, strict=True)):
            downlink, uplink = pairs[index % len(pairs)]
            pose = network.tracks[track].pose(0.5 * (place.at_m + end_m))
            middle = np.array([float(pose.x_m), float(pose.y_m), float(pose.z_m)])
            line = middle - np.array(masts[place.station].position_m)
            zones.append(
                Zone(
                    name=place.zone,
                    station=place.station,
                    track=track,
                    start_m=place.at_m,
                    end_m=end_m,
                    downlink_channel=downlink,
                    uplink_channel=uplink,
                    next=tuple(following[place.zone]),
                    previous=previous[place.zone],
                    boresight=_vector(line / np.linalg.norm(line)),
                )
            )
    stations = tuple(
        Station(mast.name, mast.track, mast.at_m, tuple(owned[mast.name]), mast.position_m)
        for mast in masts.values()
    )
    points = tuple(fouling.values())
    return Layout(stations, tuple(zones), points)


def _zone_before(places: Sequence[Place], branch: str) -> str | None:
    for before, place in itertools.pairwise(places):
        if place.branch == branch:
            return before.zone
    return None


def _pairs(network: Network, track: str, channels: ChannelPlan) -> tuple[ChannelPair, ...]:
    depth = 0
    junction = network.parent_junction(track)
    while junction is not None:
        depth += 1
        junction = network.parent_junction(junction.track)
    return channels.branch if depth % 2 else channels.main


def _masts(
    network: Network,
    order: Sequence[str],
    places: dict[str, list[Place]],
    fouling: dict[str, FoulingPoint],
    plan: StationPlan,
) -> dict[str, Station]:
    """Stations with their antennas: right of the track, or between the tracks at a junction."""
    masts: dict[str, Station] = {}
    for track in order:
        for place in places[track]:
            if place.station in masts:
                continue
            pose = network.tracks[track].pose(place.at_m)
            here = np.array([float(pose.x_m), float(pose.y_m), float(pose.z_m)])
            if place.branch is None:
                heading = float(pose.heading_rad)
                here[:2] += plan.mast_offset_m * np.array([math.sin(heading), -math.cos(heading)])
            else:
                other = network.tracks[place.branch].pose(fouling[place.branch].branch_m)
                there = np.array([float(other.x_m), float(other.y_m), float(other.z_m)])
                here = 0.5 * (here + there)
            here[2] += plan.mast_height_m
            masts[place.station] = Station(place.station, track, place.at_m, (), _vector(here))
    return masts


def _vector(values: npt.NDArray[np.float64]) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
