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
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite, sqrt

import numpy as np

from rail_signals.track_code.scales import (
    GRAVITY_MPS2,
    LEAST_BRAKING_MPS2,
    CodeScales,
    TrackCode,
    deceleration_mps2,
)

#: Slower than this a train stands.
STANDSTILL_MPS = 0.05

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
    ) -> None:
        if not 0.0 < guaranteed_service_mps2 < inf:
            raise ValueError(f"braking_mps2: {guaranteed_service_mps2} is not above zero")
        if not 0.0 <= odometer_error < 1.0:
            raise ValueError(f"odometer_error: {odometer_error} is not from 0 to 1")
        self._braking_mps2, self._odometer_error = guaranteed_service_mps2, odometer_error
        self._scales = scales or CodeScales()
        self._thresholds = thresholds or Thresholds()
        self._delays = delays or Delays()
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on: the train may not move."""
        self._time_s = -inf
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
        """
        if time_s < self._time_s:
            self.reset()
        self._time_s = time_s
        if not (isfinite(distance_m) and isfinite(speed_mps)):
            self._service = self._emergency = True
            return SupervisionOutput(0.0, True, True, True, "no odometer")
        speed_mps = abs(speed_mps)
        fastest = speed_mps if fastest_mps is None else fastest_mps
        place = _OdometerPlace(distance_m, located_m)
        self._follow(time_s, place, speed_mps, carrier_hz)
        if fields is not None and carrier_hz is not None:
            self._take(time_s, self._scales.read(fields))
        lost = self._overdue(time_s)
        permitted_mps = self._permitted_mps(place)
        if not lost:
            self._lost = None
        else:
            if self._lost is None:
                self._lost = time_s, fastest
            permitted_mps = min(permitted_mps, self._stopping_mps(time_s))
        return self._judge(fastest, speed_mps <= STANDSTILL_MPS, permitted_mps, lost=lost)

    def _follow(
        self, time_s: float, place: _OdometerPlace, speed_mps: float, carrier_hz: float | None
    ) -> None:
        """Notice the entrance of a block by its carrier."""
        if carrier_hz is None:
            return
        if self._carrier_hz is not None and carrier_hz != self._carrier_hz:
            entry = self._before[0][1]
            # A block is at least as long as coded: a change before that, or a second one
            # without a code, is crosstalk, and then no entrance is known.
            believed = not self._awaiting and self._left_m(place) <= 0.0
            if believed and self._code is not None and self._code.end_mps <= 0.0:
                self._passed_stop |= speed_mps > STANDSTILL_MPS
            self._entry = entry if believed else None
            if not (self._awaiting or self._overdue(time_s)):
                # The new code is given its time once: flicker must not put it off indefinitely.
                self._code_s = time_s
            self._awaiting = True
            self._before.clear()
        self._carrier_hz = carrier_hz
        self._before.append((time_s, place))
        while len(self._before) > 1 and self._before[1][0] <= time_s - self._delays.notice_s:
            self._before.popleft()

    def _take(self, time_s: float, code: TrackCode) -> None:
        """Obey a valid code."""
        old = self._code
        if old is not None and not self._awaiting:
            same = (code.length_m, code.gradient_permil) == (old.length_m, old.gradient_permil)
            # Another block without a change of carrier: two entrances went by unnoticed.
            self._entry = self._entry if same else None
        self._code, self._code_s, self._awaiting = code, time_s, False

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

    def _permitted_mps(self, place: _OdometerPlace) -> float:
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
        left_m = self._left_m(place)
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
        too_fast = speed_mps > permitted_mps + limits.service_over_mps
        stop = permitted_mps <= 0.0
        below = max(permitted_mps - limits.release_under_mps, 0.5 * permitted_mps)
        if lost or stop or too_fast:
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
        return SupervisionOutput(
            permitted_mps,
            self._service or speed_mps > permitted_mps + limits.warn_over_mps,
            self._service,
            self._emergency,
            reason,
        )
