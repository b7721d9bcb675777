"""Compiled square root of complex numbers, exact in both parts."""

from __future__ import annotations

import math

from rail_signals.arrays import ComplexArray
from rail_signals.compiled import compiled


@compiled
def principal_roots(value: ComplexArray, root: ComplexArray) -> None:
    """Write the principal square roots of values [n] whose squares are in range."""
    for n in range(len(value)):
        re, im = value[n].real, value[n].imag
        large = math.sqrt((math.sqrt(re * re + im * im) + abs(re)) * 0.5)
        small = abs(im) * 0.5 / large if large > 0.0 else 0.0
        across = large if re >= 0.0 else small
        along = small if re >= 0.0 else large
        root[n] = complex(across, math.copysign(along, im))
