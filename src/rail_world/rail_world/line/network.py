"""The network: tracks joined by facing points, and the routes through it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from rail_world.errors import WorldDataError
from rail_world.line.description import JunctionDescription, TrackDescription

from .route import Leg, Route
from .track import Track, track_from_description
from .ttobench import load_ttobench

_CLOSEST_JUNCTIONS_M = 100.0
_ROUNDING_M = 1e-6


class Network:
    """Tracks in the map frame, joined by junctions.

    A branch begins, with its chainage 0, on another track, with the pose and altitude that
    track has there; whatever start the branch itself was given is replaced.

    Parameters
    ----------
    tracks : mapping of str to Track
        The tracks by name.
    junctions : sequence of JunctionDescription
        The facing points.

    Raises
    ------
    WorldDataError
        For an unknown track, points off their track or closer than 100 m to the next, two
        junctions that start the same branch, or a circle of branches.
    """

    def __init__(
        self, tracks: Mapping[str, Track], junctions: Sequence[JunctionDescription] = ()
    ) -> None:
        if not tracks:
            raise WorldDataError("tracks", {}, "at least one track is needed")
        _check_names(tracks, junctions)
        self.junctions = tuple(junctions)
        self._onto = {junction.branch: junction for junction in junctions}
        self.tracks: dict[str, Track] = {}
        for name in _roots_first(tracks, self._onto, self.junctions):
            junction = self._onto.get(name)
            self.tracks[name] = (
                tracks[name]
                if junction is None
                else _placed(tracks[name], self.tracks[junction.track], junction.at_m)
            )
        # In the order given, whatever order they had to be placed in.
        self.tracks = {name: self.tracks[name] for name in tracks}
        _check_places(self.tracks, self.junctions)

    def junctions_on(self, track: str) -> tuple[JunctionDescription, ...]:
        """Junctions on a track, by chainage."""
        return tuple(sorted((j for j in self.junctions if j.track == track), key=lambda j: j.at_m))

    def parent_junction(self, track: str) -> JunctionDescription | None:
        """Return the junction a track starts at, if it starts at one."""
        return self._onto.get(track)

    def route(self, tracks: Sequence[str], direction: int = 1) -> Route:
        """Make the route over tracks given in order of travel.

        Parameters
        ----------
        tracks : sequence of str
            Names; each joined to the next by a junction.
        direction : {1, -1}
            Whether the travel is towards increasing or decreasing chainage.

        Raises
        ------
        WorldDataError
            If a track is unknown, or two are not joined in that direction.
        """
        names = list(tracks)
        for index, name in enumerate(names):
            if name not in self.tracks:
                raise WorldDataError(f"route.{index}", name, "there is no such track")
        if direction < 0:
            names.reverse()
        legs: list[Leg] = []
        for name, after in zip(names, [*names[1:], None], strict=True):
            end_m = self.tracks[name].length_m
            if after is not None:
                junction = self._onto.get(after)
                if junction is None or junction.track != name:
                    sense = "increasing" if direction > 0 else "decreasing"
                    raise WorldDataError(
                        "route",
                        list(tracks),
                        f"no junction on {name} starts {after}, towards {sense} chainage",
                    )
                end_m = min(junction.at_m, end_m)
            start_m = legs[-1].path_end_m if legs else 0.0
            legs.append(Leg(self.tracks[name], start_m, end_m))
        return Route(legs)


def build_network(
    tracks: Mapping[str, TrackDescription],
    junctions: Sequence[JunctionDescription] = (),
    *,
    directory: str | Path = ".",
) -> Network:
    """Make the network a scenario describes.

    Parameters
    ----------
    tracks : mapping of str to TrackDescription
        Tracks by name.
    junctions : sequence of JunctionDescription
        Facing points.
    directory : str or Path
        Where relative names of TTOBench files start from.

    Raises
    ------
    WorldDataError
        One line that names the field and the value, and the file if one was read.
    """
    built = {}
    for name, description in tracks.items():
        if description.ttobench is None:
            built[name] = track_from_description(name, description)
        else:
            file = Path(directory) / description.ttobench
            built[name] = load_ttobench(file, name=name, start=description.start)
    return Network(built, junctions)


def _placed(track: Track, parent: Track, at_m: float) -> Track:
    pose = parent.pose(min(at_m, parent.length_m))
    return track.moved(float(pose.x_m), float(pose.y_m), float(pose.heading_rad), float(pose.z_m))


def _check_names(tracks: Mapping[str, Track], junctions: Sequence[JunctionDescription]) -> None:
    started: set[str] = set()
    for index, junction in enumerate(junctions):
        for key, name in (("track", junction.track), ("branch", junction.branch)):
            if name not in tracks:
                raise WorldDataError(f"junctions.{index}.{key}", name, "there is no such track")
        length_m = tracks[junction.track].length_m
        if junction.at_m > length_m + _ROUNDING_M:
            raise WorldDataError(
                f"junctions.{index}.at_m",
                junction.at_m,
                f"is off the track {junction.track}, which ends at {length_m:g} m",
            )
        if junction.branch in started:
            raise WorldDataError(
                f"junctions.{index}.branch", junction.branch, "another junction starts it already"
            )
        started.add(junction.branch)


def _roots_first(
    tracks: Mapping[str, Track],
    onto: Mapping[str, JunctionDescription],
    junctions: Sequence[JunctionDescription],
) -> list[str]:
    placed = [name for name in tracks if name not in onto]
    waiting = [name for name in tracks if name in onto]
    while waiting:
        ready = [name for name in waiting if onto[name].track in placed]
        if not ready:
            index = next(i for i, j in enumerate(junctions) if j.branch in waiting)
            raise WorldDataError(
                f"junctions.{index}.branch", junctions[index].branch, "the branches form a circle"
            )
        placed += ready
        waiting = [name for name in waiting if name not in ready]
    return placed


def _check_places(tracks: Mapping[str, Track], junctions: Sequence[JunctionDescription]) -> None:
    for name in tracks:
        on_track = [(j.at_m, i) for i, j in enumerate(junctions) if j.track == name]
        on_track.sort()
        for (before_m, _), (at_m, index) in pairwise(on_track):
            if at_m - before_m < _CLOSEST_JUNCTIONS_M:
                raise WorldDataError(
                    f"junctions.{index}.at_m",
                    at_m,
                    f"is less than {_CLOSEST_JUNCTIONS_M:g} m from the junction at {before_m:g} m",
                )
