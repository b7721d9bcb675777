"""Positions by Doppler shifts."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

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
    columns=(
        *("reason", "chainage_m", "speed_mps"),
        *("chainage_m2", "chainage_speed_m2ps", "speed_m2ps2", "tones", "offset_hz"),
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
