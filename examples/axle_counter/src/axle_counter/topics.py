"""The topics of axle counters."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray, String

from rail_msgs_py.table import Table
from rail_msgs_py.topics.column import Column
from rail_msgs_py.topics.qos import ESTIMATE, STREAM
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.waveform import Waveform

COILS: Final = Topic(
    "/wayside/{point}/wheel_sensor/coils",
    Float64MultiArray,
    STREAM,
    Waveform,
    "wheel_sensor_medium",
    "detection_point",
    "Amplitudes of the two coils of a wheel sensor in the tick that ends at the stamp [V].",
)
PASSAGES: Final = Topic(
    "/wayside/{point}/wheel_sensor/passages",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "detection_point",
    "axle_evaluator, the report",
    "Axles that have passed a wheel sensor in the tick, each way; passages that are unclear; "
    "whether a wheel is on it, and whether it works.",
    table=(
        Column("forward", "number of axles that have passed forward in the tick"),
        Column("backward", "number of axles that have passed backward in the tick"),
        Column(
            "unclear",
            "number of passages in the tick of which it cannot be told whether there was an "
            "axle, or which way it went",
        ),
        Column("busy", "1 if a wheel is on the sensor at the end of the tick, else 0"),
        Column("valid", "1 if the coils work, else 0"),
    ),
)
SECTIONS: Final = Topic(
    "/wayside/axle_counter/sections",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "axle_evaluator",
    "people, the report",
    "What the axle counter says of each section: 0 free, 1 occupied, 2 not known; axles counted.",
    table=(
        Column("occupancy", "0 free, 1 occupied, 2 not known"),
        Column(
            "axles",
            "number of axles counted in less those counted out since the last reset, NaN if the "
            "evaluator is switched off",
        ),
    ),
)
RESET: Final = Topic(
    "/wayside/axle_counter/reset",
    String,
    STREAM,
    None,
    "people",
    "axle_evaluator",
    "Name of a section to be reset in the next tick.",
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (COILS, PASSAGES, SECTIONS, RESET)
