"""The corridor as RViz and Foxglove draw it, in ``map``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path
from visualization_msgs.msg import Marker, MarkerArray

from rail_world.radio_description import StationAntenna
from rail_world.track import Track

STEP_M = 10.0


def path_of(track: Track) -> Path:
    """Centre line of a track, a pose every 10 m."""
    count = max(2, round(track.length_m / STEP_M) + 1)
    pose = track.pose(np.linspace(0.0, track.length_m, count))
    path = Path()
    path.header.frame_id = "map"
    for x_m, y_m, z_m, heading_rad in zip(
        pose.x_m, pose.y_m, pose.z_m, pose.heading_rad, strict=True
    ):
        stamped = PoseStamped()
        stamped.header.frame_id = "map"
        stamped.pose.position.x = float(x_m)
        stamped.pose.position.y = float(y_m)
        stamped.pose.position.z = float(z_m)
        stamped.pose.orientation.z = float(np.sin(heading_rad / 2.0))
        stamped.pose.orientation.w = float(np.cos(heading_rad / 2.0))
        path.poses.append(stamped)
    return path


def markers(stations: Sequence[StationAntenna]) -> MarkerArray:
    """A mast with its name for every wayside station."""
    array = MarkerArray()
    masts = {antenna.site: antenna.position_m for antenna in stations}
    for number, (site, position_m) in enumerate(masts.items()):
        for kind, text in ((Marker.CYLINDER, ""), (Marker.TEXT_VIEW_FACING, site)):
            marker = Marker(ns="masts" if not text else "names", id=number, type=kind, text=text)
            marker.header.frame_id = "map"
            marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = position_m
            marker.pose.orientation.w = 1.0
            marker.scale.x = marker.scale.y = 1.0
            marker.scale.z = 6.0
            marker.color.r, marker.color.g, marker.color.b, marker.color.a = 0.1, 0.4, 0.8, 1.0
            array.markers.append(marker)
    return array
