"""How far the peer's clock is ahead of one's own, from the exchange of frames, as an interval.

Neither end trusts that their clocks agree. Of a genuine frame with time-stamp T [peer's clock],
which tells that the peer had my frame that I sent at `a` [my clock], and which comes at `n`:

    a + d <= time at which it was sealed, by my clock <= n - d

where d is the least time that a frame can take. So the offset theta = peer's clock - mine is
within [T - n + d, T - a - d]: the four time-stamps of NTP (RFC 5905, section 8) as bounds instead
of a mean, the double time-stamp of EN 50159:2010, 7.3.4. Whoever holds frames back, repeats or
drops them only makes a bound looser, never wrong: the age of a frame is at most that of the loosest
clock which fits. Between exchanges the interval grows by the drift that both clocks are allowed.
Bounds that cross show a clock that has jumped.
"""

from __future__ import annotations

from collections import deque
from math import ceil, floor
from typing import Final, NamedTuple

from .safe_frame import NS_PER_TICK

#: Frames of which it is remembered when they were sent.
_REMEMBERED: Final = 256


class SentTimes:
    """When frames of one kind were sent [ns]: the newest of them, by their numbers from 1."""

    def __init__(self) -> None:
        self.count = 0
        self._times: deque[int] = deque(maxlen=_REMEMBERED)

    def add(self, time_ns: int) -> int:
        """Number of a frame that is sent now."""
        self.count += 1
        self._times.append(time_ns)
        return self.count

    def of(self, number: int) -> int | None:
        """When a frame was sent; None if that is not remembered."""
        back = self.count - number
        return self._times[-1 - back] if 0 <= back < len(self._times) else None

    def forget(self) -> None:
        """Remember none of those so far; numbers go on."""
        self._times.clear()


class AgeBounds(NamedTuple):
    """Least and most age of a time-stamp [ns]."""

    least_ns: int
    most_ns: int


class ClockOffset:
    """Interval of the offset of the peer's clock.

    Parameters
    ----------
    least_delay_ns : int
        Least time from sealing to opening [ns]; 0 is always right.
    drift : float
        Most that each clock gains or loses per time, say 2e-4.
    """

    def __init__(self, least_delay_ns: int, drift: float) -> None:
        # As the slowest clock that is allowed measures it.
        self._least_delay_ns = floor(least_delay_ns * (1.0 - 2.0 * drift))
        # Of one clock against the other, and of the time between as either measures it.
        self._drift = 2.0 * drift * (1.0 + 2.0 * drift)
        self._bounds: tuple[int, int] | None = None
        self._learnt_ns = 0

    def learn(self, stamp_ns: int, sent_ns: int, now_ns: int) -> bool:
        """Take a genuine frame; False if it cannot be with the clocks of before.

        Parameters
        ----------
        stamp_ns : int
            Time-stamp of the frame [ns, peer's clock], rounded down to whole microseconds.
        sent_ns : int
            When the newest frame was sent that its sender had heard by then [ns, own clock].
        now_ns : int
            When it comes [ns, own clock].
        """
        low = stamp_ns - now_ns + self._least_delay_ns
        high = stamp_ns + NS_PER_TICK - sent_ns - self._least_delay_ns
        if self._bounds is not None:
            before_low, before_high = self._at(now_ns, self._bounds)
            low, high = max(low, before_low), min(high, before_high)
        if low > high:
            return False
        self._bounds, self._learnt_ns = (low, high), now_ns
        return True

    def age(self, stamp_ns: int, now_ns: int) -> AgeBounds | None:
        """Bounds of the age of a time-stamp of the peer; None as long as nothing was learnt."""
        if self._bounds is None:
            return None
        low, high = self._at(now_ns, self._bounds)
        most_ns = now_ns - stamp_ns + high
        stretch_ns = ceil(self._drift * max(0, most_ns))
        return AgeBounds(now_ns - stamp_ns - NS_PER_TICK + low - stretch_ns, most_ns + stretch_ns)

    def _at(self, now_ns: int, bounds: tuple[int, int]) -> tuple[int, int]:
        grown_ns = ceil(self._drift * max(0, now_ns - self._learnt_ns))
        return bounds[0] - grown_ns, bounds[1] + grown_ns
