"""The position on board from all sensors."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table

from .qos import ESTIMATE, STREAM
from .topic import Topic

RELAYED_RANGE: Final = Topic(
    "/{train}/atp/relayed_range",
    Float64MultiArray,
    STREAM,
    Table,
    "atp",
    "localizer",
    "Where the wayside ranged the front of the train, as relayed by radio, and when.",
    columns=("time_s", "position_m", "half_m"),
)
LOCALIZER_POSITION: Final = Topic(
    "/{train}/localizer/position",
    Odometry,
    ESTIMATE,
    Position,
    "localizer",
    "people",
    "Position along the track from all sensors; infinite variance = not known.",
)
LOCALIZER_STATE: Final = Topic(
    "/{train}/localizer/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "localizer",
    "atp, code_supervision, people, the report",
    "Front of the train from all sensors, its protection level, and which sensors are excluded.",
    columns=(
        *("status", "reason", "found", "excluded"),
        *("front_m", "low_m", "high_m", "speed_mps", "speed_low_mps", "speed_high_mps", "sigma_m"),
    ),
    awaited=True,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    RELAYED_RANGE,
    LOCALIZER_POSITION,
    LOCALIZER_STATE,
)
