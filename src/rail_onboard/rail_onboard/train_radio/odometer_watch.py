"""The odometer against what a train can physically do: slide and spin are told by their step.

Wheels that begin to slide or to spin, and wheels that catch hold again, change their speed by more
than the brakes, the motors and the gradient can change that of the train. With v the speed shown,
e the error of the wheels and t the time from reading to reading,

    v' < v - (1 + e) b t - q    or    v' > v + (1 + e) a t + q

is no motion of a train whose greatest deceleration is b and whose greatest acceleration is a; q is
what readings are rounded by. Neither is a way in that time that is shorter than that of a train
which brakes with b and then gathers a, or longer than that of one which does it the other way
round: so wheels that slide from within a long tick on are seen even where the speeds could be those
of a train that brakes. From there on the odometer is **in doubt**, and the speed of the train
is bounded by physics from the greater and the smaller of the two readings on:

- it rises by a at most, or, once the brakes have been demanded for their dead time, falls by what
  they give for sure at least;
- it falls by b at most.

So a train that is made to brake in doubt comes to a stand within the way that every train is given
by the supervision, whatever its wheels show. The doubt ends where physics has brought the train to
a stand, and it may start again; but the wheels may go on to slide then, without a step that tells.
So they are **unproven**, and the bounds stay those of physics, until ranges have shown that they
count what the train runs.

A slide that begins so slowly that it could be braking is not seen here, nor is one of a train that
hardly moves: for these there are the ranges (see ``train_location``).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from rail_onboard.track_code.supervision import STANDSTILL_MPS

#: By how much a reading of the speed may be rounded [m/s].
_ROUNDING_MPS = 0.05
#: By how much a way counted may be [m].
_ROUNDING_M = 0.05


@dataclass(frozen=True, slots=True)
class RunningLimits:
    """What a train can do at the most, and its brakes at the least.

    Parameters
    ----------
    accelerating_mps2, braking_mps2 : float
        No train gathers or loses speed faster, gradients and resistance included.
    sure_braking_mps2 : float
        Deceleration that a demand of the brake gives for sure.
    delay_s : float
        From that demand to the full force.
    fastest_mps : float
        Speed that it never exceeds.

    Raises
    ------
    ValueError
        If a value is not above zero, or the delay negative.
    """

    accelerating_mps2: float = 1.5
    braking_mps2: float = 2.0
    sure_braking_mps2: float = 0.7
    delay_s: float = 1.0
    fastest_mps: float = 100.0

    def __post_init__(self) -> None:
        for name in ("accelerating_mps2", "braking_mps2", "sure_braking_mps2", "fastest_mps"):
            if not 0.0 < getattr(self, name) < inf:
                raise ValueError(f"{name}: {getattr(self, name)} is not above zero")
        if not 0.0 <= self.delay_s < inf:
            raise ValueError(f"delay_s: {self.delay_s} is negative or not finite")


def least_way_m(
    elapsed_s: float,
    before_mps: float,
    after_mps: float,
    *,
    losing_mps2: float,
    gaining_mps2: float,
) -> float:
    """Least way from one speed to another in a time: braking first, then gathering speed.

    Between speeds that are not that near to each other, that of the mean speed.

    Examples
    --------
    >>> round(least_way_m(2.0, 10.0, 10.0, losing_mps2=1.0, gaining_mps2=1.0), 6)
    19.0
    >>> least_way_m(10.0, 1.0, 2.0, losing_mps2=1.0, gaining_mps2=2.0)  # it stands in between
    1.5
    """
    total = losing_mps2 + gaining_mps2
    braking_s = (before_mps - after_mps + gaining_mps2 * elapsed_s) / total
    if not 0.0 <= braking_s <= elapsed_s:
        return 0.5 * (before_mps + after_mps) * elapsed_s
    lowest_mps = before_mps - losing_mps2 * braking_s
    if lowest_mps < 0.0:
        return 0.5 * (before_mps**2 / losing_mps2 + after_mps**2 / gaining_mps2)
    gathering_s = elapsed_s - braking_s
    return (
        0.5 * (before_mps + lowest_mps) * braking_s + 0.5 * (lowest_mps + after_mps) * gathering_s
    )


class OdometerWatch:
    """Bounds of the way and speed of a train from its odometer and from physics.

    Parameters
    ----------
    error : float
        Bound of the relative error of distances, below 1.
    limits : RunningLimits, optional
        Without them the odometer is believed.

    Examples
    --------
    >>> watch = OdometerWatch(0.0, RunningLimits(delay_s=0.0))
    >>> watch.step(0.0, 0.0, 20.0, False), watch.step(0.5, 10.0, 20.0, False)
    ((0.0, 0.0), (10.0, 10.0))
    >>> watch.step(0.5, 6.0, 12.0, True), watch.doubted
    ((5.5, 10.0), True)
    """

    def __init__(self, error: float, limits: RunningLimits | None = None) -> None:
        self._error, self._limits = error, limits
        self.reset()

    def reset(self) -> None:
        """Forget everything, as when switched on."""
        #: Whether the train has to be braked because of its wheels.
        self.doubted = False
        #: Whether place and speed are bounded by physics, doubted or not.
        self.unproven = False
        #: Speed before and after the step of this reading; None if it showed none.
        self.stepped: tuple[float, float] | None = None
        self._speed_mps: float | None = None
        self._low_mps = self._high_mps = 0.0
        self._braked_s = 0.0

    @property
    def fastest_mps(self) -> float:
        """The fastest that the train may run, by its wheels or, in doubt, by physics [m/s]."""
        shown = self._speed_mps or 0.0
        return max(shown, self._high_mps) if self.unproven else shown

    def step(
        self, elapsed_s: float, counted_m: float, speed_mps: float, braked: bool
    ) -> tuple[float, float]:
        """Least and most that the train has run since the last reading [m].

        Parameters
        ----------
        elapsed_s : float
            Since the last reading; of no meaning at the first one.
        counted_m, speed_mps : float
            Way counted since then, and speed shown now, neither negative.
        braked : bool
            Whether a brake has been demanded since then.
        """
        before_mps, self._speed_mps = self._speed_mps, speed_mps
        self.stepped = None
        if before_mps is None or self._limits is None or elapsed_s <= 0.0:
            return self._counted(counted_m)
        self._braked_s = self._braked_s + elapsed_s if braked else 0.0
        if self._impossible(before_mps, speed_mps, elapsed_s) or not self._joins(
            before_mps, speed_mps, counted_m, elapsed_s
        ):
            self.stepped = before_mps, speed_mps
            self._widen(before_mps, speed_mps)
        if not self.unproven:
            return self._counted(counted_m)
        run_m = self._run(elapsed_s)
        if self._high_mps <= 0.0 and speed_mps <= STANDSTILL_MPS:
            self.doubted = False
        return run_m

    def suspect(self) -> None:
        """Take the odometer to be wrong from now on, though it showed no step."""
        if self._limits is not None and self._speed_mps is not None:
            self._widen(self._speed_mps, self._speed_mps)

    def trust(self) -> None:
        """Believe the wheels again: ranges have shown that they count what the train runs."""
        self.doubted = self.unproven = False

    def bound(self, fastest_mps: float) -> None:
        """Take note that ranges have shown that the train is no faster [m/s]."""
        self._high_mps = min(self._high_mps, fastest_mps)

    def _counted(self, counted_m: float) -> tuple[float, float]:
        return (1.0 - self._error) * counted_m, (1.0 + self._error) * counted_m

    def _impossible(self, before_mps: float, speed_mps: float, elapsed_s: float) -> bool:
        assert self._limits is not None
        scaled_s = (1.0 + self._error) * elapsed_s
        lost_mps = self._limits.braking_mps2 * scaled_s + _ROUNDING_MPS
        gained_mps = self._limits.accelerating_mps2 * scaled_s + _ROUNDING_MPS
        return not before_mps - lost_mps <= speed_mps <= before_mps + gained_mps

    def _joins(
        self, before_mps: float, speed_mps: float, counted_m: float, elapsed_s: float
    ) -> bool:
        """Whether a train can have run a way in a time from one speed to another."""
        assert self._limits is not None
        most = 1.0 + self._error
        loses, gains = most * self._limits.braking_mps2, most * self._limits.accelerating_mps2
        slack_m = _ROUNDING_M + _ROUNDING_MPS * elapsed_s
        least_m = least_way_m(
            elapsed_s, before_mps, speed_mps, losing_mps2=loses, gaining_mps2=gains
        )
        if counted_m < least_m - slack_m:
            return False
        # Seen from one that runs ahead of it, the most is the least.
        ahead_mps = max(before_mps, speed_mps) + gains * elapsed_s
        behind_m = least_way_m(
            elapsed_s,
            ahead_mps - before_mps,
            ahead_mps - speed_mps,
            losing_mps2=gains,
            gaining_mps2=loses,
        )
        most_m = ahead_mps * elapsed_s - behind_m
        return counted_m <= most_m + slack_m

    def _widen(self, one_mps: float, other_mps: float) -> None:
        """Doubt the odometer: the train had one of two speeds, or one between."""
        assert self._limits is not None
        low_mps = (1.0 - self._error) * min(one_mps, other_mps)
        high_mps = (1.0 + self._error) * max(one_mps, other_mps)
        if self.unproven:
            low_mps, high_mps = min(low_mps, self._low_mps), max(high_mps, self._high_mps)
        self.doubted = self.unproven = True
        self._low_mps, self._high_mps = low_mps, min(high_mps, self._limits.fastest_mps)

    def _run(self, elapsed_s: float) -> tuple[float, float]:
        """Run of a tick in doubt by the bounds of the speed, which go on to its end."""
        assert self._limits is not None
        limits = self._limits
        most_mps = self._high_mps
        if self._braked_s > limits.delay_s or (most_mps <= 0.0 and self._braked_s > 0.0):
            self._high_mps = max(0.0, most_mps - limits.sure_braking_mps2 * elapsed_s)
        else:
            gained_mps = limits.accelerating_mps2 * elapsed_s
            self._high_mps = min(limits.fastest_mps, most_mps + gained_mps)
            most_mps = self._high_mps
        self._low_mps = max(0.0, self._low_mps - limits.braking_mps2 * elapsed_s)
        return self._low_mps * elapsed_s, most_mps * elapsed_s
