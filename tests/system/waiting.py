"""Waiting for what other processes do."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

#: Generous: it only makes a test fail that would otherwise hang.
PATIENCE_S = 90.0


def until(condition: Callable[[], Any], look_s: float = 0.01) -> Any:
    """Wait for a condition and return early; fail after long."""
    deadline_s = time.monotonic() + PATIENCE_S
    while not (value := condition()):
        assert time.monotonic() < deadline_s, f"waited {PATIENCE_S} s in vain"
        time.sleep(look_s)
    return value
