"""What a test hands over, checked at the call, so that the line at fault is that of the test."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, cast, get_args

from rail_corridor.errors import InputError
from rail_corridor.plan.plan import Placement


def checked_placement(placement: str) -> Placement:
    """A placement; InputError if there is none of that name."""
    for known in get_args(Placement):
        if placement == known:
            return cast(Placement, placement)
    reason = f"must be one of {', '.join(get_args(Placement))}"
    raise InputError(reason, field="placement", value=placement)


def checked_condition(condition: Any) -> Callable[[], Any]:
    """A condition, which can be called after every tick; TypeError if it cannot."""
    if not callable(condition):
        raise TypeError(f"a condition is called after every tick: a lambda, not {condition!r}")
    return cast(Callable[[], Any], condition)


def checked_ticks(ticks: int) -> int:
    """A number of ticks; InputError if it is none, or below zero."""
    if isinstance(ticks, bool) or not isinstance(ticks, int) or ticks < 0:
        raise InputError("must be a whole number, not below 0", field="ticks", value=ticks)
    return ticks


def ticks_in(seconds: float, tick_s: float, field: str) -> int:
    """Ticks that a time takes, the last one begun; InputError for times that there are not."""
    if not 0.0 <= seconds < math.inf:
        raise InputError("must be a time, not below 0", field=field, value=seconds)
    return math.ceil(seconds / tick_s - 1e-9)
