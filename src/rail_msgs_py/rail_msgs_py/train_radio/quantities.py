"""Quantities of train control by radio: bursts, carriers, powers, braking, margins, threats."""

from __future__ import annotations

from math import inf
from typing import Final, Literal, get_args

from rail_msgs_py.quantity import NEEDED, Quantity

Scheme = Literal["siso", "mrc", "alamouti_2x1", "alamouti_2x2"]
SCHEME: Final[Quantity[Scheme]] = Quantity(
    "alamouti_2x2",
    "antennas and code (An et al., eqs 1 to 9)",
    choices=get_args(Scheme),
)
Constellation = Literal["bpsk", "qpsk", "16qam"]
CONSTELLATION: Final[Quantity[Constellation]] = Quantity(
    "qpsk", "symbols of the bursts", choices=get_args(Constellation)
)
SYMBOL_RATE: Final = Quantity(100e3, "symbols per second", unit="Hz", low=1.0, high=1e9)
SAMPLES_PER_SYMBOL: Final = Quantity(2, "complex samples per symbol", low=2, high=16)
PILOT_PERIOD: Final = Quantity(16, "data symbols from pilots to pilots", low=1, high=1024)

CHANNELS: Final = Quantity(3, "channel pairs that base stations use in turn", low=2, high=8)
CARRIER: Final = Quantity(2.4e9, "downlink of channel 1", unit="Hz", low=1e7, high=1e11)
CARRIER_SPACING: Final = Quantity(1e6, "distance of two channels", unit="Hz", low=1.0, high=1e9)
DUPLEX_SPACING: Final = Quantity(50e6, "uplink above downlink", unit="Hz", low=1.0, high=1e9)

BASE_POWER: Final = Quantity(
    20.0,
    "transmit power of a base station, all antennas together",
    unit="dBm",
    low=-150.0,
    high=60.0,
)
TRAIN_POWER: Final = Quantity(
    20.0, "transmit power of a train, all antennas together", unit="dBm", low=-150.0, high=60.0
)
EXTRA_LOSS: Final = Quantity(
    0.0, "taken from every link, for sweeps", unit="dB", low=-60.0, high=120.0
)
SNR_OFFSET: Final = EXTRA_LOSS.derived(
    lambda loss_db: -loss_db, "added to every gain; negative = less margin"
)
PATH_LOSS_EXPONENT: Final = Quantity(2.5, "2 = free space; counts from 1 m", low=1.5, high=6.0)
NOISE_FIGURE: Final = Quantity(8.0, "noise figure of the receivers", unit="dB", low=0.0, high=30.0)
RICIAN_FACTOR: Final = Quantity(
    0.0, "line of sight over scattered power; 0 = Rayleigh", low=0.0, high=1000.0
)
ENTRY_LOSS: Final = Quantity(
    10.0, "loss of the walls, or of a portal", unit="dB", low=0.0, high=100.0
)
TUNNEL_LOSS: Final = Quantity(0.0, "loss within a tunnel", unit="dB/km", low=0.0, high=1000.0)
TUNNEL_LOSS_PER_M: Final = TUNNEL_LOSS.derived(
    lambda db_per_km: db_per_km / 1000.0, "loss within a tunnel", unit="dB/m"
)

BRAKING: Final = Quantity(0.7, "guaranteed service brake rate", unit="m/s^2", low=0.1, high=2.0)
EMERGENCY_BRAKING: Final = Quantity(
    0.9, "guaranteed emergency brake rate (GEBR)", unit="m/s^2", low=0.1, high=3.0
)
MARGIN: Final = Quantity(10.0, "kept behind a train ahead", unit="m", low=0.0, high=1000.0)
BUFFER: Final = Quantity(
    60.0, "from the end of a track to the buffer, the danger point", unit="m", low=0.0, high=1000.0
)
REPORT_PERIOD: Final = Quantity(
    0.5, "from location report to location report; at least a tick", unit="s", low=0.05, high=5.0
)
AUTHORITY_PERIOD: Final = Quantity(
    0.5, "from authority to authority of a train; at least a tick", unit="s", low=0.05, high=5.0
)
ATP_CYCLE: Final = Quantity(
    1.0,
    "from one measurement of the speed on board to the next, and from there to the command in "
    "force; at least a tick",
    unit="s",
    low=0.05,
    high=5.0,
)
BRAKE_CONFIDENCE: Final = Quantity(
    0.9,
    "guaranteed brake rate over that of a train in good order, on dry rails (Kdry)",
    low=0.1,
    high=1.0,
)
BRAKE_ADHESION: Final = Quantity(
    0.9, "brake rate on wet rails over that on dry ones (Kwet)", low=0.1, high=1.0
)
AUTHORITY_TIMEOUT: Final = Quantity(
    3.0, "age of an authority that makes a train brake", unit="s", low=0.5, high=60.0
)

ON_SIGHT: Final = Quantity(
    15.0 / 3.6, "speed permitted to a train on sight", unit="m/s", low=0.5, high=12.0
)

THREAT_RATE: Final = Quantity(
    NEEDED, "probability of each for a frame, either way", low=0.0, high=1.0
)
LONGEST_DELAY: Final = Quantity(
    3.0, "a delay is drawn evenly from 0 to this", unit="s", low=0.0, high=3600.0
)


def carrier_hz(
    channel: int, first_hz: float = CARRIER.default, spacing_hz: float = CARRIER_SPACING.default
) -> float:
    """Downlink carrier of a channel [Hz]."""
    return first_hz + (channel - 1) * spacing_hz


_CHANNELS: Final = tuple(range(1, CHANNELS.default + 1))
DOWNLINK_CHANNELS: Final[Quantity[tuple[int, ...]]] = CHANNELS.but(
    default=_CHANNELS, text="channels it hears", low=1, high=CHANNELS.high
)
DOWNLINK_CARRIER: Final = CARRIER.but(text="carrier it sends on", low=0.0, high=inf)
UPLINK_CARRIERS: Final[Quantity[tuple[float, ...]]] = CARRIER.but(
    default=tuple(carrier_hz(channel) + DUPLEX_SPACING.default for channel in _CHANNELS),
    text="carrier of the uplink paired with each",
    low=0.0,
    high=inf,
)
