"""Trains as RViz and Foxglove draw them in ``map``: the truth, and where they are thought to be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from rail_corridor.equipment.ranging.report import POSITION_COLUMNS
from rail_msgs_py.stamps import to_time
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_signals.localizer.protection_level import Status
from rail_world.line.network import Network
from rail_world.line.track import Track

_POSITION = {name: index for index, name in enumerate(POSITION_COLUMNS)}
_TRUTH, _ESTIMATE = (0.55, 0.55, 0.55, 0.8), (0.84, 0.37, 0.00, 0.8)
_PROTECTED, _UNMONITORED = (0.34, 0.71, 0.91, 0.5), (0.94, 0.89, 0.26, 0.5)
#: An ellipsoid that is smaller than this could not be seen [m].
_LEAST_M = 4.0
_ABOVE_M = 8.0
_INTERVAL_POINTS = 8


def train_markers(
    stamp_ns: int,
    trains: Sequence[str],
    network: Network,
    state: FloatArray,
    position: FloatArray,
    located: FloatArray | None = None,
    first_tracks: Sequence[str] = (),
) -> MarkerArray:
    """Markers of one tick.

    Parameters
    ----------
    stamp_ns : int
    trains : sequence of str
        Names, which the rows of both tables follow.
    network : Network
    state : float64 [train, column of `STATE.columns`]
    position : float64 [train, column of `POSITION_COLUMNS`]
        NaN where none was received, an infinite variance where it is not known.
    located : float64 [train, column of `LOCALIZER_STATE.columns`], optional
    first_tracks : sequence of str
        Track that the localizer of each train counts along.
    """
    tracks = list(network.tracks.values())
    array = MarkerArray()
    for number, name in enumerate(trains):
        true, said = state[number], position[number]
        here = bool(true[STATE.index["on_line"]] > 0.0)
        truth = _marker("truth", number, Marker.CUBE, _TRUTH, stamp_ns, there=here)
        estimate = _marker("estimate", number, Marker.SPHERE, _ESTIMATE, stamp_ns, there=here)
        text = _marker("name", number, Marker.TEXT_VIEW_FACING, _TRUTH, stamp_ns, there=here)
        array.markers += [truth, estimate, text]
        if located is not None:
            track = network.tracks[first_tracks[number]]
            array.markers.append(_interval(number, stamp_ns, located[number], track, there=here))
        if not here:
            continue
        _place(truth, *(float(true[STATE.index[c]]) for c in ("x_m", "y_m", "z_m", "heading_rad")))
        truth.scale.x, truth.scale.y, truth.scale.z = 12.0, 3.0, 4.0
        _place(text, truth.pose.position.x, truth.pose.position.y, truth.pose.position.z + _ABOVE_M)
        text.scale.z = 6.0
        text.text = f"{name}: position not known"
        sigma_m = math.sqrt(said[_POSITION["variance_m2"]])
        if not math.isfinite(sigma_m) or said[_POSITION["track_index"]] < 0.0:
            estimate.action = Marker.DELETE
            continue
        pose = tracks[int(said[_POSITION["track_index"]])].pose(said[_POSITION["chainage_m"]])
        _place(estimate, *(float(p) for p in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)))
        estimate.scale.x = max(_LEAST_M, 4.0 * sigma_m)
        estimate.scale.y = estimate.scale.z = _LEAST_M
        speed_kmh = 3.6 * abs(said[_POSITION["speed_mps"]])
        text.text = f"{name}: {speed_kmh:.0f} km/h, sigma {sigma_m:.2f} m"
    return array


def _interval(number: int, stamp_ns: int, said: FloatArray, track: Track, *, there: bool) -> Any:
    """The interval of the localizer as a line along the track; yellow where it is unmonitored."""
    status = said[LOCALIZER_STATE.index["status"]]
    colour = _PROTECTED if status == Status.PROTECTED else _UNMONITORED
    there = bool(there and status > Status.UNAVAILABLE)
    line = _marker("interval", number, Marker.LINE_STRIP, colour, stamp_ns, there=there)
    if there:
        line.scale.x = _LEAST_M
        line.pose.orientation.w = 1.0
        low_m, high_m = (
            min(max(float(said[LOCALIZER_STATE.index[end]]), 0.0), track.length_m)
            for end in ("low_m", "high_m")
        )
        pose = track.pose(np.linspace(low_m, high_m, _INTERVAL_POINTS))
        places = zip(pose.x_m.tolist(), pose.y_m.tolist(), pose.z_m.tolist(), strict=True)
        line.points = [Point(x=x, y=y, z=z) for x, y, z in places]
    return line


def _marker(
    space: str,
    number: int,
    kind: int,
    colour: tuple[float, float, float, float],
    stamp_ns: int,
    *,
    there: bool,
) -> Any:
    marker = Marker(ns=space, id=number, type=kind)
    marker.action = Marker.ADD if there else Marker.DELETE
    marker.header.frame_id = "map"
    for key, part in to_time(stamp_ns).items():
        setattr(marker.header.stamp, key, part)
    marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
    return marker


def _place(marker: Any, x_m: float, y_m: float, z_m: float, heading_rad: float = 0.0) -> None:
    position, orientation = marker.pose.position, marker.pose.orientation
    position.x, position.y, position.z = x_m, y_m, z_m
    orientation.z, orientation.w = math.sin(0.5 * heading_rad), math.cos(0.5 * heading_rad)
