"""Values of tables as people read them: a label, a value and its unit, from the column's name."""

from __future__ import annotations

import math
from typing import NamedTuple

#: Ending of a column's name, factor to the unit shown, the unit, digits after the point.
_UNITS: tuple[tuple[str, float, str, int], ...] = (
    ("_mps2", 1.0, "m/s²", 2),
    ("_mps", 3.6, "km/h", 1),
    ("_m2", 1.0, "m²", 3),
    ("_m", 1.0, "m", 2),
    ("_dbm", 1.0, "dBm", 1),
    ("_db", 1.0, "dB", 1),
    ("_hz", 1.0, "Hz", 1),
    ("_s", 1.0, "s", 2),
    ("_rad", 180.0 / math.pi, "°", 2),
    ("_kmh", 1.0, "km/h", 1),
    ("_permil", 1.0, "‰", 1),
    ("_ohm", 1.0, "Ω", 1),
    ("_v", 1.0, "V", 3),
    ("_ns", 1.0, "ns", 1),
    ("_deg", 1.0, "°", 2),
)
_YES_NO = {"valid", "warning", "service_brake", "emergency_brake", "occupied", "on_line", "known"}
#: Word in the names of columns that hold a ratio of powers.
_RATIO = "snr"


class ShownValue(NamedTuple):
    """One value as text; ``unit`` is empty where there is none."""

    label: str
    text: str
    unit: str


def shown_value(column: str, value: float) -> ShownValue:
    """A value of a table as text.

    >>> shown_value("speed_mps", 20.0)
    ShownValue(label='speed', text='72.0', unit='km/h')
    >>> shown_value("level_3_dbm", float("-inf"))
    ShownValue(label='level 3', text='none', unit='')
    """
    if column in _YES_NO:
        return ShownValue(_label(column), _yes_no(value), "")
    if _RATIO in column.split("_") and not column.endswith("_db"):
        text = f"{10.0 * math.log10(value):.1f}" if 0.0 < value < math.inf else "none"
        return ShownValue(_label(column), text, "dB" if text != "none" else "")
    for ending, factor, unit, digits in _UNITS:
        if column.endswith(ending):
            label = _label(column[: -len(ending)])
            if not math.isfinite(value):
                return ShownValue(label, "unlimited" if value > 0.0 else "none", "")
            return ShownValue(label, f"{value * factor:.{digits}f}".replace("-", "−"), unit)
    return ShownValue(_label(column), f"{value:.6g}" if math.isfinite(value) else "none", "")


def _label(name: str) -> str:
    return name.replace("_", " ").strip()


def _yes_no(value: float) -> str:
    if not math.isfinite(value):
        return "not known"
    return "yes" if value > 0.0 else "no"
