"""Positions by phase ranging in the map: an ellipsoid of two sigma, speed and sigma in words."""

from __future__ import annotations

import math
from typing import Any, Final

from visualization_msgs.msg import Marker

from rail_corridor.equipment.map_scene import (
    LEAST_M,
    MapMarkers,
    MapScene,
    TrackEstimate,
    place,
)
from rail_msgs_py.topics.ranging import POSITION

from .report import POSITION_COLUMNS

_COLUMN: Final = {name: index for index, name in enumerate(POSITION_COLUMNS)}
_COLOUR: Final = (0.84, 0.37, 0.00, 0.8)


def position_markers(scene: MapScene) -> MapMarkers:
    """Markers of one tick; an infinite variance says that a position is not known."""
    positions = scene.table(POSITION)
    if positions is None:
        return MapMarkers()
    markers: list[Any] = []
    captions: dict[int, str] = {}
    for train in range(len(scene.trains)):
        estimate = position_estimate(scene, train) if scene.on_line(train) else None
        there = estimate is not None
        marker = scene.marker("estimate", train, Marker.SPHERE, _COLOUR, there=there)
        captions[train] = "position not known"
        if estimate is not None:
            speed_mps = float(positions[train, _COLUMN["speed_mps"]])
            sigma_m = math.sqrt(estimate.variance_m2)
            pose = scene.network.tracks[estimate.track].pose(estimate.chainage_m)
            place(marker, *(float(p) for p in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)))
            marker.scale.x = max(LEAST_M, 4.0 * sigma_m)
            marker.scale.y = marker.scale.z = LEAST_M
            captions[train] = f"{3.6 * abs(speed_mps):.0f} km/h, sigma {sigma_m:.2f} m"
        markers.append(marker)
    return MapMarkers(markers, captions)


def position_estimate(scene: MapScene, train: int) -> TrackEstimate | None:
    """Where a train is by phase ranging, None if that is not known."""
    positions = scene.table(POSITION)
    if positions is None:
        return None
    track, chainage_m, variance_m2 = (
        float(positions[train, _COLUMN[column]])
        for column in ("track_index", "chainage_m", "variance_m2")
    )
    if not (math.isfinite(variance_m2) and track >= 0.0):
        return None
    return TrackEstimate(list(scene.network.tracks)[int(track)], chainage_m, variance_m2)
