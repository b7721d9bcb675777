"""Intervals of the localizer in the map: lines along the track, yellow where unmonitored."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker

from rail_corridor.equipment.map_scene import LEAST_M, MapMarkers, MapScene
from rail_msgs_py.topics.localizer import LOCALIZER_STATE

from .live_estimate import STATUS

_PROTECTED: Final = (0.34, 0.71, 0.91, 0.5)
_UNMONITORED: Final = (0.94, 0.89, 0.26, 0.5)
_POINTS: Final = 8


def interval_markers(scene: MapScene) -> MapMarkers:
    """Markers of one tick."""
    table = scene.table(LOCALIZER_STATE)
    if table is None:
        return MapMarkers()
    markers: list[Any] = []
    for train, row in enumerate(table):
        status, low_m, high_m = (
            float(row[LOCALIZER_STATE.index[column]]) for column in ("status", "low_m", "high_m")
        )
        there = scene.on_line(train) and status > 0.0
        protected = there and STATUS[int(status)] == "protected"
        colour = _PROTECTED if protected else _UNMONITORED
        line = scene.marker("interval", train, Marker.LINE_STRIP, colour, there=there)
        if there:
            track = scene.network.tracks[scene.first_tracks[train]]
            line.scale.x = LEAST_M
            line.pose.orientation.w = 1.0
            low_m, high_m = (min(max(end_m, 0.0), track.length_m) for end_m in (low_m, high_m))
            pose = track.pose(np.linspace(low_m, high_m, _POINTS))
            places = zip(pose.x_m.tolist(), pose.y_m.tolist(), pose.z_m.tolist(), strict=True)
            line.points = [Point(x=x, y=y, z=z) for x, y, z in places]
        markers.append(line)
    return MapMarkers(markers)
