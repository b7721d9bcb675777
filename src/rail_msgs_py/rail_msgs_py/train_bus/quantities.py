"""Quantities of the train bus: cable, frames, levels, reflectometer, faults that grow."""

from __future__ import annotations

from typing import Final, Literal, get_args

from rail_msgs_py.quantity import NEEDED, Quantity

CARS: Final[Quantity[tuple[str, ...]]] = Quantity(
    ("CM2", "CM3", "CM4", "CM3", "CM2"), "profile of the cable in each car, from the head"
)
BIT_RATE: Final = Quantity(1e6, "bits per second", unit="Hz", low=1.0, high=1e9)
SAMPLES_PER_BIT: Final = Quantity(8, "samples of a bit, an even number", low=4, high=64)
RISE_TIME: Final = Quantity(
    150e-9, "rise time of the drivers' edges, 10 to 90 %", unit="s", low=0.0, high=1e-3
)
LEVEL: Final = Quantity(
    4.0, "amplitude of the drivers, matched line", unit="V", low=0.0, high=100.0, low_open=True
)
NOISE: Final = Quantity(0.25, "rms of a sample at the receivers", unit="V", low=0.0, high=100.0)
ANSWER_TIMEOUT: Final = Quantity(
    2.0, "end of train not confirmed after this time", unit="s", low=0.1, high=60.0
)
PERIOD: Final = Quantity(30.0, "from one measurement to the next", unit="s", low=0.1, high=1e5)
TRACES: Final = Quantity(8, "traces of a measurement", low=1, high=64)
REFLECTOMETER_RISE: Final = Quantity(
    20e-9, "rise time of the reflectometer", unit="s", low=0.0, high=1e-6, low_open=True
)
REFLECTOMETER_NOISE: Final = Quantity(
    1e-3, "rms of a sample of a trace, as a reflection", low=0.0, high=0.1, low_open=True
)

GrowthLaw = Literal["linear", "exponential"]
GROWTH_LAW: Final[Quantity[GrowthLaw]] = Quantity(
    "exponential", "law of growth", choices=get_args(GrowthLaw)
)
FAULT_SIZE: Final = Quantity(
    NEEDED, "when it has grown, in the unit of its kind", low=0.0, high=1e6, low_open=True
)
FAULT_PLACE: Final = Quantity(
    NEEDED,
    "place along the cable from the head, where it is in a run",
    unit="m",
    low=0.0,
    high=1e4,
)
FAULT_CAR: Final = Quantity(
    NEEDED, "car of wrong_cable, missing_shield_ground; the head's is 1", low=1, high=100
)
FAULT_COUPLER: Final = Quantity(
    NEEDED, "coupler of loose_connector; 1 is behind the head's car", low=1, high=100
)
WET_LENGTH: Final = Quantity(
    5.0, "water_ingress: length that is wet", unit="m", low=0.0, high=1e3, low_open=True
)
WET_CONDUCTANCE: Final = Quantity(
    10.0, "water_ingress: of the wet insulation", unit="uS/m", low=0.0, high=1e3
)
CONTACT_SPREAD: Final = Quantity(
    0.2,
    "loose_connector: standard deviation of the logarithm of its resistance from one moment to"
    " the next",
    low=0.0,
    high=1.0,
)
NOISE_FACTOR: Final = Quantity(3.0, "missing_shield_ground: on the noise", low=1.0, high=100.0)
