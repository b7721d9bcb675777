"""Axles in a section between detection points, and whether it is free.

A section is *free* if as many axles have left it as have entered, no border has a wheel on it, and
nothing has happened that makes the count doubtful. It is *not known* from power-up on, and
whenever a border cannot tell what passed it or more axles have left than entered: until it has
been **reset**. A reset sets the count to zero, and is refused

- while a wheel is on one of its borders, or one of them does not work,
- if the last axle that was counted at its borders went in.

With `Reset.SWEEP` the section stays *not known* until a train has swept it: axles have entered
and all of them have left again. With `Reset.CONDITIONAL` it is free at once: whoever resets has
seen that it is empty. (Names and conditions as in the rules of infrastructure managers, such as
ARTC ESS-05-01 of 2024; which of them a railway uses differs.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum

from .axle_detector import Passages


class Occupancy(IntEnum):
    """What is reported of a section."""

    FREE = 0
    OCCUPIED = 1
    NOT_KNOWN = 2


class Reset(Enum):
    """What a reset makes of a section."""

    SWEEP = "sweep"
    CONDITIONAL = "conditional"


@dataclass(frozen=True)
class Section:
    """A section and the detection points at its borders.

    ``inward`` is +1 for a point that axles pass forward to enter, -1 for one that they pass
    backward.
    """

    name: str
    inward: Mapping[str, int]


class SectionCounter:
    """Counts the axles in one section.

    Parameters
    ----------
    section : Section
    """

    def __init__(self, section: Section) -> None:
        self.section = section
        self.axles = 0
        self._doubtful = True
        self._swept = self._entered = False
        self._quiet = False
        self._last_went_in = False

    @property
    def occupancy(self) -> Occupancy:
        """What is reported."""
        if self._doubtful or not self._swept:
            return Occupancy.NOT_KNOWN
        return Occupancy.FREE if self._quiet and not self.axles else Occupancy.OCCUPIED

    def update(self, passages: Mapping[str, Passages]) -> None:
        """Take what the points at the borders have seen in a tick; one left out does not work."""
        borders = [passages.get(point) for point in self.section.inward]
        works = all(border is not None and border.valid for border in borders)
        self._quiet = works and not any(border.busy for border in borders if border is not None)
        self._doubtful |= not works
        entered = left = 0
        for border, inward in zip(borders, self.section.inward.values(), strict=True):
            if border is not None:
                self._doubtful |= border.unclear > 0
                entered += border.forward if inward > 0 else border.backward
                left += border.backward if inward > 0 else border.forward
        self.axles += entered - left
        self._entered |= entered > 0
        if entered or left:
            self._last_went_in = entered > 0
        # More have left than have entered: some were not counted, or were there before.
        self._doubtful |= self.axles < 0
        self._swept |= self._entered and not self.axles and self._quiet

    def reset(self, how: Reset) -> bool:
        """Reset the section after an update; returns whether that was accepted."""
        if not self._quiet or self._last_went_in:
            return False
        self.axles = 0
        self._doubtful = self._entered = False
        self._swept = how is Reset.CONDITIONAL
        return True
