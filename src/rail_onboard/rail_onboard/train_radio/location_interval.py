"""Intervals of the front of a train, and how many ranges are needed to believe one."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple


class Confirmation(NamedTuple):
    """Ranges in a row, and the time that they must span [s]."""

    ranges: int
    span_s: float


LOCATING: Final = Confirmation(3, 1.0)
DOUBTED: Final = Confirmation(3, 1.0)
DRIFTED: Final = Confirmation(10, 10.0)
#: An unseen slide or spin miscounts at most this part of the way, and so much besides [m].
UNSEEN_PART: Final = 0.5
UNSEEN_M: Final = 20.0
#: Ranges are compared with what the wheels counted between them over such times [s].
WINDOW_S: Final = 4.0
LONGEST_WINDOW_S: Final = 60.0
#: Way that proves that the wheels count, and one that tells that the train stands [m].
PROVING_M: Final = 60.0
SAME_PLACE_M: Final = 0.2


@dataclass(slots=True)
class Interval:
    """Interval of s at the latest reading, and the ranges in a row that it stands on."""

    low_m: float
    high_m: float
    ranges: int = 1
    since_s: float = 0.0

    @property
    def width_m(self) -> float:
        """Its width [m]."""
        return self.high_m - self.low_m

    def overlaps(self, low_m: float, high_m: float) -> bool:
        """Whether it has a place in common with another."""
        return low_m <= self.high_m and high_m >= self.low_m

    def take(self, low_m: float, high_m: float) -> None:
        """Intersect it with one that overlaps it, if that is narrower."""
        if high_m - low_m < self.width_m:
            self.low_m, self.high_m = max(low_m, self.low_m), min(high_m, self.high_m)


@dataclass(frozen=True, slots=True)
class Location:
    """Place of the front of a train.

    Parameters
    ----------
    position_m : float
        Chainage.
    uncertainty_m : float
        The front is within ``position_m`` ± this.
    valid : bool
        Whether the two mean anything.
    """

    position_m: float
    uncertainty_m: float
    valid: bool


#: Nothing is known.
NOWHERE = Location(0.0, inf, False)
