"""Supervision of a train by the codes in the rails.

A code tells the speed allowed in a block, the one allowed at its end, and the block's length L and
gradient. With the way d run since its entrance the permitted speed is the largest P from which a
train that is already too fast by ``m``, and still gathers ``a`` for the dead time ``T`` until its
brakes act, comes down to the end speed e in what is left of the block with the deceleration b:

    w = P + m + a T:    (w - a T / 2) T + (w^2 - e^2) / (2 b) = L - d

and never less than e, for which no braking is needed. The worst is assumed throughout: the
entrance was passed when the old carrier was last surely heard, the odometer counts too little, a
fall adds to ``a``. In a new block the end speed of the old one holds until its first valid code.
Where a localizer knows the train at both places, d is the most that its intervals allow instead.

A code is obeyed only if it can come from the circuit under the train: its identity is that of the
code before, or the next one after a change of carrier. Any other one counts as none. At a stand,
once the code is overdue, any is taken - with its end speed, since the entrance is not known.

Wheels that are not believed (`WheelCheck`) make the train brake to a stand, by the worst of its
speed; it then runs by the most that physics allows until they are believed again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite, sqrt

from rail_onboard.localizer.protected_interval import doubt_way_m
from rail_signals.track_code.scales import (
    GRAVITY_MPS2,
    IDENTITIES,
    LEAST_BRAKING_MPS2,
    CodeScales,
    TrackCode,
    deceleration_mps2,
    identity_after,
)

from .block_check import BlockCheck
from .supervision_limits import TRIP_SPEEDS_300_KMH, Delays, Thresholds
from .wheel_check import WheelCheck

__all__ = [
    "STANDSTILL_MPS",
    "TRIP_SPEEDS_300_KMH",
    "CodeSupervision",
    "Delays",
    "SupervisionOutput",
    "Thresholds",
]

#: Slower than this a train stands.
STANDSTILL_MPS = 0.05


@dataclass(frozen=True)
class SupervisionOutput:
    """What a train may do. ``reason`` tells why it brakes, empty if it does not."""

    permitted_mps: float
    warning: bool
    service_brake: bool
    emergency_brake: bool
    reason: str
    traction_cut_off: bool = False
    on_sight: bool = False


@dataclass(frozen=True)
class _OdometerPlace:
    """A place by the odometer [m], and the interval of a localizer, least and most [m]."""

    odometer_m: float
    located_m: tuple[float, float] | None

    def run_m(self, start: _OdometerPlace, odometer_error: float) -> float:
        """The most that the train can have run since a place."""
        if self.located_m is not None and start.located_m is not None:
            return max(0.0, self.located_m[1] - start.located_m[0])
        return max(0.0, self.odometer_m - start.odometer_m) * (1.0 + odometer_error)


class CodeSupervision:
    """Speed supervision as a state machine; depends on nothing but what it is fed.

    Parameters
    ----------
    guaranteed_service_mps2 : float
        Guaranteed service brake rate on level track.
    odometer_error : float
        Relative error of distances that must be allowed for.
    scales : CodeScales
    thresholds : Thresholds
    delays : Delays
    wheels : WheelCheck, optional
        Of the wheels that tell speed and way; None = they are believed.

    Raises
    ------
    ValueError
        If a parameter is out of range.

    Examples
    --------
    >>> supervision = CodeSupervision()
    >>> supervision.update(0.0, 0.0, 0.0, carrier_hz=1700.0).reason
    'no valid code'
    >>> code = {"speed": 0x64, "gradient": 10, "block_length": 20}
    >>> out = supervision.update(0.1, 0.0, 0.0, fields=code, carrier_hz=1700.0)
    >>> round(3.6 * out.permitted_mps), out.service_brake
    (60, False)
    """

    def __init__(
        self,
        *,
        guaranteed_service_mps2: float = 0.5,
        odometer_error: float = 0.02,
        scales: CodeScales | None = None,
        thresholds: Thresholds | None = None,
        delays: Delays | None = None,
        wheels: WheelCheck | None = None,
    ) -> None:
        if not 0.0 < guaranteed_service_mps2 < inf:
            raise ValueError(f"braking_mps2: {guaranteed_service_mps2} is not above zero")
        if not 0.0 <= odometer_error < 1.0:
            raise ValueError(f"odometer_error: {odometer_error} is not from 0 to 1")
        self._braking_mps2, self._odometer_error = guaranteed_service_mps2, odometer_error
        self._scales = scales or CodeScales()
        self._thresholds = thresholds or Thresholds()
        self._delays = delays or Delays()
        self._wheels = wheels
        self._blocks = BlockCheck(self._delays.notice_s, odometer_error)
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on: the train may not move."""
        self._time_s = -inf
        if self._wheels is not None:
            self._wheels.reset()
        self._blocks.reset()
        self._identity = 0  # of the circuit whose code is in force; 0 = not known
        self._doubted = self._were_doubted = False  # whether the wheels are not believed
        self._proving = False  # braking to a stand, because the wheels are not believed
        self._code: TrackCode | None = None
        self._code_s = -inf  # when it was last valid, or its successor was due
        self._carrier_hz: float | None = None
        self._awaiting = False  # in a new block, without its code
        self._entry: _OdometerPlace | None = None  # the entrance of the block; None = unknown
        self._before: deque[tuple[float, _OdometerPlace]] = (
            deque()
        )  # times and places, carrier in force
        self._lost: tuple[float, float] | None = None  # time and speed when the code was lost
        self._service = True
        self._emergency = False
        self._passed_stop = False

    def update(
        self,
        time_s: float,
        distance_m: float,
        speed_mps: float,
        *,
        fields: Mapping[str, int] | None = None,
        carrier_hz: float | None = None,
        located_m: tuple[float, float] | None = None,
        fastest_mps: float | None = None,
        doubt_mps: float = 0.0,
    ) -> SupervisionOutput:
        """One tick.

        Parameters
        ----------
        time_s : float
            A step backwards resets the state [s].
        distance_m, speed_mps : float
            Of the odometer.
        fields : mapping, optional
            Fields of the valid code understood on ``carrier_hz``, None = none in this tick.
        carrier_hz : float, optional
            Carrier in force in the rails, None = none is heard [Hz].
        located_m : (float, float), optional
            Least and most of the distance by a localizer, of any origin; it grows with the travel
            [m].
        fastest_mps : float, optional
            The fastest that the train may run, by a localizer; `speed_mps` is then the speed that
            is believed, and only tells whether it stands.
        doubt_mps : float
            By how much the train may run faster than what is compared with limits; made up for in
            the braking distance.
        """
        if time_s < self._time_s:
            self.reset()
        self._time_s = time_s
        if not (isfinite(distance_m) and isfinite(speed_mps)):
            self._service = self._emergency = True
            return SupervisionOutput(0.0, True, True, True, "no odometer")
        speed_mps = abs(speed_mps)
        self._blocks.run_to(distance_m, speed_mps)
        fastest, most_m = self._by_physics(time_s, distance_m, speed_mps, fastest_mps)
        place = _OdometerPlace(most_m, located_m)
        self._follow(time_s, place, fastest, carrier_hz)
        if fields is not None and carrier_hz is not None:
            identity = fields.get("network", 0)
            if self._can_be_of_this_circuit(identity, stands=fastest <= STANDSTILL_MPS):
                self._take(time_s, self._scales.read(fields), identity)
        lost = self._overdue(time_s)
        permitted_mps = self._permitted_mps(place, fastest, doubt_mps)
        if not lost:
            self._lost = None
        else:
            if self._lost is None:
                self._lost = time_s, fastest
            permitted_mps = min(permitted_mps, self._stopping_mps(time_s))
        stands = speed_mps <= STANDSTILL_MPS and (
            fastest_mps is not None or fastest <= STANDSTILL_MPS
        )
        return self._judge(fastest, stands, permitted_mps, lost=lost)

    def _by_physics(
        self, time_s: float, distance_m: float, speed_mps: float, located_mps: float | None
    ) -> tuple[float, float]:
        """The fastest that the train may run, and the most of its way; by a localizer's speed."""
        wheels = self._wheels
        if wheels is None:
            return (speed_mps if located_mps is None else located_mps), distance_m
        gradient_permil = self._code.gradient_permil if self._code else 0.0
        guaranteed = max(0.0, deceleration_mps2(self._braking_mps2, min(0.0, gradient_permil)))
        fastest = wheels.update(
            time_s,
            distance_m,
            speed_mps,
            braked=self._service or self._emergency,
            guaranteed_mps2=guaranteed,
        )
        self._were_doubted = self._doubted
        self._doubted = located_mps is None and not wheels.trusted
        if located_mps is not None:
            return located_mps, wheels.run_m
        return fastest, wheels.run_m

    def _follow(
        self, time_s: float, place: _OdometerPlace, speed_mps: float, carrier_hz: float | None
    ) -> None:
        """Notice the entrance of a block by its carrier."""
        if carrier_hz is None:
            self._blocks.reset()  # an entrance may go by unnoticed
            return
        if self._carrier_hz is not None and carrier_hz != self._carrier_hz:
            entry = self._before[0][1]
            # A block is at least as long as coded: a change before that, or a second one
            # without a code, is crosstalk, and then no entrance is known.
            trusted = self._wheels is None or self._wheels.trusted
            believed = trusted and not self._awaiting and self._left_m(place) <= 0.0
            if believed and self._code is not None and self._code.end_mps <= 0.0:
                self._passed_stop |= speed_mps > STANDSTILL_MPS
            self._entry = entry if believed else None
            if not (self._awaiting or self._overdue(time_s)):
                # The new code is given its time once: flicker must not put it off indefinitely.
                self._code_s = time_s
            self._awaiting = True
            self._blocks.enter()
            self._before.clear()
        self._carrier_hz = carrier_hz
        self._before.append((time_s, place))
        while len(self._before) > 1 and self._before[1][0] <= time_s - self._delays.notice_s:
            self._before.popleft()

    def _can_be_of_this_circuit(self, identity: int, *, stands: bool) -> bool:
        """Whether a code of this identity can come from the circuit under the train."""
        if identity not in IDENTITIES or self._identity == 0:
            return True  # no identity is told, or nothing is known
        if identity == self._identity:
            return True
        if self._awaiting and identity == identity_after(self._identity):
            return True
        return stands and self._overdue(self._time_s)

    def _take(self, time_s: float, code: TrackCode, identity: int) -> None:
        """Obey a valid code."""
        old, new_block = self._code, self._awaiting
        if old is not None and not self._awaiting:
            same = (code.length_m, code.gradient_permil) == (old.length_m, old.gradient_permil)
            # Another block without a change of carrier: two entrances went by unnoticed.
            self._entry = self._entry if same and identity == self._identity else None
        if new_block:
            follows = self._identity != 0 and identity == identity_after(self._identity)
            self._check_wheels(self._blocks.leave(old.length_m if old else 0.0, follows=follows))
        self._identity = identity if identity in IDENTITIES else 0
        self._code, self._code_s, self._awaiting = code, time_s, False

    def _check_wheels(self, ratio: float | None) -> None:
        """Believe the wheels or do not, by the block that was left."""
        wheels, code = self._wheels, self._code
        if wheels is None or ratio is None or code is None:
            return
        if ratio >= 1.0:
            wheels.trust()
        else:
            wheels.doubt(
                max(wheels.fastest_from_stand_mps(code.length_m), wheels.speed_mps / ratio)
            )

    def _overdue(self, time_s: float) -> bool:
        """Whether there has been no valid code for longer than the receiver needs."""
        # The response time itself is within it, however the ticks are rounded.
        return self._code is None or time_s - self._code_s > self._delays.response_s + 1e-9

    def _left_m(self, place: _OdometerPlace) -> float:
        """What is left of the block at the worst; nothing where its entrance is not known."""
        if self._code is None or self._entry is None:
            return 0.0
        run_m = place.run_m(self._entry, self._odometer_error)
        return max(0.0, self._code.length_m - run_m)

    def _permitted_mps(self, place: _OdometerPlace, speed_mps: float, doubt_mps: float) -> float:
        """Speed permitted by the code at a place of its block; no bound if there was none."""
        code = self._code
        if code is None:
            return inf
        if self._awaiting:
            return code.end_mps
        b = deceleration_mps2(self._braking_mps2, code.gradient_permil)
        if b < LEAST_BRAKING_MPS2:
            return code.end_mps
        t = self._delays.brake_s
        a = self._delays.traction_mps2 + max(0.0, -GRAVITY_MPS2 * 1e-3 * code.gradient_permil)
        more_m = doubt_way_m(doubt_mps, speed_mps + a * t, b, t)
        left_m = max(0.0, self._left_m(place) - more_m)
        w = -b * t + sqrt((b * t) ** 2 + code.end_mps**2 + 2.0 * b * left_m + a * b * t**2)
        curve_mps = w - a * t - self._thresholds.service_over_mps
        return min(code.now_mps, max(code.end_mps, curve_mps))

    def _stopping_mps(self, time_s: float) -> float:
        """Speed to be expected of a train that brakes since its code was lost."""
        assert self._lost is not None
        since_s, speed_mps = self._lost
        gradient_permil = self._code.gradient_permil if self._code else 0.0
        b = max(deceleration_mps2(self._braking_mps2, gradient_permil), LEAST_BRAKING_MPS2)
        return max(0.0, speed_mps - b * max(0.0, time_s - since_s - self._delays.brake_s))

    def _judge(
        self, speed_mps: float, stands: bool, permitted_mps: float, *, lost: bool
    ) -> SupervisionOutput:
        """Warn, brake or release."""
        limits = self._thresholds
        if not self._doubted or speed_mps <= 0.0:
            self._proving = False
        elif speed_mps > permitted_mps or not self._were_doubted:
            self._proving = True
        too_fast = speed_mps > permitted_mps + limits.service_over_mps
        stop = permitted_mps <= 0.0
        below = max(permitted_mps - limits.release_under_mps, 0.5 * permitted_mps)
        if lost or stop or too_fast or self._proving:
            self._service = True
        elif speed_mps <= below:
            if stands:
                self._emergency = self._passed_stop = False
            self._service = self._emergency
        if self._passed_stop or speed_mps > limits.emergency_mps(permitted_mps):
            self._emergency = self._service = True
        reason = ""
        if self._service:
            reason = "too fast"
            if lost:
                reason = "no valid code"
            elif self._passed_stop:
                reason = "stop passed"
            elif stop:
                reason = "stop"
            elif self._proving:
                reason = "wheels not believed"
        return SupervisionOutput(
            permitted_mps,
            self._service or speed_mps > permitted_mps + limits.warn_over_mps,
            self._service,
            self._emergency,
            reason,
        )
