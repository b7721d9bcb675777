"""Quantities of the localizer."""

from __future__ import annotations

from typing import Final

from rail_msgs_py.quantity import Quantity

INTEGRITY_RISK: Final = Quantity(
    1e-5, "probability that the error exceeds the protection level", low=1e-9, high=1e-2
)
