"""Samples what the main thread is at, by a timer of the system.

A sample is the functions under way, taken where the interpreter looks for signals: after a call of
compiled code in whoever called it. Between samples nothing is done, so that a tick takes no longer
and calls weigh no more than they do; a profiler that is told of every call makes a tick half as
long again.
"""

from __future__ import annotations

import signal
import time
from collections import defaultdict
from types import CodeType, FrameType
from typing import Final

#: Between two samples.
INTERVAL_S: Final = 0.001

#: Functions under way, the root first.
Stack = tuple[CodeType, ...]


class Sampler:
    """Samples of the main thread, which also starts and stops it."""

    def __init__(self) -> None:
        self.samples = 0
        self._taken: list[tuple[list[CodeType], float]] = []
        # The hash of a function's code is that of all its instructions: here it goes by identity.
        self._wall_s: dict[tuple[int, ...], float] = defaultdict(float)
        self._stacks: dict[tuple[int, ...], Stack] = {}
        self._last_s = 0.0

    def start(self) -> None:
        """Sample from now on."""
        self._before = signal.signal(signal.SIGALRM, self._sample)
        signal.siginterrupt(signal.SIGALRM, False)  # threads of the middleware wait on
        self._last_s = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, INTERVAL_S, INTERVAL_S)

    def stop(self) -> None:
        """Sample no longer; does no harm if it was not started."""
        if signal.getsignal(signal.SIGALRM) != self._sample:
            return
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)
        self.samples += len(self._taken)
        for under_way, seconds in self._taken:
            key = tuple(map(id, under_way))
            self._wall_s[key] += seconds
            self._stacks.setdefault(key, tuple(reversed(under_way)))
        self._taken.clear()

    def wall_s(self) -> list[tuple[Stack, float]]:
        """Every stack that was met, and how long [s]."""
        return [(self._stacks[key], seconds) for key, seconds in self._wall_s.items()]

    def _sample(self, _: int, frame: FrameType | None) -> None:
        now_s = time.perf_counter()
        under_way: list[CodeType] = []
        while frame is not None:
            under_way.append(frame.f_code)
            frame = frame.f_back
        self._taken.append((under_way, now_s - self._last_s))
        self._last_s = now_s
