"""Quantities of track codes: carriers, rails, noise, and the braking that codes count on."""

from __future__ import annotations

from typing import Final

from rail_msgs_py.quantity import Quantity
from rail_signals.track_code.scales import IDENTITIES, SPEEDS_KMH

#: Profile whose fields the supervision of trains understands.
PROFILE: Final = Quantity("tones27", "profile of the code")
CARRIERS: Final = Quantity(
    (1700.0, 2300.0), "carriers in turn along a track", unit="Hz", low=1.0, high=1e9
)
CARRIER: Final = CARRIERS.but(default=CARRIERS.default[0], text="carrier of the circuit")
IDENTITY: Final = Quantity(
    IDENTITIES[0], "identity of the circuit, in turn along a track", choices=IDENTITIES
)
SPEEDS: Final = Quantity(
    SPEEDS_KMH, "the 16 speeds that codes of this line can tell", unit="km/h", low=0.0, high=600.0
)
SAMPLE_RATE: Final = Quantity(
    16_000.0, "sample rate in the rails; a multiple of 128 Hz", unit="Hz", low=1.0, high=1e9
)
LENGTH: Final = Quantity(500.0, "no circuit is longer than this", unit="m", low=50.0, high=3000.0)
#: Circuits divide a track evenly: the last may be shorter than any that one would plan.
LENGTHS: Final = LENGTH.array("lengths of the circuit and of those ahead").but(low=0.0)
BRAKING: Final = Quantity(
    0.5, "service braking that the codes count on", unit="m/s^2", low=0.1, high=2.0
)

ATTENUATION: Final = Quantity(6.0, "loss of the rails", unit="dB/km", low=0.0, high=100.0)
JOINT_LOSS: Final = Quantity(
    30.0, "crosstalk past a joint, below the signal", unit="dB", low=0.0, high=120.0
)
IMPULSE_RATE: Final = Quantity(
    0.2, "impulses of noise, of the transmitter's level", unit="1/s", low=0.0, high=1000.0
)
SANDING_LOSS: Final = Quantity(60.0, "pick-up lost", unit="dB", low=0.0, high=200.0)
BALLAST: Final = Quantity(
    2.0, "leakage resistance of the ballast", unit="ohm km", low=0.1, high=1000.0
)
SHUNT: Final = Quantity(
    10.0, "resistance of all axles of the train from rail to rail", unit="ohm", low=1e-4, high=1e4
)
JOINT_LEFT: Final = JOINT_LOSS.but(default=0.0, text="loss past the joint that is left")
BREAK_LOSS: Final = Quantity(40.0, "loss past the break", unit="dB", low=0.0, high=200.0)
