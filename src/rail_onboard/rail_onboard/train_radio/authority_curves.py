"""Speeds that a movement authority allows at a place: the curves of its supervision.

All places are s, the chainage times the direction of travel. The front is from l to f, the interval
of the location, the rear at least at r, l less the length of the train. The authority ends at E;
the danger point is at S, not before E; what lies between is the overlap. With the curves of
``braking_curve``, the thresholds over the permitted speed (warning w, service m, emergency x) and
the time t_d by which the driver is told before:

===== =========================== ================================== ===========================
curve for a limit in force, e     for a lower limit e at s           for the end
===== =========================== ================================== ===========================
EBI   e + x                       EBD to e + x at s                  EBD to 0 at S
SBI2  -                           EBI's, t_s earlier                 EBI's, t_s earlier
SBI1  e + m                       SBD to e at s                      SBD to 0 at E' (below)
W     e + w                       SBI, t_d/2 and m - w earlier       the same
P     e                           SBI, t_d and m earlier             the same
===== =========================== ================================== ===========================

and of all limits, and the end, the lowest counts. No curve to a limit falls below what is allowed
when it is in force. Indication is P, t_i earlier; guidance is a deceleration that passengers like,
to where P is 0; both are for the driver's display.

P is 0 where the train is ``margin_m`` before E: at that place a train at m, with the lag, comes to
a stand at E', which is E - margin + D(m). With a margin of D(m) that is E; with less it lies in the
overlap, and never beyond S. So P does not hang on how long the lag is.

**Release speed.** With the leave to use it, the train may go at v_r until its least front l is at
E: so it comes to a stop at E whatever the uncertainty, which is then the way that f is past E. v_r
is the least of: what either brake, with the lag, stops before S from f = E + (f - l), less m; and
``RELEASE_MPS``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, isfinite
from typing import Final, NamedTuple

from rail_onboard.braking_curve import GuaranteedBraking, Lag
from rail_onboard.gradient_profile import WidthGradients
from rail_onboard.track_code.supervision import Thresholds

from .train_location import Location

#: No release speed is higher [m/s]; one below `LEAST_RELEASE_MPS` is none.
RELEASE_MPS: Final = 15.0 / 3.6
LEAST_RELEASE_MPS: Final = 0.2


@dataclass(frozen=True, slots=True)
class ReceivedAuthority:
    """A movement authority as its receiver holds it.

    Parameters
    ----------
    sealed_s : float
        When it was sealed, from the time-stamp of its frame.
    end_m : float
        Chainage that the front must not pass.
    limit_mps : float
        Limit up to the first step.
    steps : tuple of (float, float)
        Chainage from which another limit holds, and that limit [m, m/s], in the order of travel.
    validity_s : float
        Time from ``sealed_s`` after which it is void.
    emergency_stop : bool
        Whether the train must stop at once.
    overlap_m : float
        From the end to the danger point.
    release : bool
        Whether the train may use a release speed to come to the end.

    Raises
    ------
    ValueError
        If a number is not finite, or a limit, the validity or the overlap negative.
    """

    sealed_s: float
    end_m: float
    limit_mps: float
    steps: tuple[tuple[float, float], ...] = ()
    validity_s: float = 3.0
    emergency_stop: bool = False
    overlap_m: float = 0.0
    release: bool = False

    def __post_init__(self) -> None:
        for name in ("sealed_s", "end_m"):
            if not isfinite(getattr(self, name)):
                raise ValueError(f"{name}: {getattr(self, name)} is not finite")
        for name in ("limit_mps", "validity_s", "overlap_m"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ValueError(f"{name}: {getattr(self, name)} is negative or not finite")
        if any(not (isfinite(at_m) and 0.0 <= limit < inf) for at_m, limit in self.steps):
            raise ValueError(f"steps: {self.steps} are not places and limits")


@dataclass(frozen=True)
class CurveTimes:
    """By how much each curve is earlier than the one it leads to [s].

    Parameters
    ----------
    driver_s : float
        Permitted speed before SBI; at least as long as it takes until a driver obeys.
    service_first_s : float
        SBI2 before EBI: the service brake is tried that long.
    indication_s : float
        Indication before the permitted speed.
    guidance_share : float
        Deceleration of the guidance curve over the guaranteed service brake.
    """

    driver_s: float = 1.0
    service_first_s: float = 0.5
    indication_s: float = 5.0
    guidance_share: float = 0.7

    def __post_init__(self) -> None:
        for name in ("driver_s", "service_first_s", "indication_s"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ValueError(f"{name}: {getattr(self, name)} is negative or not finite")
        if not 0.0 < self.guidance_share <= 1.0:
            raise ValueError(f"guidance_share: {self.guidance_share} is not from 0 to 1")


class CurveSpeeds(NamedTuple):
    """Speeds at a place [m/s], and the distances from the worst front [m].

    ``emergency_mps`` is EBI of the limits, ``end_mps`` that of the danger point; ``release_mps``
    is 0 where there is none.
    """

    permitted_mps: float
    warning_mps: float
    service_mps: float
    emergency_mps: float
    end_mps: float
    release_mps: float
    passed: bool


#: Nothing bounds the speed, as no place or no authority is known.
UNBOUND: Final = CurveSpeeds(inf, inf, inf, inf, inf, 0.0, False)


class _Place(NamedTuple):
    """The train at a place: its front, least front and rear, its lags, the track under it."""

    front_m: float
    least_m: float
    rear_m: float
    gradients: WidthGradients
    permitted: Lag
    warning: Lag
    service: Lag
    emergency: Lag
    first: Lag
    first_permitted: Lag
    first_warning: Lag


class AuthorityCurves:
    """Curves of one train.

    Parameters
    ----------
    length_m : float
        Of the train.
    direction : {1, -1}
    margin_m : float
        How far before the end of authority the permitted speed becomes 0.
    braking : GuaranteedBraking
        Its gradients count along the direction.
    thresholds : Thresholds
    times : CurveTimes
    fastest_mps : float
        The train is never faster: how far it looks for a fall that it may come to before it brakes.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        length_m: float,
        *,
        direction: int = 1,
        margin_m: float = 10.0,
        braking: GuaranteedBraking | None = None,
        thresholds: Thresholds | None = None,
        times: CurveTimes | None = None,
        fastest_mps: float = 100.0,
    ) -> None:
        if not 0.0 < length_m < inf:
            raise ValueError(f"length_m: {length_m} is not above zero")
        if direction not in (1, -1):
            raise ValueError(f"direction: {direction} is neither 1 nor -1")
        if not 0.0 <= margin_m < inf:
            raise ValueError(f"margin_m: {margin_m} is negative or not finite")
        if not 0.0 < fastest_mps < inf:
            raise ValueError(f"fastest_mps: {fastest_mps} is not above zero")
        self._length_m, self._direction, self._margin_m = length_m, direction, margin_m
        self.braking = braking or GuaranteedBraking()
        self.thresholds, self._times = thresholds or Thresholds(), times or CurveTimes()
        self._reach_m = 1.5 * fastest_mps * self.braking.full_force_s

    def at(self, authority: ReceivedAuthority, location: Location) -> CurveSpeeds:
        """Speeds by an authority at a location, which must be known."""
        place = self._place(location)
        limits = self.thresholds
        permitted, warning, service, emergency = [inf], [inf], [inf], [inf]
        for from_m, limit_mps in self._limits(authority, place):
            highest_mps = limits.emergency_mps(limit_mps)
            speeds = (
                limit_mps,
                limit_mps + limits.warn_over_mps,
                limit_mps + limits.service_over_mps,
                highest_mps,
            )
            if from_m > place.front_m:
                ahead = self._to_limit(place, from_m, limit_mps, highest_mps)
                speeds = tuple(map(max, speeds, ahead))  # type: ignore[assignment]
            for least, speed_mps in zip(
                (permitted, warning, service, emergency), speeds, strict=True
            ):
                least[0] = min(least[0], speed_mps)
        end_m = self._direction * authority.end_m
        ends = self._to_end(place, end_m, authority.overlap_m)
        passed = authority.release and place.least_m > end_m
        release_mps = 0.0
        if authority.release and not passed:
            release_mps = self._release_mps(place, end_m, authority.overlap_m)
        over = (0.0, limits.warn_over_mps, limits.service_over_mps)
        floors = [release_mps + each if release_mps else 0.0 for each in over]
        return CurveSpeeds(
            min(permitted[0], max(0.0, floors[0], ends[0])),
            min(warning[0], max(0.0, floors[1], ends[1])),
            min(service[0], max(0.0, floors[2], ends[2])),
            emergency[0],
            -inf if place.front_m > end_m + authority.overlap_m else ends[3],
            release_mps,
            passed or place.front_m > end_m + authority.overlap_m,
        )

    def advice(self, authority: ReceivedAuthority, location: Location) -> tuple[float, float]:
        """Speeds of the guidance curve and of the indication, for the driver's display [m/s]."""
        place, braking = self._place(location), self.braking
        earlier_s = self._times.driver_s + self._times.indication_s
        shown = place.permitted._replace(ahead_s=earlier_s)
        rates = tuple((up_to, self._times.guidance_share * b) for up_to, b in braking.service)
        at_once = Lag(0.0, 0.0, 0.0)
        guidance_mps = indication_mps = inf
        for from_m, limit_mps in self._limits(authority, place):
            if from_m > place.front_m:
                foot = (place.gradients, from_m, limit_mps, place.front_m)
                guidance_mps = min(
                    guidance_mps, max(limit_mps, braking.curve_mps(rates, *foot, at_once))
                )
                curve_mps = braking.curve_mps(braking.service, *foot, shown)
                indication_mps = min(indication_mps, max(limit_mps, curve_mps))
            else:
                guidance_mps = min(guidance_mps, limit_mps)
                indication_mps = min(indication_mps, limit_mps)
        end_m = self._direction * authority.end_m
        stop_m = end_m if authority.release else end_m - self._margin_m
        foot = (place.gradients, stop_m, 0.0, place.front_m)
        guidance_mps = min(guidance_mps, max(0.0, braking.curve_mps(rates, *foot, at_once)))
        foot = (
            place.gradients,
            self._service_foot_m(place, end_m, authority.overlap_m),
            0.0,
            place.front_m,
        )
        end_mps = braking.curve_mps(braking.service, *foot, shown)
        return guidance_mps, min(indication_mps, max(0.0, end_mps))

    def _place(self, location: Location) -> _Place:
        braking, limits, times = self.braking, self.thresholds, self._times
        s = self._direction * location.position_m
        front_m, least_m = s + location.uncertainty_m, s - location.uncertainty_m
        rear_m = least_m - self._length_m
        fall_mps2 = braking.gradients.gathered_mps2(rear_m, front_m + self._reach_m)
        service = braking.lag(braking.service, fall_mps2)
        emergency = braking.lag(braking.emergency, fall_mps2)
        first = braking.lag(braking.emergency, fall_mps2, later_s=times.service_first_s)
        told = {"ahead_s": times.driver_s, "over_mps": limits.service_over_mps}
        warned = {
            "ahead_s": 0.5 * times.driver_s,
            "over_mps": limits.service_over_mps - limits.warn_over_mps,
        }
        return _Place(
            front_m,
            least_m,
            rear_m,
            braking.gradients.of_width(front_m - rear_m),
            service._replace(**told),
            service._replace(**warned),
            service,
            emergency,
            first,
            first._replace(**told),
            first._replace(**warned),
        )

    def _limits(self, authority: ReceivedAuthority, place: _Place) -> Iterator[tuple[float, float]]:
        """Limits, and where each begins, that the rear has not left behind."""
        steps = [(self._direction * at_m, limit) for at_m, limit in authority.steps]
        limits = [(-inf, authority.limit_mps), *steps]
        for (from_m, limit_mps), (to_m, _) in zip(limits, [*steps, (inf, 0.0)], strict=True):
            if to_m > place.rear_m:
                yield from_m, limit_mps

    def _to_limit(
        self, place: _Place, from_m: float, limit_mps: float, highest_mps: float
    ) -> tuple[float, float, float, float]:
        """P, W, SBI and EBI of a limit ahead, by its curves alone."""
        # What is measured as the highest may truly be faster by the error of the speed.
        highest_mps *= 1.0 + self.braking.speed_error
        return (
            min(
                self._service_mps(place, from_m, limit_mps, place.permitted),
                self._emergency_mps(place, from_m, highest_mps, place.first_permitted),
            ),
            min(
                self._service_mps(place, from_m, limit_mps, place.warning),
                self._emergency_mps(place, from_m, highest_mps, place.first_warning),
            ),
            min(
                self._service_mps(place, from_m, limit_mps, place.service),
                self._emergency_mps(place, from_m, highest_mps, place.first),
            ),
            self._emergency_mps(place, from_m, highest_mps, place.emergency),
        )

    def _to_end(
        self, place: _Place, end_m: float, overlap_m: float
    ) -> tuple[float, float, float, float]:
        """P, W, SBI and EBI of the end of authority and the danger point."""
        foot_m, danger_m = self._service_foot_m(place, end_m, overlap_m), end_m + overlap_m
        return (
            min(
                self._service_mps(place, foot_m, 0.0, place.permitted),
                self._emergency_mps(place, danger_m, 0.0, place.first_permitted),
            ),
            min(
                self._service_mps(place, foot_m, 0.0, place.warning),
                self._emergency_mps(place, danger_m, 0.0, place.first_warning),
            ),
            min(
                self._service_mps(place, foot_m, 0.0, place.service),
                self._emergency_mps(place, danger_m, 0.0, place.first),
            ),
            self._emergency_mps(place, danger_m, 0.0, place.emergency),
        )

    def _service_foot_m(self, place: _Place, end_m: float, overlap_m: float) -> float:
        """Where the service brake surely brings the train to a stand for an end of authority."""
        over_mps, braking = self.thresholds.service_over_mps, self.braking
        rolling_m = braking.way_m(braking.service, place.gradients, end_m, over_mps, place.service)
        return end_m + min(rolling_m - self._margin_m, overlap_m)

    def _release_mps(self, place: _Place, end_m: float, overlap_m: float) -> float:
        """Release speed, 0 if there is no room for one."""
        width_m = place.front_m - place.least_m
        at = place._replace(front_m=end_m + width_m)
        danger_m = end_m + overlap_m
        stops_mps = min(
            self._service_mps(at, danger_m, 0.0, at.service),
            self._emergency_mps(at, danger_m, 0.0, at.emergency),
        )
        release_mps = min(stops_mps - self.thresholds.service_over_mps, RELEASE_MPS)
        return release_mps if release_mps >= LEAST_RELEASE_MPS else 0.0

    def _service_mps(self, place: _Place, foot_m: float, foot_mps: float, lag: Lag) -> float:
        braking = self.braking
        foot = (foot_m, foot_mps, place.front_m)
        return braking.curve_mps(braking.service, place.gradients, *foot, lag)

    def _emergency_mps(self, place: _Place, foot_m: float, foot_mps: float, lag: Lag) -> float:
        braking = self.braking
        foot = (foot_m, foot_mps, place.front_m)
        return braking.curve_mps(braking.emergency, place.gradients, *foot, lag)
