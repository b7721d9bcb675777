"""Positions by Doppler shifts."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .column import Column
from .qos import ESTIMATE, STREAM
from .topic import Topic

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
    table=(
        Column(
            "reason",
            "why there is no fix: 0 there is one, 1 too few stations, 2 standstill, 3 geometry, "
            "4 ambiguous, 5 inconsistent, 6 off track",
        ),
        Column("chainage_m", "of the antenna on the track of the train, NaN without a fix"),
        Column("speed_mps", "positive towards greater chainage, NaN without a fix"),
        Column("chainage_m2", "variance of the chainage, NaN without a fix"),
        Column("chainage_speed_m2ps", "covariance of chainage and speed, NaN without a fix"),
        Column("speed_m2ps2", "variance of the speed, NaN without a fix"),
        Column("tones", "number of reference tones found in the tick, 0 or more"),
        Column("offset_hz", "by how much the receiver's own frequency is off, NaN without a fix"),
    ),
    awaited=True,
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

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    REFERENCE_TX,
    REFERENCE_RX,
    DOPPLER_FIX,
    DOPPLER_POSITION,
)
