"""What supervision takes of a localizer: its interval, and the fastest the train may run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

from rail_msgs_py.topics.localizer import LOCALIZER_STATE


@dataclass(frozen=True)
class Located:
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
        """Least and most of the way that grows with the travel [m]; `direction` 1 or -1."""
        return (self.low_m, self.high_m) if direction > 0 else (-self.high_m, -self.low_m)


def located(figures: Sequence[float] | None) -> Located | None:
    """What a row of a localizer says; None if it does not know.

    Parameters
    ----------
    figures : float [column], or None
        Columns as `LOCALIZER_STATE.columns`.
    """
    if figures is None:
        return None
    low_m, high_m = (
        figures[LOCALIZER_STATE.index["low_m"]],
        figures[LOCALIZER_STATE.index["high_m"]],
    )
    if not (isfinite(low_m) and isfinite(high_m)):
        return None
    bounds = (
        figures[LOCALIZER_STATE.index["speed_low_mps"]],
        figures[LOCALIZER_STATE.index["speed_high_mps"]],
    )
    fastest_mps = max(abs(bound) for bound in bounds)
    doubt_mps = max(0.0, fastest_mps - abs(figures[LOCALIZER_STATE.index["speed_mps"]]))
    return Located(low_m, high_m, fastest_mps, doubt_mps)
