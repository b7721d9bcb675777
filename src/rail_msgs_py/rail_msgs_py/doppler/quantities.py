"""Quantities of positions by Doppler shifts: tones, stations, links, oscillators."""

from __future__ import annotations

import math
from typing import Final

from rail_msgs_py.quantity import NEEDED, Quantity

OFFSET: Final = Quantity(20.0, "off the track, sides in turn", unit="m", low=1.0, high=1000.0)
HEIGHT: Final = Quantity(6.0, "above the antenna", unit="m", low=0.0, high=100.0)
LEAST_DISTANCE: Final = OFFSET.but(
    default=math.hypot(OFFSET.default, HEIGHT.default),
    text="least distance of a station from a train's antenna",
    high=math.hypot(OFFSET.high, HEIGHT.high),
)

CARRIER: Final = Quantity(2.6e9, "middle of the tones", unit="Hz", low=1e7, high=1e11)
SAMPLE_RATE: Final = Quantity(64e3, "complex samples per second", unit="Hz", low=1.0, high=1e9)
SAMPLES: Final = Quantity(2048, "samples of a block, a power of 2", low=512, high=65_536)
SLOTS: Final = Quantity(10, "tones in turn along the tracks", low=2, high=1000)
SLOT: Final = SLOTS.but(default=0, text="frequency slot of its tone", low=0, high=SLOTS.high - 1)
SLOT_SPACING: Final = Quantity(6e3, "from tone to tone", unit="Hz", low=1.0, high=1e9)
FASTEST: Final = Quantity(
    500.0, "speed that receivers search up to", unit="km/h", low=10.0, high=600.0
)
MAX_SPEED: Final = FASTEST.derived(
    lambda kmh: kmh / 3.6, "speed that receivers search up to", unit="m/s"
)

POWER: Final = Quantity(10.0, "radiated power of a station", unit="dBm", low=-150.0, high=60.0)
NOISE_FIGURE: Final = Quantity(8.0, "noise figure of the receivers", unit="dB", low=0.0, high=30.0)
PATH_LOSS_EXPONENT: Final = Quantity(2.0, "2 = free space; counts from 1 m", low=1.5, high=6.0)
EXTRA_LOSS: Final = Quantity(
    0.0, "taken from every link, for sweeps", unit="dB", low=-60.0, high=120.0
)

RECEIVER_OFFSET: Final = Quantity(
    0.5, "largest offset of a train's oscillator", unit="ppm", low=0.0, high=2.0
)
STATION_OFFSET: Final = Quantity(
    0.01, "standard deviation of a station's oscillator", unit="ppb", low=0.0, high=100.0
)
STATION_OFFSET_HZ: Final = STATION_OFFSET.derived(
    lambda ppb: 1e-9 * ppb * CARRIER.default,
    "standard deviation of a station's oscillator",
    unit="Hz",
).but(high=1e-9 * STATION_OFFSET.high * CARRIER.high)
#: Random walk that a positioner counts on of its own oscillator.
RECEIVER_WALK: Final = Quantity(
    0.5, "random walk of the own oscillator after a second", unit="Hz", low=0.0, high=1e3
)
DETUNING: Final = Quantity(
    NEEDED, "how far the oscillator is off", unit="Hz", low=-2000.0, high=2000.0
)
