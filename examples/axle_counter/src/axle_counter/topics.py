"""The topics of axle counters."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray, String

from rail_msgs_py.table import Table
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
    columns=("forward", "backward", "unclear", "busy", "valid"),
)
SECTIONS: Final = Topic(
    "/wayside/axle_counter/sections",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "axle_evaluator",
    "people, the report",
    "What the axle counter says of each section: 0 free, 1 occupied, 2 not known; axles counted.",
    columns=("occupancy", "axles"),
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
