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
        #: Wall time of each stack [s].
        self.wall_s: dict[Stack, float] = defaultdict(float)
        self.samples = 0
        self._last_s = 0.0

    def start(self) -> None:
        """Sample from now on."""
        self._before = signal.signal(signal.SIGALRM, self._sample)
        signal.siginterrupt(signal.SIGALRM, False)  # threads of the middleware wait on
        self._last_s = time.perf_counter()
        signal.setitimer(signal.ITIMER_REAL, INTERVAL_S, INTERVAL_S)

    def stop(self) -> None:
        """Sample no longer; does no harm if it was not started."""
        if signal.getsignal(signal.SIGALRM) == self._sample:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._before)

    def _sample(self, _: int, frame: FrameType | None) -> None:
        now_s = time.perf_counter()
        under_way: list[CodeType] = []
        while frame is not None:
            under_way.append(frame.f_code)
            frame = frame.f_back
        self.wall_s[(*reversed(under_way),)] += now_s - self._last_s
        self.samples += 1
        self._last_s = now_s
