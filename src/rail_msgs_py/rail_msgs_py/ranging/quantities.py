"""Quantities of phase ranging: signal, channels, powers, antennas, transponders."""

from __future__ import annotations

from math import inf
from typing import Final, Literal, get_args

from rail_msgs_py.quantity import NEEDED, Quantity

TONE: Final = Quantity(375e3, "ranging tone", unit="Hz", low=1.0, high=1e9)
DEVIATION: Final = Quantity(375e3, "peak FM deviation", unit="Hz", low=1.0, high=1e9)
TONES: Final = TONE.array("ranging tones, highest first; one or two")
DEVIATIONS: Final = DEVIATION.array("peak FM deviation of each tone")
SAMPLE_RATE: Final = Quantity(4e6, "complex sample rate", unit="Hz", low=1.0, high=1e9)
SAMPLES: Final = Quantity(960, "samples of a burst: whole periods of the tones", low=8, high=32_768)
Comparator = Literal["quadrature", "and", "two_tone"]
COMPARATOR: Final[Quantity[Comparator]] = Quantity(
    "quadrature",
    "phase comparator; and: 0...180 degrees, as in the paper; quadrature, two_tone: 0...360",
    choices=get_args(Comparator),
)

CHANNEL: Final = Quantity(NEEDED, "number of a radio channel", low=1, high=99)
MAIN_PAIRS: Final[Quantity[tuple[tuple[int, int], ...]]] = CHANNEL.but(
    default=((1, 2), (3, 4)), text="pairs in turn along a main track"
)
FIRST_CARRIER: Final = Quantity(2.4e9, "carrier of channel 1", unit="Hz", low=1e7, high=1e11)
CARRIER_SPACING: Final = Quantity(5e6, "distance of two carriers", unit="Hz", low=1.0, high=1e9)


def carrier_hz(
    channel: int,
    first_hz: float = FIRST_CARRIER.default,
    spacing_hz: float = CARRIER_SPACING.default,
) -> float:
    """Carrier of a channel [Hz]."""
    return first_hz + (channel - 1) * spacing_hz


DOWNLINKS: Final[Quantity[tuple[int, ...]]] = MAIN_PAIRS.but(
    default=tuple(downlink for downlink, _ in MAIN_PAIRS.default), text="channels it hears"
)
UPLINKS: Final[Quantity[tuple[int, ...]]] = MAIN_PAIRS.but(
    default=tuple(uplink for _, uplink in MAIN_PAIRS.default), text="the channel paired with each"
)
UPLINK_CARRIERS: Final[Quantity[tuple[float, ...]]] = FIRST_CARRIER.but(
    default=tuple(carrier_hz(channel) for channel in UPLINKS.default),
    text="carrier of each uplink channel",
    low=0.0,
    high=inf,
)
#: A station that looks into one zone, the first.
STATION_DOWNLINKS: Final = DOWNLINKS.but(
    default=DOWNLINKS.default[:1], text="channel it sends on, per zone"
)
STATION_UPLINKS: Final = UPLINKS.but(
    default=UPLINKS.default[:1], text="channel it hears on, per zone"
)
STATION_CARRIERS: Final = UPLINK_CARRIERS.but(
    default=(carrier_hz(DOWNLINKS.default[0]),), text="carrier of the downlink channel, per zone"
)

WRS_POWER: Final = Quantity(-10.0, "transmit power of a station", unit="dBm", low=-150.0, high=60.0)
VRS_POWER: Final = Quantity(-10.0, "transmit power of a train", unit="dBm", low=-150.0, high=60.0)
NOISE_FIGURE: Final = Quantity(8.0, "noise figure of the receivers", unit="dB", low=0.0, high=30.0)
RECEIVER_NOISE: Final = Quantity(
    -100.0, "receiver noise expected in the bandwidth", unit="dBm", low=-150.0, high=0.0
)
PATH_LOSS_EXPONENT: Final = Quantity(2.0, "2 = free space; counts from 1 m", low=1.5, high=6.0)
OSCILLATOR: Final = Quantity(
    0.1, "standard deviation of each oscillator", unit="ppm", low=0.0, high=1.0
)
JAMMER_POWER: Final = Quantity(0.0, "power of the jammer", unit="dBm", low=-150.0, high=60.0)

GAIN: Final = Quantity(NEEDED, "antenna on its axis", unit="dBi", low=-20.0, high=40.0)
WRS_GAIN: Final = GAIN.but(default=12.0, text="station antenna on its axis")
VRS_GAIN: Final = GAIN.but(default=6.0, text="train antenna on its axis")
BEAMWIDTH: Final = Quantity(
    NEEDED, "antenna, between -3 dB points", unit="deg", low=5.0, high=180.0
)
WRS_BEAMWIDTH: Final = BEAMWIDTH.but(default=60.0, text="station antenna, between -3 dB points")
VRS_BEAMWIDTH: Final = BEAMWIDTH.but(default=60.0, text="train antenna, between -3 dB points")
FRONT_TO_BACK: Final = Quantity(30.0, "antennas, axis to back", unit="dB", low=0.0, high=60.0)

#: Of the fleet, to which the bench trims every unit.
TRANSPONDER_DELAY: Final = Quantity(
    1e-6, "nominal delay of the transponders", unit="s", low=0.0, high=1e-4
)
#: Units differ from the fleet: theirs may be past its bounds.
UNIT_DELAY: Final = TRANSPONDER_DELAY.but(
    text="delay of this unit from reception to transmission", high=1e-3
)
