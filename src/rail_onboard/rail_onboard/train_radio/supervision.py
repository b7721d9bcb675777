"""Supervision of a train by the movement authorities that it is told over the radio.

All places are s, the chainage times the direction of travel. The front is at most at f, the end
of the location's interval, and the rear at least at r, its start less the length of the train. An
authority reaches to E. With D the stopping distance of ``braking_curve``, D_E that of the emergency
brake, and m the excess ``service_over_mps``, the permitted speed P is the least of

- the limits in force from r to f;
- for each lower limit e ahead, at s: max(e, v - m) with D(v, e) = s - f;
- for the end: v - m with D(v) = (E - margin - f) + D(m).

**P is continuous in f up to the end and 0 from E - margin on.** There D(v) = D(m), so v = m. It
falls off with the slope 1 / D'(m), so a driver who keeps to it, no later than D'(m) / 2.72, comes
up to E - margin ever more slowly and not beyond. At ``STANDSTILL_MPS`` he counts as standing and is
held by the brake: f is then within D(m + STANDSTILL_MPS) - D(m) before E - margin, and the front
at most twice the uncertainty behind f.

**The service brake alone keeps the train before E.** It is demanded at the latest by the first
measurement of v > P + m, or without a position or a fresh authority. At the one before, D(v) <=
D(P + m) <= (E - margin - f) + D(m) <= E - f, as a margin below D(m) is refused. D holds the worst
that can happen from there on, the time to this measurement included; and the front was not beyond
f. The brake is released below P only.

**So does the emergency brake alone, as long as there is a position.** It is demanded by the first
measurement of D_E(v) > E - f of a train that moves, and then held until that train, at a stand,
may start again. The same argument holds. (A train that stands of itself is held by the service
brake; how near the end is no violation.) As D_E <= D it never acts on a train that keeps to P + m.

**A driver who keeps to P is left alone.** Along the curve P falls by less than b per second, so
one who obeys a P that is t old is less than b t too fast, plus the error of the measured speed:
no brake is demanded while that is below m. A location that is an intersection of fixes never
moves f forwards but by the odometer, nor does an authority that never shrinks move E back.

All this is for authorities that reach at least D_E(v) beyond f when they are taken. One that is
shorter is obeyed at once with all that the brakes have.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite

from rail_onboard.braking_curve import GuaranteedBraking
from rail_onboard.track_code.supervision import STANDSTILL_MPS, SupervisionOutput, Thresholds

from .train_location import Location

_SAME_TIME_S = 1e-6


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

    Raises
    ------
    ValueError
        If a number is not finite, or a limit or the validity negative.
    """

    sealed_s: float
    end_m: float
    limit_mps: float
    steps: tuple[tuple[float, float], ...] = ()
    validity_s: float = 3.0
    emergency_stop: bool = False

    def __post_init__(self) -> None:
        for name in ("sealed_s", "end_m"):
            if not isfinite(getattr(self, name)):
                raise ValueError(f"{name}: {getattr(self, name)} is not finite")
        for name in ("limit_mps", "validity_s"):
            if not 0.0 <= getattr(self, name) < inf:
                raise ValueError(f"{name}: {getattr(self, name)} is negative or not finite")
        if any(not (isfinite(at_m) and 0.0 <= limit < inf) for at_m, limit in self.steps):
            raise ValueError(f"steps: {self.steps} are not places and limits")


