"""The corridor as RViz and Foxglove draw it, in ``map``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path
from visualization_msgs.msg import Marker, MarkerArray

from .drawing import Drawing, Stretch
from .network import Network
from .track import Track

STEP_M = 10.0
#: Okabe and Ito's colours, told apart by colour-blind people as well: one to a group of stretches.
PAIR_COLOURS = (
    *((0.00, 0.45, 0.70), (0.90, 0.62, 0.00), (0.00, 0.62, 0.45), (0.80, 0.47, 0.65)),
    *((0.34, 0.71, 0.91), (0.84, 0.37, 0.00), (0.94, 0.89, 0.26)),
)


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


def markers(drawing: Drawing, network: Network) -> MarkerArray:
    """A pole with its name for every mast, and stretches as lines along their tracks."""
    array = MarkerArray(markers=_lines(drawing.stretches, network))
    for number, mast in enumerate(drawing.masts):
        for kind, text in ((Marker.CYLINDER, ""), (Marker.TEXT_VIEW_FACING, mast.name)):
            marker = Marker(ns="masts" if not text else "names", id=number, type=kind, text=text)
            marker.header.frame_id = "map"
            place = marker.pose.position
            place.x, place.y, place.z = mast.position_m
            marker.pose.orientation.w = 1.0
            marker.scale.x = marker.scale.y = 1.0
            marker.scale.z = 6.0
            marker.color.r, marker.color.g, marker.color.b, marker.color.a = 0.1, 0.4, 0.8, 1.0
            array.markers.append(marker)
    return array


def _lines(stretches: Sequence[Stretch], network: Network) -> list[Marker]:
    """A line for every stretch, in the colour of its group."""
    groups = sorted({stretch.group for stretch in stretches})
    lines = []
    for number, stretch in enumerate(stretches):
        start_m, end_m = stretch.start_m, stretch.end_m
        count = max(2, round((end_m - start_m) / STEP_M) + 1)
        pose = network.tracks[stretch.track].pose(np.linspace(start_m, end_m, count))
        line = Marker(ns="zones", id=number, type=Marker.LINE_STRIP)
        line.header.frame_id = "map"
        line.pose.orientation.w = 1.0
        line.scale.x = 3.0
        colour = PAIR_COLOURS[groups.index(stretch.group) % len(PAIR_COLOURS)]
        line.color.r, line.color.g, line.color.b = colour
        line.color.a = 1.0
        line.points = [
            Point(x=float(x), y=float(y), z=float(z))
            for x, y, z in zip(pose.x_m, pose.y_m, pose.z_m, strict=True)
        ]
        lines.append(line)
    return lines
