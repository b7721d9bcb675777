"""The brakes of a train, and its wheels on the rail: what they give, and how it builds up.

The force of a brake rises linearly from nothing to all of it within the build-up time of the
vehicle. Neither brake nor motors can do more than the rail bears: of an adhesion ``mu`` the
acceleration ``mu g`` (of the effective mass) is left. What is demanded beyond it turns the wheels
alone: with the share ``f - 1`` of the mass that rotates they lose (f - 1) dw/dt = D - A, until the
wheel-slide protection holds them at a part of the train's speed.
"""

from __future__ import annotations

from math import inf

from .vehicle import Vehicle

#: Creep at which wheel-slide and wheel-spin protection hold the wheels, over the train's speed.
HELD_CREEP = 0.25
#: Wheels that spin at a stand are held there [m/s].
_HELD_SPIN_MPS = 1.0
_LEAST_ROTATING_SHARE = 1e-3


class Brakes:
    """Brake effort of one train, as deceleration of its effective mass.

    Parameters
    ----------
    vehicle : Vehicle

    Attributes
    ----------
    service_factor, emergency_factor : float
        What is left of each brake, 1 without a fault.
    adhesion : float
        Of wheels on rail; infinite where it is no matter.
    effort_mps2 : float
        What acts now.
    creep_mps : float
        By how much the rims of the wheels are faster than the train.
    """

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self.service_factor = self.emergency_factor = 1.0
        self.adhesion = inf
        self.effort_mps2 = 0.0
        self.creep_mps = 0.0

    @property
    def bears_mps2(self) -> float:
        """The most acceleration that the rail bears, either way."""
        return self.adhesion * self._vehicle.gravity_mps2

    def full_mps2(self, emergency: bool = False) -> float:
        """What a brake gives in the end, adhesion not counted."""
        if emergency:
            return self.emergency_factor * self._vehicle.emergency_brake_mps2
        return self.service_factor * self._vehicle.service_brake_mps2

    def built_up_mps2(self, dt_s: float, emergency: bool = False) -> float:
        """What a brake that is demanded will give at the end of a step, adhesion not counted."""
        full = self.full_mps2(emergency)
        build_up_s = self._vehicle.brake_build_up_s
        if build_up_s <= dt_s:
            return full
        return min(full, self.effort_mps2 + full * dt_s / build_up_s)

    def building_up_mps2(self, dt_s: float, emergency: bool = False) -> float:
        """Mean of what a brake that is demanded gives within a step."""
        after = self.built_up_mps2(dt_s, emergency)
        ramps = self._vehicle.brake_build_up_s > dt_s
        return 0.5 * (min(self.effort_mps2, after) + after) if ramps else after

    def turn_wheels(self, speed_mps: float, demand_mps2: float, dt_s: float) -> None:
        """Creep of the wheels at the end of a step.

        Parameters
        ----------
        speed_mps : float
            Of the train at the end of the step.
        demand_mps2 : float
            What motors (positive) or brakes (negative) were asked for.
        dt_s : float
        """
        bears = self.bears_mps2
        change = dt_s / max(self._vehicle.rotating_share, _LEAST_ROTATING_SHARE)
        if demand_mps2 < -bears:
            turned = self.creep_mps + (demand_mps2 + bears) * change
            self.creep_mps = max(turned, -HELD_CREEP * speed_mps)
        elif demand_mps2 > bears:
            turned = self.creep_mps + (demand_mps2 - bears) * change
            self.creep_mps = min(turned, max(HELD_CREEP * speed_mps, _HELD_SPIN_MPS))
        elif self.creep_mps != 0.0:  # the rail takes them along again
            caught = (bears - abs(demand_mps2)) * change
            self.creep_mps -= max(-caught, min(caught, self.creep_mps))
        if speed_mps == 0.0 and self.creep_mps < 0.0:
            self.creep_mps = 0.0
