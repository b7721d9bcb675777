"""Physical constants."""

from __future__ import annotations

from typing import Final

SPEED_OF_LIGHT_M_PER_S: Final = 299_792_458.0
"""Speed of light in vacuum [m/s], exact by definition of the metre."""
