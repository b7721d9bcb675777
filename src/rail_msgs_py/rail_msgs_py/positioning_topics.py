"""Topics of positioning on board; part of the table in `rail_msgs_py.topics`."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.qos import ESTIMATE, STREAM
from rail_msgs_py.table import Table
from rail_msgs_py.topic import Topic
from rail_msgs_py.waveform import Waveform

REFERENCE_TX: Final = Topic(
    "/wayside/{station}/reference/tone",
    Float64MultiArray,
    STREAM,
    Waveform,
    "reference_station",
    "reference_medium",
    "The reference tone that a station sends in the tick, in the slot of its frequency.",
)
REFERENCE_RX: Final = Topic(
    "/{train}/doppler/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "reference_medium",
    "doppler_positioner",
    "What a train receives of all reference stations in reach, centred on the tick.",
)
DOPPLER_FIX: Final = Topic(
    "/{train}/doppler/fix",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "doppler_positioner",
    "localizer, people, the report",
    "Position and speed from the shifts of the reference tones with their covariance, or why "
    "there is none; tones found, and the offset of the receiver.",
)
DOPPLER_POSITION: Final = Topic(
    "/{train}/doppler/position",
    Odometry,
    ESTIMATE,
    Position,
    "doppler_positioner",
    "people",
    "Position along the track by Doppler shifts; infinite variance = not known.",
)
TOLD_POSITION: Final = Topic(
    "/{train}/atp/told_position",
    Float64MultiArray,
    STREAM,
    Table,
    "atp",
    "localizer",
    "Where the wayside ranged the front of the train, as told over the radio, and when.",
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
)
