"""One tick as RViz and Foxglove draw it in ``map``, and the markers that equipment adds to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from visualization_msgs.msg import Marker

from rail_msgs_py.stamps import to_time
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_world.line.network import Network

#: A marker that is smaller than this could not be seen [m].
LEAST_M = 4.0
Colour = tuple[float, float, float, float]


@dataclass(frozen=True)
class MapScene:
    """One tick of a run.

    Parameters
    ----------
    stamp_ns : int
    trains : sequence of str
        Names, which the rows of all tables follow.
    network : Network
    first_tracks : sequence of str
        Track that the route of each train begins on.
    table : callable
        Recorded table of a topic in the tick [train, column]; None if it is not recorded.
    """

    stamp_ns: int
    trains: Sequence[str]
    network: Network
    first_tracks: Sequence[str]
    table: Callable[[Topic], FloatArray | None]

    @property
    def state(self) -> FloatArray:
        """The truth [train, column of `STATE`]."""
        state = self.table(STATE)
        assert state is not None
        return state

    def row(self, topic: Topic, train: int) -> dict[str, float] | None:
        """What a table says of a train, by the names of its columns; None if it says nothing."""
        table = self.table(topic)
        if table is None:
            return None
        return dict(zip(topic.columns, table[train].tolist(), strict=True))

    def on_line(self, train: int) -> bool:
        """Whether a train is on the line."""
        return bool(self.state[train, STATE.index["on_line"]] > 0.0)

    def marker(self, space: str, train: int, kind: int, colour: Colour, *, there: bool) -> Any:
        """A marker of a train; what is not there is taken off the map."""
        marker = Marker(ns=space, id=train, type=kind)
        marker.action = Marker.ADD if there else Marker.DELETE
        marker.header.frame_id = "map"
        for key, part in to_time(self.stamp_ns).items():
            setattr(marker.header.stamp, key, part)
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
        return marker


class TrackEstimate(NamedTuple):
    """Where equipment thinks a train to be: track, chainage [m] and its variance [m^2]."""

    track: str
    chainage_m: float
    variance_m2: float


@dataclass(frozen=True)
class MapMarkers:
    """Markers of one kind of equipment, and what stands behind the name of a train."""

    markers: Sequence[Any] = ()
    captions: Mapping[int, str] = field(default_factory=dict)


def place(marker: Any, x_m: float, y_m: float, z_m: float, heading_rad: float = 0.0) -> None:
    """Put a marker at a place."""
    position, orientation = marker.pose.position, marker.pose.orientation
    position.x, position.y, position.z = x_m, y_m, z_m
    orientation.z, orientation.w = math.sin(0.5 * heading_rad), math.cos(0.5 * heading_rad)
