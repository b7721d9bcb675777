"""Integration tests of equipment against the corridor: see `rail_testing.corridor.Corridor`.

With pytest, the fixture ``corridor`` makes them and closes them by itself.
"""

from .corridor import Corridor
from .interception import Late
from .outcome import Outcome
from .repeatability import Difference, first_difference

__all__ = ["Corridor", "Difference", "Late", "Outcome", "first_difference"]
