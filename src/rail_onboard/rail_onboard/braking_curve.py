"""Guaranteed braking over a gradient profile, in closed form from piece to piece.

**A deceleration curve** (EBD of the emergency brake, SBD of the service brake) ends at its foot
with the speed e and rises backwards from there. Where the gradient G and the rate b(v) of a band
of speeds are constant, the deceleration d = b + g G is, and

    v(s)^2 = v0^2 + 2 d (s0 - s)

up to the next corner: where another gradient begins, or another band of speeds. So the curve is
exact, and falls with the way as long as d is above zero, which is asked of every piece.

**Until the brake acts** a train measured at v runs on. At the worst it is faster, V = (1 + x) v;
its motors pull by A for the time T_t until traction is cut off, and a fall adds a_g for the time T
until the brake has its force. It reaches the curve with

    w = V + A T_t + a_g T,    after    D = w T - A T_t^2 / 2 - a_g T^2 / 2.

**A brake that builds up** linearly over B counts as one that comes with its full force after B/2.
With h the excess of the curve's v^2/2 over that of the train, dh/ds = -b (1 - t/B) as both see the
same gradient at the same place; what the ramp takes from h is at most b w0 B/2 + b a_g B^2/6 - b^2
B^2/24 (w0 the speed at its start), what B/2 of waiting leaves for it is b w0 B/2 + b a_g B^2/8,
which is no less while b is above a_g, as asked. With several bands of speed B counts in full.

D is linear in w: the speed v from which a curve is just reached follows from a quadratic in the
piece on which the train lands; which one that is, the corners tell, walked backwards from the foot.

The factors of a rate: the rate guaranteed with the probability asked for is Kdry(v) times that of a
train in good order on dry rails, and (Kwet + M (1 - Kwet)) times that on wet ones (SUBSET-026,
3.13.6.2.1 [M]); M = 0 here, no credit for good adhesion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, sqrt
from typing import NamedTuple

from rail_signals.track_code.scales import LEAST_BRAKING_MPS2, deceleration_mps2

from .gradient_profile import LEVEL, GradientProfile, WidthGradients

Rates = tuple[tuple[float, float], ...]
"""Bands of speed: the speed [m/s] up to which a rate [m/s^2] holds, rising; the last is
infinite."""


def corrected(rates: Rates, confidence: float, adhesion: float) -> Rates:
    """Rates with the factors of confidence (Kdry) and of adhesion on wet rails (Kwet).

    >>> corrected(((inf, 1.0),), 0.9, 0.8)
    ((inf, 0.7200000000000001),)
    """
    return tuple((up_to, rate * confidence * adhesion) for up_to, rate in rates)


def least_rate(rates: Rates, low_mps: float, high_mps: float) -> float:
    """Least rate of a range of speeds [m/s^2]."""
    below_mps, least = 0.0, inf
    for up_to_mps, rate in rates:
        if below_mps <= high_mps and up_to_mps >= low_mps:
            least = min(least, rate)
        below_mps = up_to_mps
    return least


def _bands(name: str, rates: float | Rates) -> Rates:
    bands: Rates = ((inf, float(rates)),) if isinstance(rates, int | float) else tuple(rates)
    speeds = [up_to for up_to, _ in bands]
    if not bands or speeds != sorted(set(speeds)) or not speeds[0] > 0.0 or speeds[-1] != inf:
        raise ValueError(f"{name}: {bands} are not bands of rising speed up to infinity")
    if not all(0.0 < rate < inf for _, rate in bands):
        raise ValueError(f"{name}: {rates} is not above zero")
    return bands


class Lag(NamedTuple):
    """What happens between a measured speed and the brake, at the worst.

    ``wait_s`` is the time of D above, ``spared_m`` what is less in it than w T, ``gained_mps`` is
    w - V; a train within ``ahead_s`` of the curve, or ``over_mps`` too fast, is on it already.
    """

    wait_s: float
    spared_m: float
    gained_mps: float
    ahead_s: float = 0.0
    over_mps: float = 0.0


@dataclass(frozen=True)
class GuaranteedBraking:
    """What a train's brakes do at the worst.

    Parameters
    ----------
    service_mps2, emergency_mps2 : float or Rates
        Guaranteed brake rate on level track (GEBR of IEEE 1474.1), a number or bands of speed;
        the emergency brake is nowhere weaker.
    gradients : GradientProfile
        Of the track, along the direction of travel.
    delay_s : float
        From a measurement of the speed that gives no cause for the brake until the brake, which
        the next one demands, begins to act: the time from measurement to measurement, from there
        to the command in force, and the dead time of the brake.
    cut_off_s : float, optional
        The same until the motors pull no more; not longer than ``delay_s``, and that without.
    build_up_s : float
        From there to the full force, a ramp.
    traction_mps2 : float
        Acceleration that may go on until traction is cut off, on level track.
    speed_error : float
        By how much the true speed may exceed the measured one, relative to that.

    Raises
    ------
    ValueError
        If a parameter is out of range, or a fall leaves too little of the service brake.

    Examples
    --------
    >>> braking = GuaranteedBraking(service_mps2=0.5, delay_s=1.0, traction_mps2=0.0)
    >>> braking.stopping_m(20.0)
    420.0
    >>> braking.speed_mps(420.0)
    20.0
    """

    service_mps2: float | Rates = 0.7
    emergency_mps2: float | Rates = 0.9
    gradients: GradientProfile = LEVEL
    delay_s: float = 1.0
    cut_off_s: float | None = None
    build_up_s: float = 0.0
    traction_mps2: float = 0.5
    speed_error: float = 0.0
    #: Bands of speed of the two brakes.
    service: Rates = field(init=False, repr=False)
    emergency: Rates = field(init=False, repr=False)

    def __post_init__(self) -> None:
        service = _bands("service_mps2", self.service_mps2)
        emergency = _bands("emergency_mps2", self.emergency_mps2)
        below_mps = 0.0
        for up_to_mps, rate in emergency:
            # A rate holds in (below, up to]: at the border itself only the lower band counts.
            low_mps = below_mps + 1e-9
            if rate < max(
                r for up, r in service if up >= low_mps and _from(service, up) < up_to_mps
            ):
                raise ValueError(f"emergency_mps2: {rate} is weaker than service_mps2")
            below_mps = up_to_mps
        for name in ("delay_s", "build_up_s", "traction_mps2"):
            value = getattr(self, name)
            if not 0.0 <= value < inf:
                raise ValueError(f"{name}: {value} is negative or not finite")
        if self.cut_off_s is not None and not 0.0 <= self.cut_off_s <= self.delay_s:
            raise ValueError(f"cut_off_s: {self.cut_off_s} is not from 0 to delay_s")
        if not 0.0 <= self.speed_error < 1.0:
            raise ValueError(f"speed_error: {self.speed_error} is not from 0 to below 1")
        object.__setattr__(self, "service", service)
        object.__setattr__(self, "emergency", emergency)
        if not self.service_deceleration_mps2 >= LEAST_BRAKING_MPS2:
            fall = self.gradients.steepest_fall_permil
            raise ValueError(f"fall_permil: {fall:g} leaves too little of the brake")

    @property
    def service_deceleration_mps2(self) -> float:
        """Least deceleration by the service brake: its least rate, on the steepest fall."""
        return self._least(self.service)

    @property
    def emergency_deceleration_mps2(self) -> float:
        """Least deceleration by the emergency brake."""
        return self._least(self.emergency)

    def _least(self, rates: Rates) -> float:
        rate = min(rate for _, rate in rates)
        return deceleration_mps2(rate, -self.gradients.steepest_fall_permil)

    @property
    def gathering_mps2(self) -> float:
        """Most acceleration before a brake acts, on the steepest fall."""
        return self.traction_mps2 + self.gradients.gathered_mps2(-inf, inf)

    @property
    def full_force_s(self) -> float:
        """Time from a measurement to the full force of the brake."""
        return self.delay_s + self.build_up_s

    def lag(
        self,
        rates: Rates,
        fall_mps2: float,
        *,
        later_s: float = 0.0,
        ahead_s: float = 0.0,
        over_mps: float = 0.0,
    ) -> Lag:
        """Lag of a brake on a fall, ``later_s`` longer; ``ahead_s``, ``over_mps`` as in `Lag`."""
        pull_s = self.delay_s if self.cut_off_s is None else self.cut_off_s
        build_up_s = self.build_up_s * (0.5 if len(rates) == 1 else 1.0)
        wait_s = self.delay_s + later_s + build_up_s
        gained_mps = self.traction_mps2 * pull_s + fall_mps2 * wait_s
        spared_m = 0.5 * (self.traction_mps2 * pull_s**2 + fall_mps2 * wait_s**2)
        return Lag(wait_s, spared_m, gained_mps, ahead_s, over_mps)

    def curve_mps(
        self,
        rates: Rates,
        gradients: WidthGradients,
        foot_m: float,
        foot_mps: float,
        front_m: float,
        lag: Lag,
    ) -> float:
        """Measured speed from which a brake, after the lag, meets the curve to a foot.

        Parameters
        ----------
        rates, gradients
            Of the brake, and of the track under the train.
        foot_m, foot_mps : float
            Where the curve ends, along the direction of travel, and with what true speed.
        front_m : float
            The front.
        lag : Lag

        Returns
        -------
        float
            Negative where no speed is low enough.
        """
        scale = 1.0 + self.speed_error
        ahead_s, wait_s = lag.ahead_s / scale, lag.wait_s
        time_s = wait_s + ahead_s
        shift_m = lag.spared_m + ahead_s * lag.gained_mps + lag.ahead_s * lag.over_mps
        piece, band = gradients.piece(foot_m), _band(rates, foot_mps)
        s, square = foot_m, foot_mps * foot_mps
        while True:
            d = deceleration_mps2(rates[band][1], gradients.permil[piece])
            d = max(d, LEAST_BRAKING_MPS2)
            start_m, up_to_mps = gradients.starts_m[piece], rates[band][0]
            at_start = square + 2.0 * d * (s - start_m)
            by_speed = up_to_mps * up_to_mps <= at_start
            corner = up_to_mps * up_to_mps if by_speed else at_start
            corner_m = s - (corner - square) / (2.0 * d) if by_speed else start_m
            if corner == inf or corner_m - sqrt(corner) * time_s + shift_m <= front_m:
                break
            s, square = corner_m, corner
            piece, band = piece - (not by_speed), band + by_speed
        root = (d * time_s) ** 2 + square + 2.0 * d * (s + shift_m - front_m)
        landing_mps = sqrt(root) - d * time_s if root > 0.0 else -inf
        if landing_mps == -inf:
            return -inf
        return (landing_mps - lag.gained_mps) / scale - lag.over_mps

    def way_m(
        self,
        rates: Rates,
        gradients: WidthGradients,
        foot_m: float,
        speed_mps: float,
        lag: Lag,
    ) -> float:
        """Way to a stand at a foot from a measured speed, with the lag."""
        true_mps = (1.0 + self.speed_error) * (speed_mps + lag.over_mps)
        landing_mps = true_mps + lag.gained_mps
        waited_m = landing_mps * lag.wait_s - lag.spared_m + speed_mps * lag.ahead_s
        piece, band, s, square = gradients.piece(foot_m), 0, foot_m, 0.0
        target = landing_mps * landing_mps
        while True:
            d = deceleration_mps2(rates[band][1], gradients.permil[piece])
            d = max(d, LEAST_BRAKING_MPS2)
            at_start = square + 2.0 * d * (s - gradients.starts_m[piece])
            at_band = rates[band][0] ** 2
            if target <= min(at_start, at_band):
                return foot_m - s + (target - square) / (2.0 * d) + waited_m
            if at_band <= at_start:
                s, square, band = s - (at_band - square) / (2.0 * d), at_band, band + 1
            else:
                s, square, piece = gradients.starts_m[piece], at_start, piece - 1

    def stopping_m(self, speed_mps: float, *, emergency: bool = False) -> float:
        """Way from a measured speed to a stand, on the steepest fall all the way."""
        rates, fall = self._rates(emergency), self._steepest()
        return self.way_m(rates, fall, 0.0, speed_mps, self._worst_lag(rates))

    def speed_mps(
        self, distance_m: float, end_mps: float = 0.0, *, emergency: bool = False
    ) -> float:
        """Measured speed that a brake brings to ``end_mps`` after a way, on the steepest fall."""
        rates, fall = self._rates(emergency), self._steepest()
        lag = self._worst_lag(rates)
        return self.curve_mps(rates, fall, 0.0, end_mps, -max(0.0, distance_m), lag)

    def _rates(self, emergency: bool) -> Rates:
        return self.emergency if emergency else self.service

    def _worst_lag(self, rates: Rates) -> Lag:
        return self.lag(rates, self.gradients.gathered_mps2(-inf, inf))

    def _steepest(self) -> WidthGradients:
        return WidthGradients([-inf], [-self.gradients.steepest_fall_permil], 0.0)


def _from(rates: Sequence[tuple[float, float]], up_to_mps: float) -> float:
    """Speed at which the band that ends there begins."""
    return max((up for up, _ in rates if up < up_to_mps), default=0.0)


def _band(rates: Rates, speed_mps: float) -> int:
    """Band just above a speed."""
    return next(at for at, (up_to_mps, _) in enumerate(rates) if up_to_mps > speed_mps)
