"""Track codes."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .column import Column
from .qos import ESTIMATE, STREAM
from .topic import Topic

#: Fields of the message in a code, sent or received.
_FIELDS: Final = (
    Column(
        "speed",
        "two indices into the table of 16 speeds: 16 times that of the speed allowed in the "
        "block, plus that of the one allowed at its end",
    ),
    Column(
        "gradient",
        "of the block in steps of 5 ‰ from -50 ‰ on, rounded downhill: 10 is level",
    ),
    Column("block_length", "of the block in steps of 25 m, rounded down"),
    Column("network", "number of the network, 0 to 7; the circuits here send 0"),
)
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
    table=(
        Column(
            "occupied",
            "1 if the circuit is occupied, or its level too low for another reason; else 0",
        ),
        Column(
            "level_db",
            "level at the receiving end in the band of the carrier, 0 dB being a wave of "
            "amplitude 1; -300 or more",
        ),
    ),
)
CODE_SENT: Final = Topic(
    "/wayside/{circuit}/track_code/message",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "track_code_transmitter",
    "people, the report",
    "The message that the circuit sends: the word as a number, and its fields.",
    table=(
        Column(
            "word",
            "the bits of the code as a number, the lowest tone least significant; NaN in every "
            "column if the circuit is switched off",
        ),
        *_FIELDS,
    ),
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
    table=(
        Column("carrier_hz", "carrier in force, 0 if there is none"),
        Column(
            "valid",
            "1 if the last word decided in the tick passed its check, else 0; the four fields "
            "and the word are then 0",
        ),
        Column("word", "the bits of the code as a number, the lowest tone least significant"),
        *_FIELDS,
        Column(
            "level_db",
            "in the band of the carrier in force, 0 dB being a wave of amplitude 1; minus "
            "infinity without a carrier, 0 if nothing came or the receiver is switched off",
        ),
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
