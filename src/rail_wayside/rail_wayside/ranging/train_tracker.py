"""From ranges to trains: the zone controller's estimator.

A transponder does not say which train it is on. As the signaller's train describer does, the
controller knows which trains enter where, and then follows each from zone to zone: a reading
belongs to the train that can have got there (`rail_wayside.ranging.association`). What cannot be
told is flagged, not guessed.

What is known of where trains enter counts only from the start of the run, time 0. A tracker that is
started later knows no train; it finds one by what it reports over the radio: the only reading in
the only interval of a front that holds one is that train's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from .association import FOLLOWED_S, RunningOrder, TrainCandidate, associate
from .reading_places import ReadingPlace, ReadingPlaces
from .zone_map import ZoneMap

MAX_ACCELERATION_MPS2 = 2.0
#: A train that had been lost is claimed to be known only after so long: what came back may be
#: another one's signal, or two stations' on one channel.
CONFIRMED_S = 1.5
#: No train brakes harder.
MOST_BRAKING_MPS2 = 1.5
GATE_M = 12.0
SIGMAS = 6.0
MAX_SPEED_MPS = 160.0
#: Process noise of the speed estimate: acceleration, 1 sigma.
ACCELERATION_SIGMA_MPS2 = 0.7


@dataclass(frozen=True)
class ZoneReading:
    """A range in a zone; NaN = a signal that cannot be read, inf = none."""

    range_m: float
    variance_m2: float


@dataclass(frozen=True)
class Reported:
    """Track, and least and greatest chainage of a front, by what a train reports [m]."""

    track: str
    low_m: float
    high_m: float


NO_READING = ZoneReading(math.inf, math.inf)


@dataclass(frozen=True)
class TrainFix:
    """Where a train is. Infinite variance: not known, the chainage is the last that was."""

    train: str
    zone: str
    track: str
    chainage_m: float
    variance_m2: float
    speed_mps: float
    speed_variance_m2ps2: float
    reason: str = ""


@dataclass
class _TrackedTrain:
    name: str
    zone: str
    chainage_m: float
    entered: bool = False
    left: bool = False
    seen_s: float = 0.0
    regained_s: float = -math.inf
    speed_mps: float = 0.0
    # Covariance of the filter on (chainage, speed).
    p_ss: float = 0.0
    p_sv: float = 0.0
    p_vv: float = 0.0
    filtered_m: float = 0.0
    fix: TrainFix | None = None
    unknown: str = field(default="not on the line yet")


class ZoneTracker:
    """Follows every train along the corridor.

    Parameters
    ----------
    zone_map : ZoneMap
    trains : sequence of (train, zone)
        Trains in the order in which they enter the line, and the zone they are first seen in.

    Attributes
    ----------
    unidentified, disturbed : tuple of str
        Zones with a reading that is no train's, and with a signal that cannot be read.
    restarted : bool
        Whether its first tick came after time 0.
    """

    def __init__(self, zone_map: ZoneMap, trains: Sequence[tuple[str, str]]) -> None:
        self._map = zone_map
        self._trains = [
            _TrackedTrain(name, zone, zone_map.zones[zone].start_m) for name, zone in trains
        ]
        self._order = RunningOrder()
        self.unidentified: tuple[str, ...] = ()
        self.disturbed: tuple[str, ...] = ()
        self.restarted: bool | None = None

    def leave(self, train: str) -> None:
        """Forget a train that has left the control area: it is in no zone any more."""
        for each in self._trains:
            if each.name == train:
                each.left = True

    def update(
        self,
        time_s: float,
        readings: Mapping[str, ZoneReading],
        reported: Mapping[str, Reported] | None = None,
    ) -> list[TrainFix]:
        """Fixes of all trains from the readings of one tick.

        Parameters
        ----------
        time_s : float
        readings : mapping of zone to ZoneReading
        reported : mapping of train to Reported, optional
            Where fronts are by radio; used only for trains that a tracker started anew looks for.
        """
        if self.restarted is None:
            self.restarted = time_s > 0.0
        located_in: list[ReadingPlace] = []
        disturbed: list[str] = []
        for name, reading in readings.items():
            if reading is NO_READING:
                continue
            if math.isnan(reading.range_m):
                disturbed.append(name)
            elif math.isfinite(reading.range_m):
                located = self._map.zones[name].locate(reading.range_m, reading.variance_m2)
                if located is not None:
                    located_in.append(ReadingPlace(name, *located))
        self.disturbed = tuple(disturbed)
        places = ReadingPlaces(self._map, located_in)
        distances_m = places.distances_m()
        owners = self._assign(time_s, places, distances_m, reported or {})
        owned = {*owners.values()}
        self.unidentified = tuple(
            place.zone for index, place in enumerate(places.all) if index not in owned
        )
        self._learn_order(owners, places, distances_m)
        shared = self._shared_zones(owners, places)
        fixes = []
        for index, train in enumerate(self._trains):
            if index in owners:
                self._follow(train, time_s, places[owners[index]])
            elif self._has_left(train, time_s):
                train.left = True
            fixes.append(self._fix(train, index in owners, shared, readings))
        return fixes

    def _assign(
        self,
        time_s: float,
        places: ReadingPlaces,
        distances_m: Mapping[tuple[int, int], float],
        reported: Mapping[str, Reported],
    ) -> dict[int, int]:
        """Index of the place of each train."""
        candidates: list[TrainCandidate] = []
        due: set[str] = set()
        for index, train in enumerate(self._trains):
            if train.left:
                continue
            if train.entered:
                misses = self._misses(train, time_s, places)
                followed = time_s - train.seen_s <= FOLLOWED_S
                candidates.append(TrainCandidate(index, followed, misses))
            elif self.restarted:
                here = self._in_interval(places, reported.get(train.name))
                candidates.append(TrainCandidate(index, False, here))
            elif train.zone not in due:
                # Trains that are due at a zone enter there in their order.
                due.add(train.zone)
                here = dict.fromkeys(places.of(train.zone), 0.0)
                candidates.append(TrainCandidate(index, False, here))
        return associate(candidates, distances_m, self._order)

    def _in_interval(self, places: ReadingPlaces, where: Reported | None) -> dict[int, float]:
        """The places in a reported interval; they count alike."""
        if where is None:
            return {}
        found: dict[int, float] = {}
        for number, place in enumerate(places.all):
            slack_m = GATE_M + SIGMAS * math.sqrt(place.variance_m2)
            inside = where.low_m - slack_m <= place.chainage_m <= where.high_m + slack_m
            if inside and self._map.zones[place.zone].track == where.track:
                found[number] = 0.0
        return found

    def _misses(
        self, train: _TrackedTrain, time_s: float, places: ReadingPlaces
    ) -> dict[int, float]:
        """How far each place in reach is from where the train is expected, over what it may be."""
        elapsed_s = time_s - train.seen_s
        expected_m = train.speed_mps * elapsed_s
        sigma_m = math.sqrt(max(train.p_vv, 0.0)) * elapsed_s
        gate_m = GATE_M + 0.5 * MAX_ACCELERATION_MPS2 * elapsed_s**2 + SIGMAS * sigma_m
        gate_m = min(gate_m, GATE_M + MAX_SPEED_MPS * elapsed_s)
        misses: dict[int, float] = {}
        for number, distance_m in places.from_place(train.zone, train.filtered_m):
            miss_m = abs(distance_m - expected_m)
            slack_m = gate_m + SIGMAS * math.sqrt(places[number].variance_m2)
            if miss_m <= slack_m:
                misses[number] = miss_m / slack_m
        return misses

    def _learn_order(
        self,
        owners: Mapping[int, int],
        places: ReadingPlaces,
        distances_m: Mapping[tuple[int, int], float],
    ) -> None:
        """Take note of who is ahead of whom among the trains seen now."""
        train_of = {number: train for train, number in owners.items()}
        for (place, further), distance_m in distances_m.items():
            one, other = train_of.get(place), train_of.get(further)
            if one is not None and other is not None and one < other:
                self._order.learn(one, other, distance_m)
        zones = self._map.zones
        for one, other in self._order.known():
            here, there = owners.get(one), owners.get(other)
            if here is None or there is None or (here, there) in distances_m:
                continue
            # Out of sight of each other on one track, their order stays.
            if zones[places[here].zone].track != zones[places[there].zone].track:
                self._order.learn(one, other, None)

    def _follow(self, train: _TrackedTrain, time_s: float, place: ReadingPlace) -> None:
        """Step the train's filter on (chainage, speed) with a new place."""
        if not train.entered:
            train.entered = True
            train.zone, train.filtered_m = place.zone, place.chainage_m
            train.p_ss, train.p_sv, train.p_vv = place.variance_m2, 0.0, 30.0**2
            train.speed_mps = 0.0
            if self.restarted:
                train.regained_s = time_s
        else:
            elapsed_s = time_s - train.seen_s
            if elapsed_s > FOLLOWED_S:
                train.regained_s = time_s
            distance_m = self._map.path_distance_m(
                train.zone, train.filtered_m, place.zone, place.chainage_m
            )
            assert distance_m is not None
            noise = ACCELERATION_SIGMA_MPS2**2
            train.p_ss += elapsed_s * (2.0 * train.p_sv + elapsed_s * train.p_vv)
            train.p_ss += 0.25 * noise * elapsed_s**4
            train.p_sv += elapsed_s * train.p_vv + 0.5 * noise * elapsed_s**3
            train.p_vv += noise * elapsed_s**2
            innovation_m = distance_m - train.speed_mps * elapsed_s
            total = train.p_ss + place.variance_m2
            gain_s, gain_v = train.p_ss / total, train.p_sv / total
            # The filtered place lies short of the reading by the part that is not believed.
            train.filtered_m = place.chainage_m - (1.0 - gain_s) * innovation_m
            train.zone = place.zone
            train.speed_mps += gain_v * innovation_m
            train.p_vv -= gain_v * train.p_sv
            train.p_sv *= 1.0 - gain_s
            train.p_ss *= 1.0 - gain_s
        train.seen_s = time_s
        train.chainage_m = place.chainage_m
        train.fix = TrainFix(
            train.name,
            place.zone,
            self._map.zones[place.zone].track,
            place.chainage_m,
            place.variance_m2,
            train.speed_mps,
            train.p_vv,
        )

    def _shared_zones(self, owners: Mapping[int, int], places: ReadingPlaces) -> set[str]:
        """Zones in which two trains were last seen, one of which is not received alone."""
        seen: dict[str, int] = {}
        for index, train in enumerate(self._trains):
            if train.entered and not train.left:
                zone = places[owners[index]].zone if index in owners else train.zone
                seen[zone] = seen.get(zone, 0) + 1
        return {zone for zone, count in seen.items() if count > 1}

    def _fix(
        self,
        train: _TrackedTrain,
        located: bool,
        shared: set[str],
        readings: Mapping[str, ZoneReading],
    ) -> TrainFix:
        zone = self._map.zones[train.zone]
        if located and train.fix is not None:
            reading = readings[train.zone]
            outside_m = train.fix.chainage_m - zone.end_m
            if outside_m > 0.5 * zone.length_m:
                return replace(train.fix, reason=self._beyond(train.zone))
            if train.seen_s - train.regained_s < CONFIRMED_S:
                reason = f"found again in {train.zone}, not confirmed yet"
                return replace(
                    train.fix, variance_m2=math.inf, speed_variance_m2ps2=math.inf, reason=reason
                )
            if math.isfinite(reading.variance_m2):
                return train.fix
        if not train.entered:
            reason = train.unknown
        elif train.left:
            reason = f"has left the line past {train.zone}"
        elif train.zone in shared:
            reason = f"two trains in {train.zone}"
        elif (disturbed := self._disturbed_near(train)) is not None:
            reason = f"{disturbed} disturbed"
        elif train.zone not in readings:
            reason = f"{zone.site} of {train.zone} does not answer"
        elif train.chainage_m > zone.end_m + 0.5 * zone.length_m:
            reason = f"lost {self._beyond(train.zone)}"
        else:
            reason = f"not received in {train.zone}"
        return TrainFix(
            train.name,
            train.zone,
            zone.track,
            train.chainage_m,
            math.inf,
            train.speed_mps,
            math.inf,
            reason,
        )

    def _has_left(self, train: _TrackedTrain, time_s: float) -> bool:
        """Whether a train has run out of the last zone of its line, and is heard no more.

        It must have been so near the end, and so fast, that it could not have stopped before.
        """
        if not train.entered or train.left or self._map.following[train.zone]:
            return train.left
        zone = self._map.zones[train.zone]
        way_m = zone.end_m - train.chainage_m
        v = train.speed_mps
        stops_m = 0.5 * v * abs(v) / MOST_BRAKING_MPS2
        return time_s - train.seen_s > FOLLOWED_S and way_m < stops_m

    def _beyond(self, zone: str) -> str:
        """Name the stations that should have taken over a train past the end of a zone."""
        sites = sorted({self._map.zones[name].site for name in self._map.following[zone]})
        silent = f"{' and '.join(sites)} does not answer" if sites else "the line ends there"
        return f"past the end of {zone}: {silent}"

    def _disturbed_near(self, train: _TrackedTrain) -> str | None:
        """Name a disturbed zone that the train may be in, None if there is none."""
        if train.zone in self.disturbed:
            return train.zone
        for name in self.disturbed:
            zone = self._map.zones[name]
            distance_m = self._map.path_distance_m(train.zone, train.chainage_m, name, zone.start_m)
            if distance_m is not None and abs(distance_m) < 1.5 * zone.length_m:
                return name
        return None
