"""Phase ranging."""

from __future__ import annotations

from typing import Final

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from std_msgs.msg import Float64MultiArray

from rail_msgs_py.position import Position
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .qos import ESTIMATE, STREAM
from .topic import Topic

LINKS: Final = Topic(
    "/world/radio_medium/links",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "radio_medium",
    "the report",
    "The truth of the links of each train: carrier-to-noise ratio per sample of what its "
    "transponder and its station received.",
    columns=("snr_down", "snr_up", "downlink_channel", "uplink_channel"),
)
WRS_TX: Final = Topic(
    "/wayside/{site}/{zone}/tx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "wrs",
    "radio_medium",
    "What the antenna into the zone sends: the FM-carried tone on the zone's downlink channel.",
    below_owner=2,
)
WRS_RX: Final = Topic(
    "/wayside/{site}/{zone}/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "radio_medium",
    "wrs",
    "What the same antenna receives on the zone's uplink channel.",
)
RANGE: Final = Topic(
    "/wayside/{site}/{zone}/range",
    Range,
    STREAM,
    RangeReading,
    "wrs",
    "zone_controller",
    "Range to the train in the zone with its variance; inf = no signal, nan = unusable.",
    below_owner=2,
)
VRS_RX: Final = Topic(
    "/{train}/vrs/channel_{channel}/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "radio_medium",
    "vrs",
    "What the train's antenna receives on one downlink channel.",
)
VRS_TX: Final = Topic(
    "/{train}/vrs/tx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "vrs",
    "radio_medium",
    "The transponded tone on the uplink channel in force.",
)
VRS_CHANNEL: Final = Topic(
    "/{train}/vrs/channel",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "vrs",
    "people, the report",
    "Channel in force after the tick, and the level on each downlink channel.",
)
POSITION: Final = Topic(
    "/wayside/zone_controller/{train}/position",
    Odometry,
    ESTIMATE,
    Position,
    "zone_controller",
    "localizer, people, the report",
    "Position of a train along its track by phase ranging; infinite variance = not known.",
    below_owner=2,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    LINKS,
    WRS_TX,
    WRS_RX,
    RANGE,
    VRS_RX,
    VRS_TX,
    VRS_CHANNEL,
    POSITION,
)
