"""What is counted of messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from rail_signals.track_code.profile import TrackCodeProfile


@dataclass(frozen=True)
class ErrorCount:
    """Errors among messages.

    Parameters
    ----------
    messages
        Those that were sent; decisions where none was.
    errors
        Those that were not received as sent; words that were received where none was sent.
    undetected
        Wrong messages that the receiver takes for true; None where it does not judge them.
    """

    messages: int
    errors: int
    undetected: int | None = None


Counter: TypeAlias = Callable[[TrackCodeProfile, float, int, np.random.Generator], ErrorCount]
"""Of profile, C/N0 [dB Hz], least number of messages, and generator."""


def batches(count: int, most: int) -> Iterator[int]:
    """Sizes of batches of `most`, the last of what is left.

    >>> list(batches(7, 3))
    [3, 3, 1]
    """
    for start in range(0, count, most):
        yield min(most, count - start)
