"""The train bus."""

from __future__ import annotations

from typing import Final

from std_msgs.msg import Float64MultiArray

from rail_msgs_py.table import Table
from rail_msgs_py.waveform import Waveform

from .column import Column
from .qos import ESTIMATE, STREAM
from .topic import Topic

#: As `rail_signals.train_bus.faults.KINDS`, counted from 1.
_KINDS: Final = (
    "1 open, 2 short, 3 water ingress, 4 bad splice, 5 wrong cable, 6 missing shield ground, "
    "7 loose connector"
)
#: As `rail_signals.train_bus.fault_words.size_of`.
_SIZE: Final = (
    "ohms of a short, a bad splice or a loose connector; change of capacitance (water ingress) or "
    "of impedance (wrong cable, missing shield ground) as a fraction; NaN of an open"
)

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
    "atp, people, the report",
    "Counts of frames and bits after the tick, the measured margin, and at the head whether the "
    "end of the train is confirmed.",
    table=(
        Column("sent", "number of frames sent since the terminal was started"),
        Column("received", "number of frames of the other end understood since then"),
        Column("lost", "number of ticks since then in which none was understood"),
        Column("bits", "number of bits received since then whose value was known beforehand"),
        Column("bit_errors", "number of those that were wrong"),
        Column(
            "ebn0_db",
            "energy of a bit over the noise density, as measured in the tick; NaN if it cannot be",
        ),
        Column(
            "other_end",
            "1 if the other end is known to be there, its last word being no older than the "
            "time-out; else 0",
        ),
        Column(
            "other_end_age_s",
            "age of the last word of the other end, infinite before the first",
        ),
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
    table=(
        Column("length_m", "electrical length of the car's cable, NaN if it was not seen"),
        Column(
            "impedance_ohm",
            "characteristic impedance of the car's cable, NaN if it was not seen",
        ),
        Column(
            "attenuation_db",
            "of a wave that passes the car, infinite if none does, NaN if it was not seen",
        ),
        Column(
            "passed",
            "1 if the car's cable passes the criteria of its profile, 0 if it fails or was not "
            "seen",
        ),
    ),
)
BUS_TREND: Final = Topic(
    "/{train}/train_bus_monitor/trend",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "train_bus_monitor",
    "people",
    "The last 64 measurements that found a fault, one row each: when, where and how large.",
    table=(
        Column("time_s", "simulated time of the measurement"),
        Column("kind", f"of the fault: {_KINDS}"),
        Column("place_m", "of the fault, along the cable from the head"),
        Column("size", f"of the fault: {_SIZE}"),
    ),
)
BUS_STATE: Final = Topic(
    "/{train}/train_bus_monitor/state",
    Float64MultiArray,
    ESTIMATE,
    Table,
    "train_bus_monitor",
    "people, the report",
    "What the monitor holds to be true after the tick: kind, place and size of a fault.",
    table=(
        Column("measurements", "number of measurements since the monitor was started"),
        Column(
            "interpretations",
            "number of those that were interpreted, as they differed from the last that was or "
            "that one was in doubt",
        ),
        Column(
            "level",
            "0 all is well, 1 a fault that the criteria of the profiles bear, 2 a cable that fails "
            "them",
        ),
        Column("kind", f"of the fault that is held to be there: 0 none, {_KINDS}"),
        Column("place_m", "of that fault, along the cable from the head; NaN without one"),
        Column("place_std_m", "standard deviation of the place, NaN without a fault"),
        Column("size", f"of that fault: {_SIZE}, or without a fault"),
        Column("growth_per_s", "of the size, in its unit; NaN until it can be told"),
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
    table=(
        Column("grown", "fraction of its full size that the fault has, 0 where there is none"),
        Column(
            "ebn0_tail_db",
            "energy of a bit from the head over the noise density, at the tail; NaN if none was "
            "sent",
        ),
        Column(
            "ebn0_head_db",
            "energy of a bit from the tail over the noise density, at the head; NaN if none was "
            "sent",
        ),
    ),
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
