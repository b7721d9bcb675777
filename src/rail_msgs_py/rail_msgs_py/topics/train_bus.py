"""The train bus."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .qos import ESTIMATE, STREAM
from .topic import Topic

BUS_TX: Final = Topic(
    "/{train}/bus_{end}/tx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "bus_terminal",
    "bus_medium",
    "The frame that the terminal at one end drives onto the bus in the tick: real samples, "
    "as a share of the driver's level.",
)
BUS_RX: Final = Topic(
    "/{train}/bus_{end}/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "bus_medium",
    "bus_terminal",
    "What arrives at that terminal from the other end [V].",
)
BUS_LINK: Final = Topic(
    "/{train}/bus_{end}/link",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "bus_terminal",
    "people, the report",
    "Counts of frames and bits after the tick, the measured margin, and at the head whether the "
    "end of the train is confirmed.",
    #: Counts of a terminal since it was started; `bits` are those it knew before they came.
    columns=(
        *("sent", "received", "lost", "bits", "bit_errors", "ebn0_db"),
        *("other_end", "other_end_age_s"),
    ),
)
REFLECTOMETER_TX: Final = Topic(
    "/{train}/train_bus_monitor/tx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "train_bus_monitor",
    "bus_medium",
    "The edges that the reflectometer sends into the head of the bus, one row for each trace; "
    "without a sample where it does not measure.",
)
REFLECTOMETER_RX: Final = Topic(
    "/{train}/train_bus_monitor/rx",
    Float64MultiArray,
    STREAM,
    Waveform,
    "bus_medium",
    "train_bus_monitor",
    "What comes back, over the size of the edge.",
)
BUS_TRACE: Final = Topic(
    "/{train}/train_bus_monitor/trace",
    Float64MultiArray,
    ESTIMATE,
    Waveform,
    "train_bus_monitor",
    "people",
    "The mean of the traces of one measurement.",
)
BUS_VERDICTS: Final = Topic(
    "/{train}/train_bus_monitor/verdicts",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "train_bus_monitor",
    "people",
    "After each interpretation one row per car: length, impedance and attenuation, and whether "
    "they pass.",
    columns=("length_m", "impedance_ohm", "attenuation_db", "passed"),
)
BUS_TREND: Final = Topic(
    "/{train}/train_bus_monitor/trend",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "train_bus_monitor",
    "people",
    "The measurements so far that found a fault, one row each: when, where and how large.",
    columns=("time_s", "kind", "place_m", "size"),
)
BUS_STATE: Final = Topic(
    "/{train}/train_bus_monitor/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "train_bus_monitor",
    "people, the report",
    "What the monitor holds to be true after the tick: kind, place and size of a fault.",
    #: `kind` counts `rail_signals.train_bus.faults.KINDS` from 1, 0 is none; `level` is 0 for all
    #: is well, 1 for a fault that the bus still bears, 2 for a failed one.
    columns=(
        *("measurements", "interpretations", "level", "kind"),
        *("place_m", "place_std_m", "size", "growth_per_s"),
    ),
)
BUS_LINKS: Final = Topic(
    "/world/bus_medium/links",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "bus_medium",
    "the report",
    "The truth of each train's bus: how far its fault has grown, and the energy of a bit over "
    "the noise density at both ends.",
    columns=("grown", "ebn0_tail_db", "ebn0_head_db"),
)

#: In the order of the documentation.
TOPICS: Final[tuple[Topic, ...]] = (
    BUS_TX,
    BUS_RX,
    BUS_LINK,
    REFLECTOMETER_TX,
    REFLECTOMETER_RX,
    BUS_TRACE,
    BUS_VERDICTS,
    BUS_TREND,
    BUS_STATE,
    BUS_LINKS,
)
