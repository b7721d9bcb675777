"""Numbers as whole steps of a stated resolution, rounded to the side that is asked for.

A number stands on the wire as an integer count of ``1 / per_unit``. What counts is the double
that the reader makes of it, ``count / per_unit``: "down" never lies above the value, "up" never
below it, without a tolerance, and a number that was read is written again as it was.
"""

from __future__ import annotations

import math


def down(value: float, per_unit: int) -> int:
    """Largest count whose value does not exceed `value`.

    >>> down(1.239, 100), down(-1.231, 100), down(0.29, 100)
    (123, -124, 29)
    """
    count = math.floor(value * per_unit)
    # The product is rounded: it may have crossed an integer either way.
    while count / per_unit > value:
        count -= 1
    while (count + 1) / per_unit <= value:
        count += 1
    return count


def up(value: float, per_unit: int) -> int:
    """Smallest count whose value is not below `value`.

    >>> up(1.231, 100), up(-1.239, 100)
    (124, -123)
    """
    return -down(-value, per_unit)


def nearest(value: float, per_unit: int) -> int:
    """Count whose value is closest, within half a step."""
    return round(value * per_unit)


def covering(
    middle: float, half: float, middle_per_unit: int, half_per_unit: int
) -> tuple[int, int]:
    """Counts of an interval's middle, to the nearest, and half-width, so that it covers the old.

    >>> covering(1234.567, 3.0, 100, 10)
    (123457, 31)
    """
    count = nearest(middle, middle_per_unit)
    shift = abs(middle - count / middle_per_unit)
    if shift:
        # The sum itself is rounded: the next double is surely not below it.
        half = math.nextafter(half + shift, math.inf)
    return count, up(half, half_per_unit)


def check_number(name: str, value: float, low: float, high: float) -> None:
    """Refuse a number that is not from `low` to `high`.

    Raises
    ------
    ValueError
        Naming the field and the value; NaN is out of every range.
    """
    if isinstance(value, bool) or not low <= value <= high:
        raise ValueError(f"{name} must be from {low:g} to {high:g}, got {value!r}")


def check_identity(name: str, value: int) -> None:
    """Refuse what is not an unsigned 16-bit integer.

    Raises
    ------
    ValueError
        Naming the field and the value.
    """
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 0xFFFF:
        raise ValueError(f"{name} must be an integer from 0 to 65535, got {value!r}")


def check_direction(value: int) -> None:
    """Refuse what is neither +1 nor -1.

    Raises
    ------
    ValueError
        Quoting the value.
    """
    if isinstance(value, bool) or value not in (1, -1):
        raise ValueError(f"direction must be 1 or -1, got {value!r}")
