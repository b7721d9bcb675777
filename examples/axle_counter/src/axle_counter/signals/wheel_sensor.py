"""A wheel sensor: two coils along the rail, each damped by a wheel that passes over it.

A coil is driven at a constant frequency, and the amplitude of its voltage is sampled. A wheel
whose centre is ``u`` from the coil takes away

    dip(u) = depth * (1 + cos(2 pi u / L)) / 2      for |u| < L / 2, else 0

so the width of the dip at a fraction ``p`` of its depth is ``2 h(p)``, with

    h(p) = L / (2 pi) * arccos(2 p - 1)

The amplitude depends on where the wheel is, not on how fast it moves: there is no least speed, and
a wheel that stands on the sensor is seen for as long as it stands.

| symbol | meaning | unit |
|---|---|---|
| u | from the coil to the wheel, along the rail | m |
| L | travel over which a wheel damps a coil | m |
| d | spacing of the coils, which lie at -d/2 and +d/2 | m |
| p, q | fraction of the depth that switches a coil on, and off again (q < p) | 1 |

A wheel that passes forward switches: coil 1 on, coil 2 on, coil 1 off, coil 2 off. The travel
between these events is ``d``, ``h(p) + h(q) - d`` and ``d``: the middle one, in which both are
on, must be above zero, and one sample at least must fall into each.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray
from scipy.stats import norm


@dataclass(frozen=True)
class WheelSensor:
    """Dimensions and thresholds of a wheel sensor; typical magnitudes, assumed here.

    Parameters
    ----------
    coil_spacing_m : float
        Between the centres of the two coils [m].
    pulse_m : float
        Travel over which a wheel damps a coil [m].
    rest_v : float
        Amplitude of an undamped coil [V].
    depth_v : float
        What a wheel above the coil takes from it [V].
    threshold, release : float
        Fraction of the depth that switches a coil on, and off again.

    Raises
    ------
    ValueError
        If the thresholds are not in order, or the coils are never on together.

    Examples
    --------
    >>> sensor = WheelSensor()
    >>> round(sensor.overlap_m, 4)
    0.0503
    >>> round(sensor.least_sample_rate_hz(300.0 / 3.6))
    1658
    """

    coil_spacing_m: float = 0.15
    pulse_m: float = 0.3
    rest_v: float = 1.0
    depth_v: float = 0.5
    threshold: float = 0.3
    release: float = 0.2

    def __post_init__(self) -> None:
        if not 0.0 < self.release < self.threshold < 1.0:
            raise ValueError(
                f"release: {self.release:g} is not between 0 and the threshold, {self.threshold:g}"
            )
        if not 0.0 < self.depth_v < self.rest_v:
            raise ValueError(f"depth_v: {self.depth_v:g} is not between 0 and {self.rest_v:g} V")
        if self.overlap_m <= 0.0:
            raise ValueError(
                f"coil_spacing_m: {self.coil_spacing_m:g} is too far: a wheel never damps both"
            )

    @property
    def coils_m(self) -> tuple[float, float]:
        """Places of the two coils, from the middle of the sensor [m]."""
        return -0.5 * self.coil_spacing_m, 0.5 * self.coil_spacing_m

    def dip_v(self, u_m: npt.ArrayLike, half_length_m: float = 0.0) -> NDArray[np.float64]:
        """What a body above a coil takes from its amplitude [V], [...].

        Parameters
        ----------
        u_m : array_like [...]
            From the coil to the middle of the body [m].
        half_length_m : float
            Half the length of a body that is not round [m].
        """
        beyond = np.maximum(np.abs(np.asarray(u_m, dtype=np.float64)) - half_length_m, 0.0)
        shape = 0.5 * self.depth_v * (1.0 + np.cos(2.0 * np.pi * beyond / self.pulse_m))
        dip: NDArray[np.float64] = np.where(2.0 * beyond < self.pulse_m, shape, 0.0)
        return dip

    def half_width_m(self, fraction: float) -> float:
        """From the middle of the dip to where it has a fraction of its depth [m]."""
        return self.pulse_m / (2.0 * math.pi) * math.acos(2.0 * fraction - 1.0)

    @property
    def overlap_m(self) -> float:
        """Travel during which both coils are on [m]."""
        both = self.half_width_m(self.threshold) + self.half_width_m(self.release)
        return both - self.coil_spacing_m

    @property
    def shortest_m(self) -> float:
        """Travel between the two events that follow each other most closely [m]."""
        return min(self.coil_spacing_m, self.overlap_m)

    @property
    def approach_m(self) -> float:
        """From the middle of the sensor to where an approaching wheel switches it on [m]."""
        return 0.5 * self.coil_spacing_m + self.half_width_m(self.threshold)

    @property
    def clear_m(self) -> float:
        """From the middle of the sensor to where a wheel that leaves has been counted [m]."""
        return 0.5 * self.coil_spacing_m + self.half_width_m(self.release)

    @property
    def least_axle_distance_m(self) -> float:
        """Axles closer than this are one to the sensor [m]."""
        return self.approach_m + self.clear_m

    def least_sample_rate_hz(self, speed_mps: float) -> float:
        """Sample rate at which no event of a wheel falls between two samples [Hz]."""
        return speed_mps / self.shortest_m

    def top_speed_mps(self, sample_rate_hz: float, axle_distance_m: float = math.inf) -> float:
        """Speed up to which direction and number of axles are told without error [m/s].

        Parameters
        ----------
        sample_rate_hz : float
        axle_distance_m : float
            Between axles that follow each other [m].
        """
        apart_m = axle_distance_m - self.least_axle_distance_m
        return sample_rate_hz * max(min(self.shortest_m, apart_m), 0.0)

    def false_alarm_rate_hz(self, noise_v: float, sample_rate_hz: float) -> float:
        """How often noise alone switches a coil on [1/s].

        White Gaussian samples of standard deviation ``noise_v`` exceed the threshold with the
        probability Q(p * depth / noise) each. A false *axle* needs four such events, two of them
        in each coil, in the order of a passage; this rate bounds it from above.
        """
        if noise_v <= 0.0:
            return 0.0
        return float(sample_rate_hz * norm.sf(self.threshold * self.depth_v / noise_v))
