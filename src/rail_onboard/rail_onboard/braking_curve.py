"""Guaranteed braking, as closed forms of the speed and of the distance.

A train measured at v gathers ``a`` for the dead time ``T`` until its brakes act, then comes down
to the speed e with the deceleration b:

    D(v, e) = V T + a T^2 / 2 + (w^2 - e^2) / (2 b),    w = V + a T,  V = (1 + x) v

with x the error of the measured speed. Solved for the speed,

    w = -b T + sqrt((b T)^2 + e^2 + 2 b D + a b T^2),    v = (w - a T) / (1 + x),

the form of ``code_supervision``. The steepest fall on the way takes its part from b and adds to a.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, sqrt

from rail_signals.track_code.scales import GRAVITY_MPS2, LEAST_BRAKING_MPS2, deceleration_mps2


@dataclass(frozen=True)
class GuaranteedBraking:
    """What a train's brakes do at the worst.

    Parameters
    ----------
    service_mps2, emergency_mps2 : float
        Guaranteed brake rate on level track (IEEE 1474.1); the emergency brake is no weaker.
    fall_permil : float
        Steepest fall on which the train runs, not negative.
    delay_s : float
        From a measurement of the speed that gives no cause for the brake until the brake, which
        the next one demands, has its full force: the time from measurement to measurement, from
        there to the command in force, and that of the brake.
    traction_mps2 : float
        Acceleration that may go on until then, on level track.
    speed_error : float
        By how much the true speed may exceed the measured one, relative to that.

    Raises
    ------
    ValueError
        If a parameter is out of range, or the fall leaves too little of the service brake.

    Examples
    --------
    >>> braking = GuaranteedBraking(service_mps2=0.5, delay_s=1.0, traction_mps2=0.0)
    >>> braking.stopping_m(20.0)
    420.0
    >>> braking.speed_mps(420.0)
    20.0
    """

    service_mps2: float = 0.7
    emergency_mps2: float = 0.9
    fall_permil: float = 0.0
    delay_s: float = 1.0
    traction_mps2: float = 0.5
    speed_error: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 < self.service_mps2 < inf:
            raise ValueError(f"service_mps2: {self.service_mps2} is not above zero")
        if not self.service_mps2 <= self.emergency_mps2 < inf:
            raise ValueError(f"emergency_mps2: {self.emergency_mps2} is weaker than service_mps2")
        for name in ("fall_permil", "delay_s", "traction_mps2"):
            value = getattr(self, name)
            if not 0.0 <= value < inf:
                raise ValueError(f"{name}: {value} is negative or not finite")
        if not 0.0 <= self.speed_error < 1.0:
            raise ValueError(f"speed_error: {self.speed_error} is not from 0 to below 1")
        if not self.service_deceleration_mps2 >= LEAST_BRAKING_MPS2:
            raise ValueError(f"fall_permil: {self.fall_permil} leaves too little of the brake")

    @property
    def service_deceleration_mps2(self) -> float:
        """Deceleration b by the service brake on the fall."""
        return deceleration_mps2(self.service_mps2, -self.fall_permil)

    @property
    def emergency_deceleration_mps2(self) -> float:
        """Deceleration by the emergency brake on the fall."""
        return deceleration_mps2(self.emergency_mps2, -self.fall_permil)

    @property
    def gathering_mps2(self) -> float:
        """Acceleration a during the dead time on the fall."""
        return self.traction_mps2 + GRAVITY_MPS2 * 1e-3 * self.fall_permil

    def stopping_m(self, speed_mps: float, *, emergency: bool = False) -> float:
        """Way D(v, 0) from a measured speed to a stand."""
        b = self.emergency_deceleration_mps2 if emergency else self.service_deceleration_mps2
        a, t, v = self.gathering_mps2, self.delay_s, (1.0 + self.speed_error) * speed_mps
        return (v + 0.5 * a * t) * t + (v + a * t) ** 2 / (2.0 * b)

    def speed_mps(self, distance_m: float, end_mps: float = 0.0) -> float:
        """Measured speed from which the service brake leaves ``end_mps`` after a way, D(v, e).

        Negative where no speed is low enough.
        """
        b, a, t = self.service_deceleration_mps2, self.gathering_mps2, self.delay_s
        square = (b * t) ** 2 + end_mps**2 + 2.0 * b * max(0.0, distance_m) + a * b * t**2
        return (sqrt(square) - b * t - a * t) / (1.0 + self.speed_error)
