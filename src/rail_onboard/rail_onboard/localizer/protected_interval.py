"""What supervision takes of a localizer: its interval, and how fast the train may run.

Wheels creep while they pull or brake. A limit is compared with the **estimated** speed, that of the
wheels, as in the ETCS braking model (SUBSET-026, 3.13.10.3); the doubt is made up for where it
could do harm, **in the braking distance**, as the speed under-reading there. With a train at v that
may be d faster, a brake b that acts after T, and D(v) = v T + v^2 / (2 b), the place from which it
must be able to stop is ahead by

    D(v + d) - D(v) = d (T + (v + d / 2) / b).

Once the wheels slip or slide, or may be faulty, they are no estimate: the localizer's takes their
place, and limits are compared with the fastest that the train may run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final

from rail_msgs_py.topics.localizer import LOCALIZER_STATE

_COLUMNS: Final = tuple(
    LOCALIZER_STATE.index[name]
    for name in ("low_m", "high_m", "speed_mps", "fastest_mps", "wheels_doubted")
)


@dataclass(frozen=True)
class LocatedFront:
    """Chainages between which the front is [m], and speeds without direction [m/s].

    ``located_mps`` is the localizer's estimate, ``most_mps`` the fastest that the train may run;
    ``wheels_doubted`` tells whether the wheels are no estimate.
    """

    low_m: float
    high_m: float
    located_mps: float
    most_mps: float
    wheels_doubted: bool = False

    def speeds(self, wheels_mps: float) -> tuple[float, float]:
        """Estimated speed, and the one to be compared with limits, by the wheels' speed [m/s]."""
        if self.wheels_doubted:
            return self.located_mps, self.most_mps
        return abs(wheels_mps), abs(wheels_mps)

    @property
    def half_m(self) -> float:
        """Half of the interval [m]."""
        return 0.5 * (self.high_m - self.low_m)

    def braking_m(self, supervised_mps: float, deceleration_mps2: float, delay_s: float) -> float:
        """By how much farther the train may run until it stands than at a speed [m].

        Parameters
        ----------
        supervised_mps : float
            The speed that is compared with limits.
        deceleration_mps2, delay_s : float
            That the brake is good for, and the time until it acts.
        """
        doubt_mps = max(0.0, self.most_mps - supervised_mps)
        return doubt_way_m(doubt_mps, supervised_mps, deceleration_mps2, delay_s)

    def travelled(self, direction: int) -> tuple[float, float]:
        """Least and most of the chainage that grows with the travel [m]; `direction` 1 or -1."""
        return (self.low_m, self.high_m) if direction > 0 else (-self.high_m, -self.low_m)


def doubt_way_m(
    doubt_mps: float, supervised_mps: float, deceleration_mps2: float, delay_s: float
) -> float:
    """The way d (T + (v + d / 2) / b) that a train needs more which may run d faster than v [m]."""
    return doubt_mps * (delay_s + (supervised_mps + 0.5 * doubt_mps) / deceleration_mps2)


def protected_interval(row: Sequence[float] | None) -> LocatedFront | None:
    """What a row of a localizer says; None if it does not know, or not all.

    Parameters
    ----------
    row : float [column], or None
        Columns as `LOCALIZER_STATE.columns`.
    """
    if row is None:
        return None
    low_m, high_m, speed_mps, fastest_mps, doubted = (row[at] for at in _COLUMNS)
    if not all(map(isfinite, (low_m, high_m, speed_mps, fastest_mps, doubted))):
        return None
    return LocatedFront(low_m, high_m, abs(speed_mps), fastest_mps, doubted > 0.0)
