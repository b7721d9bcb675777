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
    Column(
        "network",
        "identity of the circuit: 3, 5, 6, 7 in turn along the track, so that no code can come "
        "from the circuit after the next",
    ),
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
    "the track_code_transmitters behind and ahead, the report",
    "Whether the circuit is occupied: clear only where its own code is recognised at its level, "
    "and no train that came in sequence is missing.",
    table=(
        Column(
            "occupied",
            "1 if the circuit is occupied, or not proven clear for another reason; else 0",
        ),
        Column(
            "level_db",
            "level of the circuit's own code at the receiving end, 0 dB being a wave of "
            "amplitude 1; -300 or more; NaN if the circuit is switched off",
        ),
        Column("detected", "1 if the receiver does not recognise its own code at its level"),
        Column(
            "holds",
            "1 if a train came in from the circuit behind, or may have been there since this one "
            "was switched on, and has not been seen to go on",
        ),
        Column("coherence", "part of the power in the band that is the circuit's own code, 0 to 1"),
        Column("shunted", "1 if the level is so low that axles are the likely reason"),
        Column(
            "missing",
            "1 if a train is held here or behind, and no receiver detects one from there to here",
        ),
        Column("found", "1 in the tick in which the train that is missing behind is found ahead"),
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
            "1 if the last word decided in the tick passed its check, on a carrier as strong as "
            "one's own circuit gives at least; else 0, and so are the four fields and the word",
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
