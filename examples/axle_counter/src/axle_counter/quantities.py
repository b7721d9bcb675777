"""Quantities of axle counters that a scenario sets and media and nodes work with: declared once."""

from __future__ import annotations

from typing import Final, Literal

from axle_counter.signals.axles import Cars
from axle_counter.signals.wheel_sensor import WheelSensor
from rail_msgs_py.quantity import Quantity

_SENSOR, _CARS = WheelSensor(), Cars()

COIL_SPACING: Final = Quantity(
    _SENSOR.coil_spacing_m, "between the two coils", unit="m", low=0.01, high=1.0
)
PULSE: Final = Quantity(
    _SENSOR.pulse_m, "travel over which a wheel damps a coil", unit="m", low=0.01, high=1.0
)
THRESHOLD: Final = Quantity(
    _SENSOR.threshold,
    "fraction of the damping by a wheel that switches a coil on",
    low=0.01,
    high=0.99,
)
RELEASE: Final = Quantity(
    _SENSOR.release,
    "fraction of the damping by a wheel that switches it off again",
    low=0.01,
    high=0.99,
)
REST: Final = Quantity(
    _SENSOR.rest_v, "amplitude of an undamped coil", unit="V", low=1e-3, high=1e3
)
DEPTH: Final = Quantity(_SENSOR.depth_v, "what a wheel takes from it", unit="V", low=1e-3, high=1e3)
SAMPLE_RATE: Final = Quantity(8000.0, "sample rate of the amplitudes", unit="Hz", low=1.0, high=1e9)
NOISE: Final = Quantity(
    0.005,
    "standard deviation of a sample, where a coil at rest has 1 V",
    unit="V",
    low=0.0,
    high=1.0,
)
CAR_LENGTH: Final = Quantity(
    _CARS.length_m, "length of the cars, about", unit="m", low=5.0, high=50.0
)
WHEELBASE: Final = Quantity(
    _CARS.wheelbase_m, "of a bogie, first to last axle", unit="m", low=1.0, high=5.0
)
RESET: Final[Quantity[Literal["sweep", "conditional"]]] = Quantity(
    "sweep",
    "what a reset makes of a section: free once a train has swept it, or at once",
    choices=("sweep", "conditional"),
)
EVERY: Final = Quantity(3, "the axle of a train that is missed, and each so many", low=1, high=1000)
LEFT: Final = Quantity(0.1, "what is left of the damping by such an axle", low=0.0, high=1.0)
MAGNET_LENGTH: Final = Quantity(1.0, "of a magnet", unit="m", low=0.1, high=2.0)