class AuthoritySupervision:
    """Speed supervision as a state machine; depends on nothing but what it is fed.

    Parameters
    ----------
    length_m : float
        Of the train.
    direction : {1, -1}
        1 if the train travels towards greater chainages.
    margin_m : float
        How far before the end of authority the permitted speed becomes 0.
    timeout_s : float
        Age of an authority at which communication counts as lost, if its validity is not shorter.
    braking : GuaranteedBraking
    thresholds : Thresholds

    Raises
    ------
    ValueError
        If a parameter is out of range; of the margin too, if it is less than the stopping distance
        of a train that is ``service_over_mps`` too fast where it should stand.

    Examples
    --------
    >>> supervision = AuthoritySupervision(100.0)
    >>> here = Location(1000.0, 2.0, True)
    >>> supervision.update(0.0, here, 0.0).reason
    'no authority'
    >>> authority = ReceivedAuthority(sealed_s=0.0, end_m=1500.0, limit_mps=30.0)
    >>> out = supervision.update(0.5, here, 0.0, authority=authority)
    >>> round(out.permitted_mps, 1), out.service_brake
    (24.3, False)
    """

    def __init__(
        self,
        length_m: float,
        *,
        direction: int = 1,
        margin_m: float = 10.0,
        timeout_s: float = 3.0,
        braking: GuaranteedBraking | None = None,
        thresholds: Thresholds | None = None,
    ) -> None:
        if not 0.0 < length_m < inf:
            raise ValueError(f"length_m: {length_m} is not above zero")
        if direction not in (1, -1):
            raise ValueError(f"direction: {direction} is neither 1 nor -1")
        if not 0.0 < timeout_s < inf:
            raise ValueError(f"timeout_s: {timeout_s} is not above zero")
        self._length_m, self._direction, self._timeout_s = length_m, direction, timeout_s
        self._braking = braking or GuaranteedBraking()
        self._thresholds = thresholds or Thresholds()
        self._rolling_m = self._braking.stopping_m(self._thresholds.service_over_mps)
        if not self._rolling_m <= margin_m < inf:
            raise ValueError(f"margin_m: {margin_m} is not at least {self._rolling_m:.2f}")
        self._margin_m = margin_m
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on: the train may not move."""
        self._time_s = -inf
        self._authority: ReceivedAuthority | None = None
        self._blind: tuple[float, float] | None = None  # time and speed when told to stop
        self._service = "no authority"  # why it brakes, empty = it does not
        self._emergency = ""

    @property
    def authority(self) -> ReceivedAuthority | None:
        """The authority in force, which may be void."""
        return self._authority

    def update(
        self,
        time_s: float,
        location: Location,
        speed_mps: float,
        *,
        authority: ReceivedAuthority | None = None,
        fastest_mps: float | None = None,
    ) -> SupervisionOutput:
        """One tick.

        Parameters
        ----------
        time_s : float
            A step backwards resets the state [s].
        location : Location
            Of the front, at this time.
        speed_mps : float
            Of the odometer, of either sign.
        authority : ReceivedAuthority, optional
            The latest one received. One that is not newer than that in force, from the future, or
            whose steps are not in the order of travel, is ignored.
        fastest_mps : float, optional
            The fastest that the train may run, by a localizer; `speed_mps` is then the speed that
            is believed, and only tells whether it stands.
        """
        if not (isfinite(time_s) and isfinite(speed_mps)):
            self._service = self._emergency = "no odometer"
            return SupervisionOutput(0.0, True, True, True, "no odometer")
        if time_s < self._time_s:
            self.reset()
        self._time_s = time_s
        if authority is not None:
            self._take(authority)
        speed_mps = abs(speed_mps)
        fastest = speed_mps if fastest_mps is None else fastest_mps
        located = location.valid and isfinite(location.position_m)
        located = located and 0.0 <= location.uncertainty_m < inf
        permitted_mps, ahead_m = self._permitted(location) if located else (inf, inf)
        stop = self._must_stop(time_s, located)
        if not stop:
            self._blind = None
        else:
            if self._blind is None:
                self._blind = time_s, fastest
            permitted_mps = min(permitted_mps, self._stopping_mps(time_s))
        return self._judge(fastest, speed_mps, permitted_mps, ahead_m, stop)

    def _take(self, authority: ReceivedAuthority) -> None:
        places_m = [self._direction * at_m for at_m, _ in authority.steps]
        if authority.sealed_s > self._time_s + _SAME_TIME_S or places_m != sorted(places_m):
            return
        if self._authority is None or authority.sealed_s > self._authority.sealed_s:
            self._authority = authority

    def _must_stop(self, time_s: float, located: bool) -> str:
        """Why the train must come to a stand wherever it is; empty if it need not."""
        if (authority := self._authority) is None:
            return "no authority"
        if authority.emergency_stop:
            return "emergency stop"
        oldest_s = min(self._timeout_s, authority.validity_s) + _SAME_TIME_S
        if time_s - authority.sealed_s > oldest_s:
            return "no authority"
        return "" if located else "position unknown"

    def _permitted(self, location: Location) -> tuple[float, float]:
        """Speed permitted by the authority at a place, and the distance to its end [m]."""
        if (authority := self._authority) is None:
            return inf, inf
        s = self._direction * location.position_m
        front_m, rear_m = s + location.uncertainty_m, s - location.uncertainty_m - self._length_m
        over_mps = self._thresholds.service_over_mps
        steps = [(self._direction * at_m, limit) for at_m, limit in authority.steps]
        permitted_mps = inf
        # Each limit holds from its step to the next one: those behind the rear are over.
        limits = [(-inf, authority.limit_mps), *steps]
        for (from_m, limit_mps), (to_m, _) in zip(limits, [*steps, (inf, 0.0)], strict=True):
            if to_m <= rear_m:
                continue
            if from_m > front_m:
                curve_mps = self._braking.speed_mps(from_m - front_m, limit_mps) - over_mps
                limit_mps = max(limit_mps, curve_mps)
            permitted_mps = min(permitted_mps, limit_mps)
        ahead_m = self._direction * authority.end_m - front_m
        left_m = ahead_m - self._margin_m
        if left_m <= 0.0:
            return 0.0, ahead_m
        curve_mps = self._braking.speed_mps(left_m + self._rolling_m) - over_mps
        return min(permitted_mps, max(0.0, curve_mps)), ahead_m

    def _stopping_mps(self, time_s: float) -> float:
        """Speed to be expected of a train that brakes since it was told to stop."""
        assert self._blind is not None
        since_s, speed_mps = self._blind
        braked_s = max(0.0, time_s - since_s - self._braking.delay_s)
        return max(0.0, speed_mps - self._braking.service_deceleration_mps2 * braked_s)

    def _judge(
        self,
        speed_mps: float,
        believed_mps: float,
        permitted_mps: float,
        ahead_m: float,
        stop: str,
    ) -> SupervisionOutput:
        """Warn, brake or release.

        Where the speed gets doubtful all at once, the service brake answers; the emergency brake
        does where the train is too fast as it is believed, or could not stop before the end.
        """
        limits = self._thresholds
        standing = believed_mps <= STANDSTILL_MPS
        ceiling_mps = limits.emergency_mps(permitted_mps)
        cause = self._emergency_cause(speed_mps, ahead_m, stop)
        cause = cause or ("too fast" if believed_mps > ceiling_mps else "")
        self._emergency = self._emergency or cause
        # A train that is held starts again for a speed that is worth it only.
        start_mps = max(limits.release_under_mps if self._service else 0.0, STANDSTILL_MPS)
        below_mps = max(permitted_mps - limits.release_under_mps, 0.5 * permitted_mps)
        if stop:
            self._service = stop
        elif permitted_mps <= 0.0 or (standing and permitted_mps <= start_mps):
            self._service = "end of authority"
        elif speed_mps > permitted_mps + limits.service_over_mps:
            self._service = "too fast"
        elif speed_mps <= below_mps:
            if standing and not cause:
                self._emergency = ""
            self._service = self._emergency
        self._service = self._service or self._emergency
        return SupervisionOutput(
            permitted_mps,
            bool(self._service) or speed_mps > permitted_mps + limits.warn_over_mps,
            bool(self._service),
            bool(self._emergency),
            self._emergency or self._service,
        )

    def _emergency_cause(self, speed_mps: float, ahead_m: float, stop: str) -> str:
        """Why the emergency brake is to act at this place; empty if there is no cause."""
        if stop == "emergency stop":
            return stop
        if speed_mps > STANDSTILL_MPS:
            if ahead_m < 0.0:
                return "end passed"
            if self._braking.stopping_m(speed_mps, emergency=True) > ahead_m:
                return "end too near"
        return ""
