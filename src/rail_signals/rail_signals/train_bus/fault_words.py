"""A fault of a bus cable in words, and the one figure that tells how large it is."""

from __future__ import annotations

import math
from typing import Final

from rail_signals.train_bus.tdr.interpretation import Finding

SIZES: Final = {
    "open": ("", "", 1.0),
    "short": ("resistance_ohm", "ohm left", 1.0),
    "water_ingress": ("capacitance_rise", "% more capacitance", 100.0),
    "bad_splice": ("resistance_ohm", "ohm", 1.0),
    "wrong_cable": ("log_impedance", "% of impedance off", 100.0),
    "missing_shield_ground": ("log_impedance", "% more impedance", 100.0),
    "loose_connector": ("resistance_ohm", "ohm", 1.0),
}
"""Of each kind the value that is its size, its unit, and the scale of that."""


def size_of(finding: Finding) -> float:
    """Size of a fault, as a ratio where it is a fraction; NaN where it has none."""
    name, _, _ = SIZES[finding.kind]
    if not name:
        return math.nan
    value = finding.values[name]
    return math.expm1(value) if name.startswith("log_") else value


def fault_words(kind: str, car: int, place_m: float, size: float) -> str:
    """What, where and how large a fault is.

    Parameters
    ----------
    kind, car, place_m
        As of `Finding`; cars are counted from 0.
    size
        As of :func:`size_of`.

    Examples
    --------
    >>> fault_words("loose_connector", 1, 94.0, 1234.0)
    'loose connector behind car 2 at 94.0 m, 1200 ohm'
    """
    beside = "behind" if kind == "loose_connector" else "in"
    where = f"{kind.replace('_', ' ')} {beside} car {car + 1} at {place_m:.1f} m"
    if not math.isfinite(size):
        return where
    _, unit, scale = SIZES[kind]
    # Two digits, and never an exponent.
    return f"{where}, {float(f'{scale * size:.2g}'):g} {unit}"
