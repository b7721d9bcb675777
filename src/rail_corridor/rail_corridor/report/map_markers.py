"""Trains as RViz and Foxglove draw them in ``map``: the truth, and where they are thought to be."""

from __future__ import annotations

from typing import Final

from visualization_msgs.msg import Marker, MarkerArray

from rail_corridor.equipment.map_scene import MapScene, place
from rail_corridor.equipment.registry import subsystems
from rail_msgs_py.topics.world import STATE

_TRUTH: Final = (0.55, 0.55, 0.55, 0.8)
_TRAIN_M: Final = (12.0, 3.0, 4.0)
_ABOVE_M: Final = 8.0
_LETTERS_M: Final = 6.0


def train_markers(scene: MapScene) -> MarkerArray:
    """Markers of one tick: the truth in grey with the names, and what equipment adds."""
    added = [subsystem.map_markers(scene) for subsystem in subsystems()]
    array = MarkerArray()
    for train, name in enumerate(scene.trains):
        here = scene.on_line(train)
        truth = scene.marker("truth", train, Marker.CUBE, _TRUTH, there=here)
        text = scene.marker("name", train, Marker.TEXT_VIEW_FACING, _TRUTH, there=here)
        array.markers += [truth, text]
        if here:
            columns = ("x_m", "y_m", "z_m", "heading_rad")
            x_m, y_m, z_m, heading_rad = (
                float(scene.state[train, STATE.index[column]]) for column in columns
            )
            place(truth, x_m, y_m, z_m, heading_rad)
            truth.scale.x, truth.scale.y, truth.scale.z = _TRAIN_M
            place(text, x_m, y_m, z_m + _ABOVE_M)
            text.scale.z = _LETTERS_M
            captions = (each.captions.get(train, "") for each in added)
            words = ", ".join(caption for caption in captions if caption)
            text.text = f"{name}: {words}" if words else name
    array.markers += [marker for each in added for marker in each.markers]
    return array
