"""Train control by radio."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray, UInt8MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import Waveform

from .qos import ESTIMATE, STREAM
from .topic import Topic

BACKBONE: Final = "/world/backbone"
CBTC_BASE_TX: Final = Topic(
    "/wayside/{base}/cbtc/downlink",
    Float64MultiArray,
    STREAM,
    Waveform,
    "cbtc_base_station",
    "cbtc_medium",
    "What both antennas of a base station send in the tick: its beacon and the bursts to trains.",
)
CBTC_BASE_RX: Final = Topic(
    "/wayside/{base}/cbtc/uplink",
    Float64MultiArray,
    STREAM,
    Waveform,
    "cbtc_medium",
    "cbtc_base_station",
    "What they receive: one slot per train, without a sample where no train is in reach.",
)
CBTC_TRAIN_TX: Final = Topic(
    "/{train}/cbtc_radio/uplink",
    Float64MultiArray,
    STREAM,
    Waveform,
    "cbtc_radio",
    "cbtc_medium",
    "The burst that the antennas of a train send in its slot, on the uplink in force.",
)
CBTC_TRAIN_RX: Final = Topic(
    "/{train}/cbtc_radio/channel_{channel}/downlink",
    Float64MultiArray,
    STREAM,
    Waveform,
    "cbtc_medium",
    "cbtc_radio",
    "What they receive on one downlink channel: the slot of the beacon, then the train's own.",
)
DOWN_TELEGRAMS: Final = Topic(
    "/wayside/zone_controller/{base}/telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "zone_controller",
    "cbtc_base_station or backbone",
    "Frames for the trains of a base station, sent in the next tick.",
    below_owner=2,
)
UP_TELEGRAMS: Final = Topic(
    "/wayside/{base}/cbtc/telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "cbtc_base_station",
    "zone_controller or backbone",
    "Frames that the base station has received in the tick.",
)
BACKBONE_DOWN: Final = Topic(
    "/world/backbone/{base}/downlink_telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "backbone",
    "cbtc_base_station",
    "What the network makes of the frames for the trains of a base station; it sends them in the "
    "next tick.",
    below_owner=2,
)
BACKBONE_UP: Final = Topic(
    "/world/backbone/{base}/uplink_telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "backbone",
    "zone_controller",
    "What the network makes of the frames that the base station has received in the tick.",
    below_owner=2,
)
STRIKES: Final = Topic(
    "/world/backbone/strikes",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "backbone",
    "the report",
    "The truth of the network: frames carried so far, and how often each threat has struck.",
    #: After the first the threats of EN 50159:2010, 4.2.
    columns=(
        *("frames", "repetition", "deletion", "insertion", "resequencing", "corruption", "delay"),
        "masquerade",
    ),
)
TRAIN_TELEGRAMS: Final = Topic(
    "/{train}/atp/telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "atp",
    "cbtc_radio",
    "The frame that the train sends in the next tick.",
)
RADIO_TELEGRAMS: Final = Topic(
    "/{train}/cbtc_radio/telegrams",
    UInt8MultiArray,
    STREAM,
    Telegrams,
    "cbtc_radio",
    "atp",
    "Frames that the train has received in the tick.",
)
RADIO_LINK: Final = Topic(
    "/{train}/cbtc_radio/link",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "cbtc_radio",
    "people, the report",
    "Channel in force after the tick, the beacon's signal-to-noise ratio on it, bursts received.",
    columns=("channel", "beacon_snr", "bursts"),
)
CBTC_LINKS: Final = Topic(
    "/world/cbtc_medium/links",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "cbtc_medium",
    "the report",
    "The truth of each train's best link: its base station and the mean signal-to-noise ratio "
    "per sample at one antenna, both ways.",
    columns=("base_index", "snr_down", "snr_up"),
)
ATP_STATE: Final = Topic(
    "/{train}/atp/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "atp",
    "people, the report",
    "Where the train believes its front to be, its authority and how old that is, and counts of "
    "frames accepted, lost and rejected.",
    columns=(
        *("accepted", "lost", "rejected"),
        *("front_m", "uncertainty_m", "end_of_authority_m", "authority_age_s"),
    ),
)
REPORTS: Final = Topic(
    "/wayside/zone_controller/{train}/reports",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "zone_controller",
    "people, the report",
    "The location reports taken from a train in the tick, one row each, in their order.",
    #: As in `rail_msgs_py.train_radio.train_report.LocationReport`, true at the first.
    columns=(
        *("sealed_s", "train", "segment", "offset_m", "direction", "speed_mps", "uncertainty_m"),
        *("length_m", "integrity_confirmed", "position_valid"),
    ),
    below_owner=2,
)
AUTHORITY: Final = Topic(
    "/wayside/zone_controller/{train}/authority",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "zone_controller",
    "people, the report",
    "The movement authority given to a train, and counts of its reports accepted, lost and "
    "rejected.",
    columns=(
        *("end_of_authority_m", "limit_mps", "worst_rear_m", "report_age_s"),
        *("accepted", "lost", "rejected"),
    ),
    below_owner=2,
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    CBTC_BASE_TX,
    CBTC_BASE_RX,
    CBTC_TRAIN_TX,
    CBTC_TRAIN_RX,
    DOWN_TELEGRAMS,
    UP_TELEGRAMS,
    BACKBONE_DOWN,
    BACKBONE_UP,
    STRIKES,
    TRAIN_TELEGRAMS,
    RADIO_TELEGRAMS,
    RADIO_LINK,
    CBTC_LINKS,
    ATP_STATE,
    REPORTS,
    AUTHORITY,
)
