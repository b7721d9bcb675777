"""Cycles of equipment that works in ticks: when a periodic telegram is due."""

from __future__ import annotations

from dataclasses import dataclass

from rail_msgs_py.stamps import seconds_to_ns


@dataclass(frozen=True)
class Cycle:
    """A period that is at least a tick.

    Parameters
    ----------
    period_s, tick_s : float
        The second is above zero.

    Examples
    --------
    >>> cycle = Cycle(0.5, 0.2)
    >>> [tick for tick in range(11) if cycle.begins(tick * 200_000_000)]
    [0, 3, 5, 8, 10]
    """

    period_s: float
    tick_s: float

    def begins(self, time_ns: int) -> bool:
        """Whether a period begins in the tick that ends at a time."""
        tick_ns = seconds_to_ns(self.tick_s)
        period_ns = max(seconds_to_ns(self.period_s), tick_ns)
        return time_ns // period_ns != (time_ns - tick_ns) // period_ns
