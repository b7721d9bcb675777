"""Positions by phase ranging in the map: an ellipsoid of two sigma, speed and sigma in words."""

from __future__ import annotations

import math
from typing import Any, Final

from visualization_msgs.msg import Marker

from rail_corridor.equipment.map_scene import LEAST_M, MapMarkers, MapScene, place
from rail_msgs_py.topics.ranging import POSITION

from .report import POSITION_COLUMNS

_COLUMN: Final = {name: index for index, name in enumerate(POSITION_COLUMNS)}
_COLOUR: Final = (0.84, 0.37, 0.00, 0.8)


def position_markers(scene: MapScene) -> MapMarkers:
    """Markers of one tick; an infinite variance says that a position is not known."""
    positions = scene.table(POSITION)
    if positions is None:
        return MapMarkers()
    tracks = list(scene.network.tracks.values())
    markers: list[Any] = []
    captions: dict[int, str] = {}
    for train in range(len(scene.trains)):
        track, chainage_m, variance_m2, speed_mps = (
            float(positions[train, _COLUMN[column]])
            for column in ("track_index", "chainage_m", "variance_m2", "speed_mps")
        )
        sigma_m = math.sqrt(variance_m2)
        known = scene.on_line(train) and math.isfinite(sigma_m) and track >= 0.0
        marker = scene.marker("estimate", train, Marker.SPHERE, _COLOUR, there=known)
        captions[train] = "position not known"
        if known:
            pose = tracks[int(track)].pose(chainage_m)
            place(marker, *(float(p) for p in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)))
            marker.scale.x = max(LEAST_M, 4.0 * sigma_m)
            marker.scale.y = marker.scale.z = LEAST_M
            captions[train] = f"{3.6 * abs(speed_mps):.0f} km/h, sigma {sigma_m:.2f} m"
        markers.append(marker)
    return MapMarkers(markers, captions)
