"""The truth, the map of the corridor, and what moves the trains."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry, Path
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import MarkerArray

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table

from .qos import ESTIMATE, LATCHED, STREAM
from .topic import Topic

STATE: Final = Topic(
    "/world/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "world",
    "the report",
    "The truth of the tick, one row per train: where its antenna is, how it moves. "
    "Equipment does not read it.",
    columns=(
        *("path_m", "x_m", "y_m", "z_m", "heading_rad", "speed_mps", "acceleration_mps2"),
        *("track_index", "chainage_m", "on_line"),
    ),
)
TRUTH: Final = Topic(
    "/world/{train}/odometry",
    Odometry,
    ESTIMATE,
    Position,
    "world",
    "people",
    "The truth of one train along its track, once a second of simulated time.",
)
CORRIDOR_PATH: Final = Topic(
    "/world/{track}/path",
    Path,
    LATCHED,
    None,
    "world",
    "RViz, Foxglove",
    "Centre line of a track in `map`.",
)
CORRIDOR_MARKERS: Final = Topic(
    "/world/markers",
    MarkerArray,
    LATCHED,
    None,
    "world",
    "RViz, Foxglove",
    "Masts of the wayside stations and their zones, coloured by channel pair, in `map`.",
)
TRAIN_MARKERS: Final = Topic(
    "/report/trains",
    MarkerArray,
    ESTIMATE,
    None,
    "the report",
    "RViz, Foxglove",
    "Trains in `map` once a second of simulated time, while somebody listens: the truth in grey, "
    "the position by phase ranging as an ellipsoid of two sigma, the interval of the localizer as "
    "a line.",
)
SCENARIO: Final = Topic(
    "/world/scenario",
    String,
    LATCHED,
    None,
    "world",
    "rail view, people",
    "The scenario as JSON, and what follows from it: tracks, stations, zones, circuits and base "
    "stations with their places.",
)
ODOMETER: Final = Topic(
    "/{train}/odometer",
    Float64MultiArray,
    STREAM,
    Table,
    "world",
    "",
    "What the wheels of a train count: distance and speed, with the error of their diameter.",
    columns=("distance_m", "speed_mps"),
)
COMMAND: Final = Topic(
    "/{train}/{supervision}/command",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "code_supervision or atp",
    "world, people, the report",
    "What supervision on board permits and demands; it moves the train in the next tick.",
    columns=("permitted_mps", "warning", "service_brake", "emergency_brake"),
    awaited=True,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    STATE,
    TRUTH,
    CORRIDOR_PATH,
    CORRIDOR_MARKERS,
    TRAIN_MARKERS,
    SCENARIO,
    ODOMETER,
    COMMAND,
)
