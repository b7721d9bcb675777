"""The position on board from all sensors."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table

from .column import Column
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
    table=(
        Column(
            "time_s",
            "simulated time at which the position was true, NaN if none was relayed in the tick",
        ),
        Column("position_m", "chainage of the front, NaN likewise"),
        Column(
            "half_m",
            "half-width of the interval that the wayside claims for it, infinite likewise",
        ),
    ),
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
    "atp, code_supervision, doppler_positioner, people, the report",
    "Front of the train from all sensors, its protection level, and which sensors are excluded.",
    table=(
        Column(
            "status",
            "what the position is good for: 0 unavailable, 1 unmonitored (holds unless one of "
            "certain sensors is faulty), 2 protected (holds even if any one sensor is faulty)",
        ),
        Column(
            "reason",
            "why the status is no better: 0 none, 1 no fix, 2 too wide, 3 ambiguous, 4 "
            "contradiction, 5 too few sensors, 6 unmonitored too long",
        ),
        Column("found", "1 if a sensor is known to be faulty, else 0"),
        Column(
            "excluded",
            "sum over the sensors that are left out: 1 range, 2 Doppler, 4 block, 8 odometer; 0 "
            "if none is",
        ),
        Column("front_m", "chainage of the front, NaN if unavailable"),
        Column("low_m", "least chainage that the front may have, minus infinity if unavailable"),
        Column("high_m", "greatest chainage that the front may have, infinite if unavailable"),
        Column("speed_mps", "positive towards greater chainage, NaN if unavailable"),
        Column(
            "speed_low_mps",
            "least speed that the train may have, minus infinity if unavailable",
        ),
        Column("speed_high_mps", "greatest speed that the train may have, infinite if unavailable"),
        Column(
            "sigma_m",
            "standard deviation of the front if no sensor is faulty, infinite if unavailable",
        ),
        Column(
            "fastest_mps",
            "greatest speed of either direction, unless wheels deceive that have not been found "
            "out yet, infinite if unavailable",
        ),
        Column(
            "wheels_doubted", "1 if the wheels slip, slide, send nothing, or may be faulty, else 0"
        ),
    ),
    awaited=True,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    RELAYED_RANGE,
    LOCALIZER_POSITION,
    LOCALIZER_STATE,
)
