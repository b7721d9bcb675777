"""An intruder who holds back all frames of a link, in their order, by more and more.

Slowly enough, it looks as if the sender's clock lost time; faster, as if the link got longer. When
a delay has come to its most he begins again at another pace.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable

import numpy as np

from rail_msgs_py.stamps import seconds_to_ns

from .frame_threats import Arrival, Link, Threat

#: How much of a second frames get later in a second: from less than clocks drift to a third.
SLOWEST, FASTEST = 1e-5, 0.3
#: Time after which another pace is tried.
_TURN_NS = seconds_to_ns(300.0)


class GrowingDelay:
    """Holds back what arrives.

    Parameters
    ----------
    rng : generator
    longest_s : float
        Most that a frame is held back.
    """

    def __init__(self, rng: np.random.Generator, longest_s: float = 3.0) -> None:
        self._rng, self._longest_ns = rng, seconds_to_ns(longest_s)
        self._paces: dict[Link, tuple[int, float]] = {}
        self._held: list[tuple[int, int, Arrival]] = []
        #: Frames that were held back.
        self.count = 0

    def arrivals(self, arrived: Iterable[Arrival], until_ns: int) -> list[Arrival]:
        """What comes out before a time, of all that has arrived so far."""
        for arrival in arrived:
            due_ns = arrival.time_ns + self._delay_ns(arrival.link, arrival.time_ns)
            late = arrival._replace(time_ns=due_ns, threat=Threat.DELAY)
            heapq.heappush(self._held, (due_ns, self.count, late))
            self.count += 1
        out = []
        while self._held and self._held[0][0] < until_ns:
            out.append(heapq.heappop(self._held)[2])
        return out

    def _delay_ns(self, link: Link, time_ns: int) -> int:
        since_ns, pace = self._paces.get(link, (time_ns, 0.0))
        delay_ns = round(pace * (time_ns - since_ns))
        goes_on = delay_ns <= self._longest_ns and time_ns - since_ns < _TURN_NS
        if link in self._paces and goes_on:
            return delay_ns
        exponent = self._rng.uniform(np.log10(SLOWEST), np.log10(FASTEST))
        self._paces[link] = time_ns, 10.0**exponent
        return 0
