"""What the wheels of a train count: pulses, an error of their diameter, and slip."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor, pi

import numpy as np

from rail_world.trains.description import VehicleDescription, WheelSlip


class Wheels:
    """Counts the way of one train.

    Parameters
    ----------
    error : float
        Relative error of their diameter.
    slips : sequence of WheelSlip
        When they slip; of several at once the first counts.
    pulse_m : float
        Distance that one pulse of the odometer stands for [m]; 0 = it counts without steps. Its
        speed is taken from the time between pulses, and has no steps.

    Examples
    --------
    >>> wheels = Wheels(0.0, [WheelSlip(train="a", from_s=1.0, to_s=2.0, ratio=0.5)])
    >>> wheels.count(0.5, 10.0, 20.0), wheels.count(1.0, 20.0, 20.0), wheels.count(2.0, 40.0, 20.0)
    ((10.0, 20.0), (15.0, 10.0), (35.0, 20.0))
    """

    def __init__(self, error: float, slips: Sequence[WheelSlip] = (), pulse_m: float = 0.0) -> None:
        self._pulse_m = pulse_m
        self._scale = 1.0 + error
        #: When they slip; may be exchanged for others on the way.
        self.slips = tuple(slips)
        self._travelled_m = self._lost_m = 0.0

    def count(self, time_s: float, travelled_m: float, speed_mps: float) -> tuple[float, float]:
        """Distance [m] and speed [m/s] that they show at the end of a tick of this true way."""
        ratio = next((s.ratio for s in self.slips if s.from_s <= time_s < s.to_s), 1.0)
        self._lost_m += (ratio - 1.0) * (travelled_m - self._travelled_m)
        self._travelled_m = travelled_m
        turned_m = self._scale * (travelled_m + self._lost_m)
        if self._pulse_m > 0.0:
            turned_m = floor(turned_m / self._pulse_m) * self._pulse_m
        return turned_m, self._scale * ratio * speed_mps


def pulse_m(vehicle: VehicleDescription) -> float:
    """Distance of one pulse of the odometer of a train set [m], 0 if it counts without steps."""
    pulses = vehicle.odometer_pulses
    return pi * vehicle.wheel_diameter_m / pulses if pulses else 0.0


def wheel_errors(seed: int, sigma: float, trains: Sequence[str]) -> dict[str, float]:
    """Relative error of each train's odometer: that of the diameter of its wheels."""
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence([seed, 3])))
    return {train: sigma * float(rng.standard_normal()) for train in trains}
