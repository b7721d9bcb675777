"""Every topic of the corridor: name, type, view, quality of service, who sends, who reads.

The only place that knows them. ``docs/topics.md`` is generated from this table, and a test
compares it with a running graph.
"""

from __future__ import annotations

from typing import Final

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from nav_msgs.msg import Odometry, Path
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Range
from std_msgs.msg import Float64MultiArray, Header, String
from visualization_msgs.msg import MarkerArray

from rail_msgs_py.bus_topics import (
    BUS_LINK,
    BUS_LINKS,
    BUS_RX,
    BUS_STATE,
    BUS_TRACE,
    BUS_TREND,
    BUS_TX,
    BUS_VERDICTS,
    REFLECTOMETER_RX,
    REFLECTOMETER_TX,
)
from rail_msgs_py.cbtc_topics import (
    ATP_STATE,
    AUTHORITY,
    BACKBONE_DOWN,
    BACKBONE_UP,
    CBTC_BASE_RX,
    CBTC_BASE_TX,
    CBTC_LINKS,
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
    DOWN_TELEGRAMS,
    RADIO_LINK,
    RADIO_TELEGRAMS,
    REPORTS,
    STRIKES,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.position import Position
from rail_msgs_py.positioning_topics import (
    DOPPLER_FIX,
    DOPPLER_POSITION,
    LOCALIZER_POSITION,
    LOCALIZER_STATE,
    REFERENCE_RX,
    REFERENCE_TX,
    TOLD_POSITION,
)
from rail_msgs_py.qos import ESTIMATE, LATCHED, STREAM
from rail_msgs_py.range_reading import RangeReading
from rail_msgs_py.table import Table
from rail_msgs_py.topic import Topic
from rail_msgs_py.track_code_topics import (
    CIRCUIT_RX,
    CIRCUIT_TX,
    CODE_RECEIVED,
    CODE_RX,
    CODE_SENT,
    OCCUPANCY,
)
from rail_msgs_py.waveform import Waveform

CLOCK: Final = Topic(
    "/clock",
    Clock,
    STREAM,
    None,
    "world",
    "wrs, zone_controller, track_code_transmitter, cbtc_base_station, cbtc_radio, backbone, "
    "reference_station, bus_medium, bus_terminal, train_bus_monitor",
    "Start of a tick.",
)
STATE: Final = Topic(
    "/world/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "world",
    "radio_medium, rail_medium, cbtc_medium, reference_medium, the report",
    "The truth of the tick, one row per train: where its antenna is, how it moves. "
    "Equipment does not read it.",
)
TRUTH: Final = Topic(
    "/world/{train}/odometry",
    Odometry,
    ESTIMATE,
    Position,
    "world",
    "people",
    "The truth of one train along its track, once a second of simulated time.",
)
LINKS: Final = Topic(
    "/world/radio_medium/links",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "radio_medium",
    "the report",
    "The truth of the links of each train: carrier-to-noise ratio per sample of what its "
    "transponder and its station received.",
)
FINISHED: Final = Topic(
    "/world/finished",
    Header,
    LATCHED,
    None,
    "world",
    "the report",
    "The run has reached its end.",
)
CORRIDOR_PATH: Final = Topic(
    "/world/{track}/path",
    Path,
    LATCHED,
    None,
    "world",
    "RViz, Foxglove",
    "Centre line of a track in `map`.",
)
CORRIDOR_MARKERS: Final = Topic(
    "/world/markers",
    MarkerArray,
    LATCHED,
    None,
    "world",
    "RViz, Foxglove",
    "Masts of the wayside stations and their zones, coloured by channel pair, in `map`.",
)
SCENARIO: Final = Topic(
    "/world/scenario",
    String,
    LATCHED,
    None,
    "world",
    "rail view, people",
    "The scenario as JSON, and what follows from it: tracks, stations, zones, circuits and base "
    "stations with their places.",
)
TRAIN_MARKERS: Final = Topic(
    "/report/trains",
    MarkerArray,
    ESTIMATE,
    None,
    "the report",
    "RViz, Foxglove",
    "Trains in `map` once a second of simulated time, while somebody listens: the truth in grey, "
    "the position by phase ranging as an ellipsoid of two sigma, the interval of the localizer as "
    "a line.",
)
DONE: Final = Topic(
    "{node}/done",
    Header,
    STREAM,
    None,
    "radio_medium, rail_medium, cbtc_medium, backbone, reference_medium, bus_medium, "
    "zone_controller",
    "world",
    "The node has finished the tick of this stamp.",
)
OBSERVED: Final = Topic(
    "/report/observed",
    Header,
    LATCHED,
    None,
    "the report",
    "world",
    "The report has read everything up to this stamp; the world does not run far ahead of it.",
)
READY: Final = Topic(
    "/ready",
    String,
    LATCHED,
    None,
    "every node",
    "world",
    "Name of a node whose topics are all connected.",
)
FAILED: Final = Topic(
    "/failed",
    DiagnosticStatus,
    LATCHED,
    None,
    "every node that waits for others, the report for the launcher: world, radio_medium, "
    "rail_medium, cbtc_medium, backbone, zone_controller, track_code_transmitter, "
    "cbtc_base_station, code_supervision, cbtc_radio, atp, reference_medium, localizer, "
    "bus_medium, bus_terminal, train_bus_monitor",
    "world, radio_medium, rail_medium, cbtc_medium, backbone, zone_controller, "
    "track_code_transmitter, cbtc_base_station, code_supervision, cbtc_radio, atp, "
    "reference_medium, localizer, bus_medium, bus_terminal, train_bus_monitor, the report",
    "A node that is not waited for any longer, and why.",
)
DIAGNOSTICS: Final = Topic(
    "/diagnostics",
    DiagnosticArray,
    LATCHED,
    None,
    "every node",
    "people, the report",
    "Health, published when it changes (REP 107).",
)
WRS_TX: Final = Topic(
    "/wayside/{site}/{zone}/tx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "wrs",
    "radio_medium",
    "What the antenna into the zone sends: the FM-carried tone on the zone's downlink channel.",
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
    "Range to the train in the zone with its variance; inf = nothing heard, nan = unusable.",
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
)

ODOMETER: Final = Topic(
    "/{train}/odometer",
    Float64MultiArray,
    STREAM,
    Table,
    "world",
    "code_supervision, atp, localizer",
    "What the wheels of a train count: distance and speed, with the error of their diameter.",
)
COMMAND: Final = Topic(
    "/{train}/{supervision}/command",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "code_supervision or atp",
    "world, people, the report",
    "What supervision on board permits and demands; it moves the train in the next tick.",
)

ALL: Final[tuple[Topic, ...]] = (
    *(CLOCK, STATE, TRUTH, LINKS, FINISHED, CORRIDOR_PATH, CORRIDOR_MARKERS, SCENARIO),
    *(TRAIN_MARKERS, DONE, OBSERVED),
    *(READY, FAILED, DIAGNOSTICS, WRS_TX, WRS_RX, RANGE, VRS_RX, VRS_TX, VRS_CHANNEL, POSITION),
    *(CIRCUIT_TX, CIRCUIT_RX, OCCUPANCY, CODE_SENT, CODE_RX, CODE_RECEIVED, ODOMETER, COMMAND),
    *(CBTC_BASE_TX, CBTC_BASE_RX, CBTC_TRAIN_TX, CBTC_TRAIN_RX, DOWN_TELEGRAMS, UP_TELEGRAMS),
    *(TRAIN_TELEGRAMS, RADIO_TELEGRAMS, RADIO_LINK, CBTC_LINKS, ATP_STATE, REPORTS, AUTHORITY),
    *(BACKBONE_DOWN, BACKBONE_UP, STRIKES),
    *(REFERENCE_TX, REFERENCE_RX, DOPPLER_FIX, DOPPLER_POSITION),
    *(TOLD_POSITION, LOCALIZER_POSITION, LOCALIZER_STATE),
    *(BUS_TX, BUS_RX, BUS_LINK, REFLECTOMETER_TX, REFLECTOMETER_RX, BUS_TRACE, BUS_VERDICTS),
    *(BUS_TREND, BUS_STATE, BUS_LINKS),
)

STATE_COLUMNS: Final = (
    *("path_m", "x_m", "y_m", "z_m", "heading_rad", "speed_mps", "acceleration_mps2"),
    *("track_index", "chainage_m", "on_line"),
)
LINK_COLUMNS: Final = ("snr_down", "snr_up", "downlink_channel", "uplink_channel")
OCCUPANCY_COLUMNS: Final = ("occupied", "level_db")
SENT_COLUMNS: Final = ("word", "speed", "gradient", "block_length", "network")
RECEIVED_COLUMNS: Final = (
    *("carrier_hz", "valid", "word", "speed", "gradient", "block_length", "network"),
    "level_db",
)
ODOMETER_COLUMNS: Final = ("distance_m", "speed_mps")
RADIO_COLUMNS: Final = ("channel", "beacon_snr", "bursts")
CBTC_LINK_COLUMNS: Final = ("base_index", "snr_down", "snr_up")
ATP_COLUMNS: Final = (
    *("accepted", "lost", "rejected"),
    *("front_m", "uncertainty_m", "end_of_authority_m", "authority_age_s"),
)
AUTHORITY_COLUMNS: Final = (
    *("end_of_authority_m", "limit_mps", "worst_rear_m", "report_age_s"),
    *("accepted", "lost", "rejected"),
)
#: Where and what as ``rail_msgs_py.train_report.LocationReport``, true at the first.
REPORT_COLUMNS: Final = (
    *("sealed_s", "train", "segment", "offset_m", "direction", "speed_mps", "uncertainty_m"),
    *("length_m", "integrity_confirmed", "position_valid"),
)
#: After the first the threats of EN 50159:2010, 4.2.
STRIKE_COLUMNS: Final = (
    *("frames", "repetition", "deletion", "insertion", "resequencing", "corruption", "delay"),
    "masquerade",
)
DOPPLER_COLUMNS: Final = (
    *("reason", "chainage_m", "speed_mps"),
    *("chainage_m2", "chainage_speed_m2ps", "speed_m2ps2", "tones", "offset_hz"),
)
TOLD_COLUMNS: Final = ("time_s", "position_m", "half_m")
LOCALIZER_COLUMNS: Final = (
    *("status", "reason", "found", "excluded"),
    *("front_m", "low_m", "high_m", "speed_mps", "speed_low_mps", "speed_high_mps", "sigma_m"),
)
COMMAND_COLUMNS: Final = ("permitted_mps", "warning", "service_brake", "emergency_brake")


def kind_of(name: str) -> Topic | None:
    """The kind of a topic by its absolute name, None if it is not one of the corridor's."""
    if name.endswith("/done"):
        return DONE
    return next((topic for topic in ALL if topic.matches(name)), None)
