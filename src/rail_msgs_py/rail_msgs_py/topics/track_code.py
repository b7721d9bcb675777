"""Track codes."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .qos import ESTIMATE, STREAM
from .topic import Topic

CIRCUIT_TX: Final = Topic(
    "/wayside/{circuit}/track_code/feed_end",
    Float64MultiArray,
    STREAM,
    Waveform,
    "track_code_transmitter",
    "rail_medium",
    "What a track circuit feeds into the rails in the tick: audio-frequency FM, real samples.",
)
CIRCUIT_RX: Final = Topic(
    "/wayside/{circuit}/track_code/relay_end",
    Float64MultiArray,
    STREAM,
    Waveform,
    "rail_medium",
    "track_code_transmitter",
    "What arrives at the other end of the same circuit; next to nothing if axles are between.",
)
OCCUPANCY: Final = Topic(
    "/wayside/{circuit}/track_code/occupancy",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "track_code_transmitter",
    "the track_code_transmitters behind",
    "Whether the circuit is occupied, from the level that arrives at its end.",
    columns=("occupied", "level_db"),
)
CODE_SENT: Final = Topic(
    "/wayside/{circuit}/track_code/message",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "track_code_transmitter",
    "people, the report",
    "The message that the circuit sends: the word as a number, and its fields.",
    columns=("word", "speed", "gradient", "block_length", "network"),
)
CODE_RX: Final = Topic(
    "/{train}/track_code/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "rail_medium",
    "track_code_receiver",
    "What the antenna of a train ahead of its first axle picks up from the rails.",
)
CODE_RECEIVED: Final = Topic(
    "/{train}/track_code/message",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "track_code_receiver",
    "code_supervision, localizer, people, the report",
    "The message understood on board: carrier in force, validity, the word and its fields.",
    columns=(
        *("carrier_hz", "valid", "word", "speed", "gradient", "block_length", "network"),
        "level_db",
    ),
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    CIRCUIT_TX,
    CIRCUIT_RX,
    OCCUPANCY,
    CODE_SENT,
    CODE_RX,
    CODE_RECEIVED,
)
