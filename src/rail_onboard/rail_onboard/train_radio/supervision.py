"""Supervision of a train by the movement authorities that it is told over the radio.

The curves are those of `authority_curves`, with its symbols: the front is from l to f, the rear at
least at r, the authority ends at E, the danger point is S, P is the permitted speed, SBI and EBI
are the speeds at which the brakes are demanded.

**P is continuous in f up to the end and 0 from E - margin on**; with a release speed it stays there
until l is at E. Along a curve to a foot the train has D(v + m) + v t_d left, so its slope at the
end is 1 / (D'(m) + t_d), and who keeps to it, no later than a part of that, comes up to it ever
more slowly and not beyond. At ``STANDSTILL_MPS`` he counts as standing and is held by the brake.

**The emergency brake alone keeps the train before S, as long as there is a position.** It is
demanded by the first measurement of v > EBI of a train that moves; at the one before, the way with
every delay and every error of the speed at its worst ended before S, and the front was not beyond
f. It is then held until the train, at a stand, may start again. So it does if l passes E on a
release speed: f is then no further than where that speed was computed for.

**So does the service brake alone**, demanded at the latest by the first measurement of v > SBI, or
without a position or a fresh authority; released below P only. Without a release speed it keeps
the train before E', which is E with a margin of at least D(m), and never beyond S.

**No limit is exceeded, from r to f, by more than stated.** With the service brake alone the train
is at most m over a limit, x over it with the emergency brake alone, both as measured, plus what it
gathers until the brake acts: the curve to a lower limit ends at its place. As EBI is nowhere below
SBI2, nor that below P, the emergency brake never acts on a train that keeps to P + m.

**A driver who keeps to P is left alone.** If he obeys a P that is t old, t <= t_d, he is at v =
P(f - vt): D(v + m) + v t_d fitted into the way then, so D(v + m) fits into the way now, and v + m
<= SBI. Where a location is an intersection of fixes it never moves f forwards but by the odometer,
nor does an authority that never shrinks move E back.

All this is for authorities that reach at least the way of the brakes beyond f when they are taken.
One that is shorter is obeyed at once with all that they have. **Limits that come down** over a
train that is within them, or too near, such as a temporary restriction, are answered by the service
brake: it must be as slow as that brake makes it, or the emergency brake follows.
"""

from __future__ import annotations

from math import inf, isfinite

from rail_onboard.braking_curve import GuaranteedBraking
from rail_onboard.track_code.supervision import STANDSTILL_MPS, SupervisionOutput, Thresholds

from .authority_curves import UNBOUND, AuthorityCurves, CurveSpeeds, CurveTimes, ReceivedAuthority
from .train_location import Location

__all__ = ["AuthoritySupervision", "CurveTimes", "ReceivedAuthority"]

