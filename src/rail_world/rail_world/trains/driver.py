"""The driver: what speed to go, so that every limit and every stop is kept.

In the square of the speed a braking curve of constant deceleration is a straight line. The
permitted speed, squared, is therefore piecewise linear along the path, and one backward pass over
the sections of constant limit gives it exactly: a section with limit ``w`` that must be left with
at most ``e`` permits ``min(w, e + 2 b (end - s))``.

The speed for the end of the next step is chosen so that the train is *then*, not now, under the
curve, with the distance covered meanwhile counted; so no step ever ends above it.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from math import inf, sqrt

import numpy as np

from rail_world.errors import WorldDataError
from rail_world.line.profile import StepProfile
from rail_world.line.route import Route

from .description import SpeedRestriction, TrainDescription
from .vehicle import Extent, Vehicle

# The driver plans with this part of full service braking, unless slopes ask for less.
BRAKE_FRACTION = 0.8
_LEAST_BRAKING_MPS2 = 0.1


def limits_for_train(
    limits_mps: StepProfile, extent: Extent, *, length_m: float, cap_mps: float
) -> StepProfile:
    """Limit for the reference point so that no part of the train exceeds any limit.

    Parameters
    ----------
    limits_mps : StepProfile
        Limits of the line [m/s] over path distance [m].
    extent : Extent
        How far the train reaches to both sides of its reference point.
    length_m : float
        Length of the path [m].
    cap_mps : float
        Highest speed in any case [m/s].
    """
    starts = limits_mps.starts_m
    corners = np.concatenate((starts - extent.above_m, starts + extent.below_m))
    corners = np.unique(corners[(corners > 0.0) & (corners < length_m)])
    corners = np.concatenate(([0.0], corners))
    middles = 0.5 * (corners + np.append(corners[1:], length_m))
    first = np.searchsorted(starts, middles - extent.below_m, side="right") - 1
    last = np.searchsorted(starts, middles + extent.above_m, side="right")
    positions: list[float] = []
    values: list[float] = []
    for corner, i, j in zip(corners.tolist(), first.tolist(), last.tolist(), strict=True):
        limit = min(float(limits_mps.values[max(i, 0) : max(j, 1)].min()), cap_mps)
        if not values or limit != values[-1]:
            positions.append(corner)
            values.append(limit)
    return StepProfile(positions, values)


def restricted_limits(route: Route, restrictions: Sequence[SpeedRestriction]) -> StepProfile:
    """Limits along a route [m/s], with restrictions of its tracks."""
    limits_mps = route.limits_mps
    for each in restrictions:
        for leg in route.legs:
            to_m = min(each.to_m, leg.end_m)
            if leg.track.name == each.track and each.from_m < to_m:
                ends_m = leg.path_start_m + each.from_m, leg.path_start_m + to_m
                limits_mps = limits_mps.lowered(*ends_m, each.speed_kmh / 3.6)
    return limits_mps


class BrakingEnvelope:
    """Permitted speed along the path for one running direction.

    Positions here are ``s``, the path distance times the running direction, which increases in
    the direction of travel.

    Parameters
    ----------
    limits_mps : StepProfile
        Limit for the reference point over path distance.
    direction : {1, -1}
        Running direction along the path.
    deceleration_mps2 : float
        The braking the driver plans with [m/s^2].
    """

    def __init__(self, limits_mps: StepProfile, direction: int, deceleration_mps2: float) -> None:
        starts = limits_mps.starts_m.tolist()
        squares = [v * v for v in limits_mps.values.tolist()]
        if direction < 0:
            # Beyond the first and last point the values go on: the outer bounds do not matter.
            starts = [-inf, *(-x for x in reversed(starts[1:]))]
            squares.reverse()
        self._starts: list[float] = starts
        self._ends: list[float] = [*starts[1:], inf]
        self._squares: list[float] = squares
        self._exits = self._backward(deceleration_mps2)
        self._twice_b = 2.0 * deceleration_mps2

    def _backward(self, deceleration_mps2: float) -> list[float]:
        exits = [inf] * len(self._squares)
        for i in range(len(self._squares) - 2, -1, -1):
            length_m = self._ends[i + 1] - self._starts[i + 1]
            ramp = exits[i + 1] + 2.0 * deceleration_mps2 * length_m
            exits[i] = min(self._squares[i + 1], ramp)
        return exits

    def speed_mps(self, s: float) -> float:
        """Permitted speed at a position [m/s]."""
        i = max(bisect_right(self._starts, s) - 1, 0)
        ramp = self._exits[i] + self._twice_b * (self._ends[i] - s)
        return sqrt(min(self._squares[i], ramp))

    def next_speed_mps(self, s: float, speed_mps: float, stop_s: float, dt_s: float) -> float:
        """Highest speed for the end of a step.

        Parameters
        ----------
        s, speed_mps : float
            Position [m] and speed [m/s] at the start of the step.
        stop_s : float
            Where to stand, or infinity [m].
        dt_s : float
            Length of the step [s].

        Returns
        -------
        float
            Zero where the train has to come to a stand within the step.
        """
        i = max(bisect_right(self._starts, s) - 1, 0)
        ramp = self._exits[i] + self._twice_b * (self._ends[i] - s)
        stop = self._twice_b * (stop_s - s)
        square = stop if stop < ramp else ramp
        highest = sqrt(self._squares[i])
        # v1^2 = square - 2 b (v + v1) dt / 2, solved for v1 with h = b dt / 2.
        h = 0.25 * self._twice_b * dt_s
        under_root = h * (h - 2.0 * speed_mps) + square
        if under_root <= h * h:
            return 0.0
        return min(highest, sqrt(under_root) - h)


def nearest_ahead(points: Sequence[float], s: float, clearance_m: float) -> float:
    """First of increasing points further than the clearance ahead of s, or infinity."""
    index = bisect_right(points, s + clearance_m)
    return points[index] if index < len(points) else inf


class Driver:
    """What the driver of one train on one route keeps to.

    Parameters
    ----------
    route : Route
        The route.
    vehicle : Vehicle
        The train set.
    extent : Extent
        The train about its reference point.
    steepest : float
        Steepest slope on the route, as a ratio.
    target_speed_mps : float
        Speed the driver does not exceed in any case [m/s].
    restrictions : sequence of SpeedRestriction
        Boards on the line, which he keeps to.

    Attributes
    ----------
    limits_mps : StepProfile
        Speed limit for the reference point, with the whole train counted.
    deceleration_mps2 : float
        The braking planned with: a fraction of full service braking, and never more than the
        service brake gives on the steepest slope down [m/s^2].
    envelopes : dict of {1, -1} to BrakingEnvelope
        Permitted speeds for both running directions.

    Raises
    ------
    ValueError
        If the service brake is too weak for the slope.
    """

    def __init__(
        self,
        route: Route,
        vehicle: Vehicle,
        extent: Extent,
        *,
        steepest: float,
        target_speed_mps: float = inf,
        restrictions: Sequence[SpeedRestriction] = (),
    ) -> None:
        brake = vehicle.service_brake_mps2
        self.deceleration_mps2 = min(
            BRAKE_FRACTION * brake, brake - vehicle.gravity_mps2 * steepest
        )
        if self.deceleration_mps2 < _LEAST_BRAKING_MPS2:
            raise ValueError(f"is too weak for a slope of {1e3 * steepest:g} per mille")
        self.limits_mps = limits_for_train(
            restricted_limits(route, restrictions),
            extent,
            length_m=route.length_m,
            cap_mps=min(vehicle.max_speed_mps, target_speed_mps),
        )
        self.envelopes = {
            direction: BrakingEnvelope(self.limits_mps, direction, self.deceleration_mps2)
            for direction in (1, -1)
        }


class Drivers:
    """The driver of one train, by the boards that stand on the line.

    Parameters
    ----------
    description : TrainDescription
    route, vehicle, extent
        See `Driver`.
    """

    def __init__(
        self, description: TrainDescription, route: Route, vehicle: Vehicle, extent: Extent
    ) -> None:
        target_kmh = description.target_speed_kmh
        self._field = f"trains.{description.name}.vehicle.max_service_brake_mps2"
        self._target_mps = inf if target_kmh is None else target_kmh / 3.6
        self._of = route, vehicle, extent
        self._vehicle = vehicle
        self._steepest = 1e-3 * float(np.max(np.abs(route.gradients_permil.values)))
        self._known: dict[tuple[SpeedRestriction, ...], Driver] = {}

    def keeping(self, restrictions: tuple[SpeedRestriction, ...]) -> Driver:
        """Driver who keeps to some boards; WorldDataError if the brake is too weak."""
        if restrictions not in self._known:
            try:
                self._known[restrictions] = Driver(
                    *self._of,
                    steepest=self._steepest,
                    target_speed_mps=self._target_mps,
                    restrictions=restrictions,
                )
            except ValueError as error:
                brake_mps2 = self._vehicle.service_brake_mps2
                raise WorldDataError(self._field, brake_mps2, str(error)) from None
        return self._known[restrictions]
