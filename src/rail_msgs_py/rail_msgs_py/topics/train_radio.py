"""Train control by radio."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray, UInt8MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import Waveform

from .column import Column
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
    table=(
        Column(
            "frames",
            "number of frames that came from both ends so far, without those of the intruder",
        ),
        Column("repetition", "number of times so far that a frame was sent again"),
        Column("deletion", "number of times so far that a frame was taken away"),
        Column("insertion", "number of times so far that a frame was added, random or altered"),
        Column(
            "resequencing",
            "number of times so far that a frame was held back until later ones had passed",
        ),
        Column("corruption", "number of times so far that bits of a frame were changed"),
        Column("delay", "number of times so far that a frame was held back for a random time"),
        Column(
            "masquerade",
            "number of times so far that a frame came under a wrong identity: of another link, "
            "sealed with another key, or thrown back to its sender",
        ),
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
    table=(
        Column("channel", "number of the downlink channel in force, 0 if there is none"),
        Column(
            "beacon_snr",
            "Es/N0 of the beacon on it behind the combiner, linear, mean over its symbols; 0 if "
            "it was not heard",
        ),
        Column(
            "bursts",
            "number of bursts in the train's own slot that were detected in the tick, on all "
            "channels",
        ),
    ),
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
    table=(
        Column(
            "base_index",
            "place of the base station with the strongest downlink in the order of the scenario, "
            "from 0",
        ),
        Column(
            "snr_down",
            "mean signal-to-noise ratio of a sample at one antenna of the train, linear; 0 out "
            "of reach",
        ),
        Column("snr_up", "the same at one antenna of the base station; 0 out of reach"),
    ),
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
    table=(
        Column("accepted", "number of frames accepted since the equipment was started"),
        Column("lost", "number of frames found to be missing between those"),
        Column(
            "rejected",
            "number of frames refused; a copy through a second base station does not count",
        ),
        Column("front_m", "chainage of the front as the train believes it, NaN if not known"),
        Column("uncertainty_m", "half-width of the interval of the front, infinite if not known"),
        Column(
            "end_of_authority_m",
            "chainage that the front must not pass, NaN without an authority",
        ),
        Column("authority_age_s", "time since the authority was sealed, infinite without one"),
        Column(
            "mode",
            "0 position not known, train is held; 1 located, stands; 2 moving under supervision; "
            "3 on sight, released by a person",
        ),
        Column(
            "odometer_doubted",
            "1 if wheels slide or spin, by physics or by ranges, and distances are bounded by "
            "physics; else 0",
        ),
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
    table=(
        Column("sealed_s", "simulated time at which the report was true"),
        Column("train", "number of the train in telegrams"),
        Column("segment", "number of the track in telegrams"),
        Column("offset_m", "chainage of the front on it"),
        Column("direction", "1 if the train faces greater chainage, -1 if smaller"),
        Column("speed_mps", "magnitude, rounded up"),
        Column("uncertainty_m", "half-width of the interval of the front, rounded up"),
        Column("length_m", "of the train, rounded up"),
        Column("integrity_confirmed", "1 if the train knows itself to be whole, else 0"),
        Column(
            "position_valid",
            "1 if segment, offset, direction and uncertainty mean anything, else 0",
        ),
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
    table=(
        Column(
            "end_of_authority_m",
            "chainage that the front must not pass, NaN if the train has no authority",
        ),
        Column(
            "limit_mps",
            "speed limit in force over the length in which the train may be, NaN likewise",
        ),
        Column("worst_rear_m", "hindmost chainage at which the rear may be, NaN if not known"),
        Column("report_age_s", "age of the newest report accepted, infinite before the first"),
        Column("accepted", "number of reports accepted since the equipment was started"),
        Column("lost", "number of reports found to be missing between those"),
        Column(
            "rejected",
            "number of reports refused; a copy through a second base station does not count",
        ),
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
