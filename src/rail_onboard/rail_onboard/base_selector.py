"""Which base station a train talks to: the one whose beacon arrives best, but not by a hair."""

from __future__ import annotations

import math
from collections.abc import Mapping

HYSTERESIS_DB = 3.0
SMOOTHING_TICKS = 4.0
"""Fading makes a single beacon a poor witness: levels are smoothed over so many ticks."""


class BaseSelector:
    """Chooses among channels by the signal-to-noise ratio of their beacons.

    Parameters
    ----------
    hysteresis_db : float
        Advantage that another channel needs [dB].

    Examples
    --------
    >>> selector = BaseSelector()
    >>> selector.update({1: 100.0}), selector.update({1: 10.0, 2: 12.0})
    (1, 1)
    """

    def __init__(self, hysteresis_db: float = HYSTERESIS_DB) -> None:
        if not hysteresis_db >= 0.0:
            raise ValueError(f"hysteresis_db: {hysteresis_db} is negative")
        self._advantage = 10.0 ** (hysteresis_db / 10.0)
        self._level: dict[int, float] = {}
        self.channel: int | None = None

    def update(self, snr: Mapping[int, float]) -> int | None:
        """Channel in force after a tick.

        Parameters
        ----------
        snr : mapping
            Channel to the signal-to-noise ratio of its beacon (linear); those not heard are
            left out.
        """
        weight = 1.0 / SMOOTHING_TICKS
        for channel in {*snr, *self._level}:
            now = snr.get(channel, 0.0)
            before = self._level.get(channel, now)
            self._level[channel] = before + weight * (now - before)
        heard = {c: level for c, level in self._level.items() if level > 0.0 and c in snr}
        if not heard:
            return self.channel
        best = max(sorted(heard), key=lambda c: heard[c])
        present = self._level.get(self.channel, -math.inf) if self.channel else -math.inf
        if heard[best] > present * self._advantage or self.channel is None:
            self.channel = best
        return self.channel
