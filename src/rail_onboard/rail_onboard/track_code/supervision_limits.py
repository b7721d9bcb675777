"""What supervision counts on: its thresholds, and what takes time."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

TRIP_SPEEDS_300_KMH = (
    *((0.0, 35.0), (80.0, 90.0), (160.0, 170.0)),
    *((220.0, 235.0), (270.0, 285.0), (300.0, 315.0)),
)
"""Speed allowed and speed that trips the emergency brake, of the 300 km/h family."""


@dataclass(frozen=True)
class Thresholds:
    """When to warn, to brake and to release, against the permitted speed [m/s].

    Parameters
    ----------
    warn_over_mps, service_over_mps, emergency_over_mps : float
        Excess that makes each of them act, rising.
    release_under_mps : float
        The brake is released that far below the permitted speed, or at half of it.
    trip_kmh : tuple of (float, float)
        Permitted speed and speed that trips the emergency brake [km/h], rising; linear between
        them; empty = ``emergency_over_mps`` everywhere.
    """

    warn_over_mps: float = 0.2
    service_over_mps: float = 0.7
    emergency_over_mps: float = 2.0
    release_under_mps: float = 0.5
    trip_kmh: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        rising = (0.0, self.warn_over_mps, self.service_over_mps, self.emergency_over_mps, inf)
        if list(rising) != sorted(rising) or not self.release_under_mps >= 0.0:
            raise ValueError(f"thresholds: {rising[1:4]} do not rise from 0")
        flat = [speed for pair in self.trip_kmh for speed in pair]
        if flat[::2] != sorted(set(flat[::2])) or any(t < s for s, t in self.trip_kmh):
            raise ValueError(f"trip_kmh: {self.trip_kmh} do not rise")

    def emergency_mps(self, permitted_mps: float) -> float:
        """Speed that trips the emergency brake."""
        if not self.trip_kmh:
            return permitted_mps + self.emergency_over_mps
        speed_kmh = 3.6 * permitted_mps
        speeds = [speed for speed, _ in self.trip_kmh]
        trips = [trip for _, trip in self.trip_kmh]
        above_kmh = max(0.0, speed_kmh - speeds[-1])
        trip_kmh = float(np.interp(speed_kmh, speeds, trips)) + above_kmh
        return trip_kmh / 3.6


@dataclass(frozen=True)
class Delays:
    """What takes time, at the worst.

    Parameters
    ----------
    window_s, confirmation_s : float
        Of the receiver; together its response time, after which no code is no excuse.
    notice_s : float
        By how much a change of carrier is noticed late.
    brake_s : float
        From a demand until the brake has its full force, the time of a tick included.
    traction_mps2 : float
        Acceleration that may go on until then, on level track.
    """

    window_s: float = 1.5625
    confirmation_s: float = 1.0
    notice_s: float = 0.3
    brake_s: float = 1.0
    traction_mps2: float = 0.5

    def __post_init__(self) -> None:
        values = (self.window_s, self.confirmation_s, self.notice_s, self.brake_s)
        if not min(*values, self.traction_mps2) >= 0.0:
            raise ValueError(f"delays: {values}, {self.traction_mps2}: must not be negative")

    @property
    def response_s(self) -> float:
        """Response time of the receiver."""
        return self.window_s + self.confirmation_s
