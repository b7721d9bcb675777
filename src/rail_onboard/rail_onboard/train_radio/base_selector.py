"""Which base station a train talks to: the one whose beacon arrives best, but not by a hair."""

from __future__ import annotations

import math
from collections.abc import Mapping

HYSTERESIS_DB = 3.0
SMOOTHING_TICKS = 4.0
"""Fading makes a single beacon a poor witness: levels are smoothed over so many ticks."""
MOST_MISSED = 2
"""Beacons missed in a row after which a channel counts as gone."""


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
        self._hysteresis_db = hysteresis_db
        self._level_db: dict[int, float] = {}
        self._missed: dict[int, int] = {}
        self.channel: int | None = None

    def update(self, snr: Mapping[int, float]) -> int | None:
        """Channel in force after a tick.

        Parameters
        ----------
        snr : mapping
            Channel to the signal-to-noise ratio of its beacon (linear); those not heard are
            left out.
        """
        for channel in {*snr, *self._level_db}:
            self._take(channel, snr.get(channel, 0.0))
        if not self._level_db:
            return self.channel
        best = max(sorted(self._level_db), key=lambda c: self._level_db[c])
        present_db = self._level_db.get(self.channel or 0, -math.inf)
        if self._level_db[best] > present_db + self._hysteresis_db:
            self.channel = best
        return self.channel

    def _take(self, channel: int, snr: float) -> None:
        """Follow the level of one channel."""
        if snr > 0.0:
            now_db = 10.0 * math.log10(snr)
            before_db = self._level_db.get(channel, now_db)
            self._level_db[channel] = before_db + (now_db - before_db) / SMOOTHING_TICKS
            self._missed[channel] = 0
            return
        self._missed[channel] = self._missed.get(channel, 0) + 1
        if self._missed[channel] >= MOST_MISSED:
            self._level_db.pop(channel, None)
