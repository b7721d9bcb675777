"""When a zone controller that was switched on may give authorities on a track.

It knows nothing of before: trains may be anywhere on the tracks that they are registered for, and
hold authorities that it has not given. So a track opens when

- the authorities of before have expired, ``validity_s`` after the start: from then on trains brake;
- every train that has been heard has since reported where it is, and that it stands;
- every train that has not been heard is not there: for ``ABSENT_S`` in one piece no radio frame of
  it came, and every zone of the track was read without a train that nobody owns. (A train that is
  there has to fail with its radio and its transponder at once to be missed.)

An open track stays open; a train that enters it later is known as soon as it reports.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from .train_bounds import TrainBounds

#: A train of which nothing was heard or ranged for so long is not there [s].
ABSENT_S: Final = 10.0


class Opening:
    """Accounts for the trains of every track after a start.

    Parameters
    ----------
    start_s : float
        Time of the start.
    validity_s : float
        Of any authority that was given before.
    """

    def __init__(self, start_s: float, validity_s: float) -> None:
        self._start_s, self._expired_s = start_s, start_s + validity_s
        self._clear_since_s: dict[int, float] = {}
        self._swept_s: dict[int, float] = {}
        self._open: set[int] = set()

    def silent(self, time_s: float) -> bool:
        """Whether a train that was not heard until now has been silent for long enough."""
        return time_s - self._start_s >= ABSENT_S

    def sweep(self, time_s: float, segment: int, clear: bool) -> None:
        """Take note whether every reading of a track at a time is that of a known train."""
        self._swept_s[segment] = time_s
        if clear:
            self._clear_since_s.setdefault(segment, time_s)
        else:
            self._clear_since_s.pop(segment, None)

    def missing(
        self, segment: int, time_s: float, trains: Iterable[TrainBounds]
    ) -> tuple[str, ...]:
        """Names of those trains of a track for which it waits; empty once it is open."""
        if segment in self._open:
            return ()
        since_s = self._clear_since_s.get(segment, time_s)
        empty = self._swept_s.get(segment, time_s) - since_s >= ABSENT_S
        missing = tuple(
            each.start.name
            for each in trains
            if (not each.placed or each.stood_s <= self._expired_s)
            and not (empty and not each.heard)
        )
        if not missing and time_s > self._expired_s:
            self._open.add(segment)
            return ()
        return missing or ("authorities of before",)
