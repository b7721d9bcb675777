"""What supervision takes of a localizer: its interval, and the fastest the train may run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Final

from rail_msgs_py.topics.localizer import LOCALIZER_STATE

_COLUMNS: Final = tuple(
    LOCALIZER_STATE.index[name]
    for name in ("low_m", "high_m", "speed_mps", "speed_low_mps", "speed_high_mps")
)


@dataclass(frozen=True)
class LocatedFront:
    """Chainages between which the front is [m], and speeds [m/s].

    ``doubt_mps`` is by how much the fastest is above the speed that is believed.
    """

    low_m: float
    high_m: float
    fastest_mps: float
    doubt_mps: float

    @property
    def believed_mps(self) -> float:
        """The speed that is believed, without direction [m/s]."""
        return self.fastest_mps - self.doubt_mps

    @property
    def half_m(self) -> float:
        """Half of the interval [m]."""
        return 0.5 * (self.high_m - self.low_m)

    def travelled(self, direction: int) -> tuple[float, float]:
        """Least and most of the chainage that grows with the travel [m]; `direction` 1 or -1."""
        return (self.low_m, self.high_m) if direction > 0 else (-self.high_m, -self.low_m)


def protected_interval(row: Sequence[float] | None) -> LocatedFront | None:
    """What a row of a localizer says; None if it does not know, or not all.

    Parameters
    ----------
    row : float [column], or None
        Columns as `LOCALIZER_STATE.columns`.
    """
    if row is None:
        return None
    low_m, high_m, speed_mps, slowest_mps, fastest_mps = (row[at] for at in _COLUMNS)
    if not all(map(isfinite, (low_m, high_m, speed_mps, slowest_mps, fastest_mps))):
        return None
    most_mps = max(abs(slowest_mps), abs(fastest_mps))
    return LocatedFront(low_m, high_m, most_mps, max(0.0, most_mps - abs(speed_mps)))
