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

from .column import Column
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
    table=(
        Column(
            "snr_down",
            "ratio of carrier to noise power per sample, linear, of what the train's transponder "
            "received; 0 if it did not answer",
        ),
        Column(
            "snr_up",
            "the same of what the station received of the answer; 0 if the train was not its "
            "strongest source",
        ),
        Column(
            "downlink_channel",
            "number of the channel that the train answers to, 0 if it does not answer",
        ),
        Column(
            "uplink_channel",
            "number of the channel that the train answers on, 0 if it does not answer",
        ),
    ),
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
    "Range to the train in the zone with its variance; inf = no signal, nan = unusable. Its "
    "radiation type is INFRARED, as the message has none for radio.",
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
    table=(
        Column("downlink", "number of the downlink channel in force, 0 before the first"),
        Column("uplink", "number of the uplink channel in force, 0 before the first"),
        Column(
            "level_{channel}_dbm",
            "level of the tone received on each downlink channel, minus infinity where none is "
            "heard",
        ),
    ),
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