_SAME_TIME_S = 1e-6


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
        With the gradients along the direction.
    thresholds : Thresholds
    times : CurveTimes
    fastest_mps : float
        Speed that the train never exceeds.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Examples
    --------
    >>> supervision = AuthoritySupervision(100.0)
    >>> here = Location(1000.0, 2.0, True)
    >>> supervision.update(0.0, here, 0.0).reason
    'no authority'
    >>> authority = ReceivedAuthority(sealed_s=0.0, end_m=1500.0, limit_mps=30.0)
    >>> out = supervision.update(0.5, here, 0.0, authority=authority)
    >>> round(out.permitted_mps, 1), out.service_brake
    (23.7, False)
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
        times: CurveTimes | None = None,
        fastest_mps: float = 100.0,
    ) -> None:
        if not 0.0 < timeout_s < inf:
            raise ValueError(f"timeout_s: {timeout_s} is not above zero")
        self.curves = AuthorityCurves(
            length_m,
            direction=direction,
            margin_m=margin_m,
            braking=braking,
            thresholds=thresholds,
            times=times,
            fastest_mps=fastest_mps,
        )
        self._direction, self._timeout_s = direction, timeout_s
        self._braking, self._thresholds = self.curves.braking, self.curves.thresholds
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on: the train may not move."""
        self._time_s = -inf
        self._authority: ReceivedAuthority | None = None
        self._blind: tuple[float, float] | None = None  # time and speed when told to stop
        self._slowed: tuple[float, float] | None = None  # time and speed when limits came down
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
            return SupervisionOutput(0.0, True, True, True, "no odometer", traction_cut_off=True)
        if time_s < self._time_s:
            self.reset()
        self._time_s = time_s
        before = self._authority
        if authority is not None:
            self._take(authority)
        speed_mps = abs(speed_mps)
        fastest = speed_mps if fastest_mps is None else fastest_mps
        located = location.valid and isfinite(location.position_m)
        located = located and 0.0 <= location.uncertainty_m < inf
        speeds = UNBOUND
        if located and self._authority is not None:
            speeds = self.curves.at(self._authority, location)
            if before is not None and before is not self._authority:
                self._note_lower_limits(self.curves.at(before, location), speeds, speed_mps)
        stop = self._must_stop(time_s, located)
        if not stop:
            self._blind = None
        elif self._blind is None:
            self._blind = time_s, fastest
        return self._judge(fastest, speed_mps, self._in_time(time_s, speeds), stop)

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

    def _note_lower_limits(self, before: CurveSpeeds, after: CurveSpeeds, speed_mps: float) -> None:
        """Note when limits came down so that the train is too fast at once."""
        lower = after.emergency_mps < min(before.emergency_mps, speed_mps)
        if lower and self._slowed is None and speed_mps <= before.emergency_mps:
            self._slowed = self._time_s, speed_mps

    def _in_time(self, time_s: float, speeds: CurveSpeeds) -> CurveSpeeds:
        """Speeds at which a brake is demanded, of a train that was told to brake."""
        if self._slowed is not None:
            braked_mps = self._thresholds.emergency_mps(self._braking_mps(time_s, self._slowed))
            if braked_mps <= speeds.emergency_mps:
                self._slowed = None
            speeds = speeds._replace(emergency_mps=max(speeds.emergency_mps, braked_mps))
        if self._blind is not None:
            braked_mps = self._braking_mps(time_s, self._blind)
            speeds = speeds._replace(
                permitted_mps=min(speeds.permitted_mps, braked_mps),
                emergency_mps=min(speeds.emergency_mps, self._thresholds.emergency_mps(braked_mps)),
            )
        return speeds

    def _braking_mps(self, time_s: float, since: tuple[float, float]) -> float:
        """Speed to be expected of a train that brakes since a time, from a speed."""
        since_s, speed_mps = since
        braked_s = max(0.0, time_s - since_s - self._braking.full_force_s)
        return max(0.0, speed_mps - self._braking.service_deceleration_mps2 * braked_s)

    def _judge(
        self, speed_mps: float, believed_mps: float, speeds: CurveSpeeds, stop: str
    ) -> SupervisionOutput:
        """Warn, brake or release.

        Where the speed gets doubtful all at once, the service brake answers; the emergency brake
        does where the train is too fast as it is believed, or could not stop before the end.
        """
        limits, permitted_mps = self._thresholds, speeds.permitted_mps
        standing = believed_mps <= STANDSTILL_MPS
        cause = self._emergency_cause(speed_mps, speeds, stop)
        cause = cause or ("too fast" if believed_mps > speeds.emergency_mps else "")
        self._emergency = self._emergency or cause
        # A train that is held starts again for a speed that is worth it only.
        start_mps = max(limits.release_under_mps if self._service else 0.0, STANDSTILL_MPS)
        if speeds.release_mps > 0.0:
            start_mps = min(start_mps, 0.5 * speeds.release_mps)
        below_mps = max(permitted_mps - limits.release_under_mps, 0.5 * permitted_mps)
        if stop:
            self._service = stop
        elif permitted_mps <= 0.0 or (standing and permitted_mps <= start_mps):
            self._service = "end of authority"
        elif speed_mps > speeds.service_mps:
            self._service = "too fast"
        elif speed_mps <= below_mps:
            if standing and not cause:
                self._emergency = ""
            self._service = self._emergency
        self._service = self._service or self._emergency
        warning = bool(self._service) or speed_mps > speeds.warning_mps
        return SupervisionOutput(
            permitted_mps,
            warning,
            bool(self._service),
            bool(self._emergency),
            self._emergency or self._service,
            traction_cut_off=warning,
        )

    def _emergency_cause(self, speed_mps: float, speeds: CurveSpeeds, stop: str) -> str:
        """Why the emergency brake is to act at this place; empty if there is no cause."""
        if stop == "emergency stop":
            return stop
        if speed_mps > STANDSTILL_MPS:
            if speeds.passed:
                return "end passed"
            if speed_mps > speeds.end_mps:
                return "end too near"
        return ""
