"""Two studies of the same kind: which figures have moved by more than chance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from .figures import Figure
from .intervals import Estimate
from .summary import Group


class Move(NamedTuple):
    """A figure of a group, before and now; their intervals have no value in common."""

    key: tuple[Any, ...]
    figure: str
    before: Estimate
    now: Estimate


def moves(
    before: Sequence[Group], now: Sequence[Group], figures: Mapping[str, Figure]
) -> tuple[int, list[Move]]:
    """Groups that are in both, and figures whose intervals there do not overlap.

    Without an interval, any that differ have moved, if both are of as many runs.
    """
    ungauged = [name for name, figure in figures.items() if figure.over_runs in ("min", "max")]
    found = []
    compared = 0
    old = {tuple(map(str, group.key)): group for group in before}
    for group in now:
        other = old.get(tuple(map(str, group.key)))
        if other is None:
            continue
        compared += 1
        for name in figures:
            a, b = other.estimates[name], group.estimates[name]
            if name in ungauged and a.runs != b.runs:
                continue  # the least of more runs is less
            if _apart(a, b):
                found.append(Move(group.key, name, a, b))
    return compared, found


def _apart(a: Estimate, b: Estimate) -> bool:
    if math.isnan(a.value) or math.isnan(b.value):
        return math.isnan(a.value) != math.isnan(b.value)
    if math.isnan(a.half_width) or math.isnan(b.half_width):
        return a.value != b.value
    return a.high < b.low or b.high < a.low
