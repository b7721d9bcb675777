"""Whether the wheels can be believed: their speed against what brakes and traction can do.

Wheels that begin to slide or spin change their speed faster than the train can. That step is the
evidence; afterwards sliding wheels may look as good as any. From it on, the speed of the train is
taken to be the most that physics allows,

    fastest' = + most_traction      while brakes are not yet in force
             = - guaranteed         once a brake has been demanded for its dead time

and the way run to be its integral. The wheels are believed again when the steps together make up
a ratio of 1 (they roll again), or a whole block was as long by them as its code says. Wheels that
slide from a speed so low that the step is within what brakes can do are not noticed by it, only at
the next entrance of a block.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Final

#: Uncertainty of a step of the wheels' speed besides what physics allows [m/s].
_STEP_MPS: Final = 0.1
#: Ratio of the wheels' speed to that of the train that passes for 1, besides a step's own doubt.
_RATIO: Final = 0.03
#: Above this doubt a step tells nothing of the ratio.
_MOST_DOUBT: Final = 0.15


class WheelCheck:
    """Speed and way of a train that its wheels may tell wrongly.

    Parameters
    ----------
    most_braking_mps2, most_traction_mps2 : float
        The most that the train can slow down and gather, gradients included [m/s^2].
    brake_s : float
        From a demand until the brake has its guaranteed force [s].

    Attributes
    ----------
    trusted : bool
    fastest_mps, run_m : float
        The most of speed and of way.
    speed_mps : float
        By the wheels.

    Examples
    --------
    >>> wheels = WheelCheck(most_braking_mps2=1.5, most_traction_mps2=1.0)
    >>> wheels.update(0.0, 0.0, 20.0), wheels.update(0.5, 10.0, 10.0), wheels.trusted
    (20.0, 20.5, False)
    >>> wheels.update(1.0, 20.0, 20.0), wheels.trusted
    (20.0, True)
    """

    def __init__(
        self, *, most_braking_mps2: float, most_traction_mps2: float, brake_s: float = 1.0
    ) -> None:
        if not 0.0 < min(most_braking_mps2, most_traction_mps2) < inf:
            raise ValueError(
                f"most_braking_mps2: {most_braking_mps2}, most_traction_mps2:"
                f" {most_traction_mps2}: must be above zero"
            )
        self._braking_mps2, self._traction_mps2 = most_braking_mps2, most_traction_mps2
        self._brake_s = brake_s
        self.reset()

    def reset(self) -> None:
        """Know nothing of before."""
        self.trusted = True
        self.fastest_mps = self.run_m = self.speed_mps = 0.0
        self._ratio = 1.0  # of the wheels to the train, as their steps tell
        self._last: tuple[float, float, float] | None = None  # time, distance and speed of wheels
        self._braked_s = 0.0  # for how long a brake has been demanded

    def update(
        self,
        time_s: float,
        distance_m: float,
        speed_mps: float,
        *,
        braked: bool = False,
        guaranteed_mps2: float = 0.0,
    ) -> float:
        """The fastest that the train may run [m/s].

        Parameters
        ----------
        time_s, distance_m, speed_mps : float
            By the wheels.
        braked : bool
            Whether a brake has been demanded since the update before.
        guaranteed_mps2 : float
            What it gives where the train is.
        """
        self.speed_mps = speed_mps
        if self._last is None:
            self._last = time_s, distance_m, speed_mps
            self.fastest_mps = speed_mps
            return speed_mps
        dt_s = max(0.0, time_s - self._last[0])
        run_m, before_mps = max(0.0, distance_m - self._last[1]), self._last[2]
        self._last = time_s, distance_m, speed_mps
        self._braked_s = self._braked_s + dt_s if braked else 0.0
        slower, faster = self._braking_mps2 * dt_s, self._traction_mps2 * dt_s
        step_mps = speed_mps - before_mps
        if not -slower - _STEP_MPS <= step_mps <= faster + _STEP_MPS:
            self._take_step(before_mps, speed_mps, max(slower, faster))
        if self.trusted:
            self.fastest_mps = speed_mps
            self.run_m += run_m
            return speed_mps
        most_mps = self.fastest_mps
        if self._braked_s > self._brake_s:
            self.fastest_mps = max(0.0, most_mps - guaranteed_mps2 * dt_s)
        else:
            self.fastest_mps = most_mps + faster
        if self._ratio <= 1.0:
            # Wheels that slide turn too slowly: the train is no slower than they say.
            self.fastest_mps = max(self.fastest_mps, speed_mps)
        self.run_m += max(run_m, most_mps * dt_s, self.fastest_mps * dt_s)
        return self.fastest_mps

    def doubt(self, fastest_mps: float) -> None:
        """Do not believe the wheels: a block was too short by them.

        Parameters
        ----------
        fastest_mps : float
            The fastest that the train may run now.
        """
        self.trusted, self._ratio = False, 0.0
        self.fastest_mps = max(self.fastest_mps, fastest_mps)

    def fastest_from_stand_mps(self, way_m: float) -> float:
        """The fastest after a way from a stand [m/s]."""
        return sqrt(2.0 * self._traction_mps2 * way_m)

    def trust(self) -> None:
        """Believe the wheels: by them a whole block was as long as it is."""
        self.trusted, self._ratio = True, 1.0

    def _take_step(self, before_mps: float, speed_mps: float, doubt_mps: float) -> None:
        least_mps = min(before_mps, speed_mps)
        doubt = (doubt_mps + _STEP_MPS) / least_mps if least_mps > 0.0 else inf
        if doubt > _MOST_DOUBT:
            # No ratio can be told of them: only a block can make them trusted again.
            self._ratio = 0.0
        else:
            self._ratio *= speed_mps / before_mps
        self.trusted = abs(self._ratio - 1.0) <= _RATIO + min(doubt, _MOST_DOUBT)
