"""What all equipment on trains assumes of the same things."""

from __future__ import annotations

from typing import Final

#: Distances and fixes may be off by this many standard deviations.
SIGMAS: Final = 4.0
#: What the dispatcher knows of where a train is when it is put into service [m].
PLACED_M: Final = 1.0
