"""The truth, the map of the corridor, and what moves the trains."""

from __future__ import annotations

from typing import Final

from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import MarkerArray

from rail_msgs_py.map_pose import MapPose
from rail_msgs_py.position import Position
from rail_msgs_py.table import Table

from .column import Column
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
    table=(
        Column(
            "path_m",
            "distance of the antenna along the route, 0 at chainage 0 of its first track; the "
            "antenna is at the end that leads in the first direction of travel",
        ),
        Column("x_m", "of the antenna in `map`, east"),
        Column("y_m", "of the antenna in `map`, north"),
        Column("z_m", "of the antenna in `map`, altitude"),
        Column(
            "heading_rad",
            "direction of increasing chainage, counter-clockwise from east, not wrapped",
        ),
        Column("speed_mps", "positive towards greater chainage"),
        Column("acceleration_mps2", "derivative of that speed"),
        Column("track_index", "place of the track in the order of the scenario, from 0"),
        Column("chainage_m", "of the antenna on that track"),
        Column(
            "on_line",
            "1 if the train is on the line; 0 before it enters and after it has left",
        ),
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
MAP_POSE: Final = Topic(
    "/report/{train}/{source}/pose",
    PoseWithCovarianceStamped,
    ESTIMATE,
    MapPose,
    "the report",
    "RViz, Foxglove, filters",
    "Pose of a train in `map`, aligned with the track, once a second of simulated time, while "
    "somebody listens and where a position is known: the source is truth (exact) or what has "
    "estimated it, ranging, doppler or localizer. Along the track the covariance is that of the "
    "estimate; across it and up the standard deviation is 0.1 m, about its x 0.1 rad, about y and "
    "z 0.01 rad.",
    below_owner=3,
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
    table=(
        Column(
            "distance_m",
            "run since the start, whichever way; with the error of the wheels' diameter and "
            "their slip",
        ),
        Column("speed_mps", "magnitude, likewise"),
    ),
)
COMMAND: Final = Topic(
    "/{train}/{supervision}/command",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "code_supervision or atp",
    "world, people, the report",
    "What supervision on board permits and demands; it moves the train in the next tick.",
    table=(
        Column("permitted_mps", "speed not to be exceeded, infinite where none is laid down"),
        Column("warning", "1 if the driver is warned, else 0"),
        Column("service_brake", "1 if the service brake is demanded, else 0"),
        Column("emergency_brake", "1 if the emergency brake is demanded, else 0; it goes before"),
        Column("traction_cut_off", "1 if the motors get no current, else 0"),
        Column(
            "on_sight",
            "1 if the driver is to run on sight, able to stop short of any obstacle, else 0",
        ),
    ),
    awaited=True,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    STATE,
    TRUTH,
    CORRIDOR_PATH,
    CORRIDOR_MARKERS,
    TRAIN_MARKERS,
    MAP_POSE,
    SCENARIO,
    ODOMETER,
    COMMAND,
)
