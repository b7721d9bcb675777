"""Integration tests of equipment against the corridor: see `rail_testing.corridor.Corridor`.

With pytest, the fixture ``corridor`` makes them and closes them by itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .corridor import Corridor
    from .interception import InterceptorError, Late
    from .outcome import Outcome
    from .repeatability import Difference, first_difference
    from .under_test import NodeError

_FOUND_IN = {
    "Corridor": "corridor",
    "InterceptorError": "interception",
    "Late": "interception",
    "NodeError": "under_test",
    "Outcome": "outcome",
    "Difference": "repeatability",
    "first_difference": "repeatability",
}


def __getattr__(name: str) -> Any:
    """Load what is asked for: every run of pytest imports this package for its plug-in."""
    if name not in _FOUND_IN:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(f"{__name__}.{_FOUND_IN[name]}"), name)


__all__ = [
    "Corridor",
    "Difference",
    "InterceptorError",
    "Late",
    "NodeError",
    "Outcome",
    "first_difference",
]
