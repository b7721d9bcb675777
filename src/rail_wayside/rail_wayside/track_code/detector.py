"""Whether a track circuit is free of axles: only if its own code is recognised at its level.

The receiver compares what arrives with what the circuit's own transmitter fed in during the same
time (`rail_signals.track_code.matched`). The circuit is clear when, over the whole of `PICK_UP_S`,

- the coherence is at least `LEAST_COHERENCE`: noise, the code of another circuit and any line of
  the traction current have less, whatever their level;
- the level of the own code is no more than `OCCUPIED_BELOW_DB` below the adjusted one.

It is occupied again as soon as the level is too low over `DROP_AWAY_S`. Noise alone passes the
first with a probability of (1 - c)^(n - 1) per window, n = 480 bins: 1e-190. The coherence of a
line with the wave is below 0.45 for every word that circuits send (a test searches them).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Final

from rail_signals.arrays import FloatArray
from rail_signals.track_code.matched import NO_MATCH, Match, joined, match_block

#: The own code is that long without a gap before the circuit is clear [s].
PICK_UP_S: Final = 2.0
#: Time over which the level is taken that makes it occupied [s].
DROP_AWAY_S: Final = 0.25
#: Part of the power in the band that must be the own code.
LEAST_COHERENCE: Final = 0.6
#: A shunted circuit is this far below the adjusted level at least [dB].
OCCUPIED_BELOW_DB: Final = 12.0
#: Farther below it the axles of a train are the reason, or nothing is sent: not wet ballast [dB].
SHUNTED_BELOW_DB: Final = 18.0


@dataclass(frozen=True)
class Detection:
    """What the receiver makes of the circuit.

    ``level_db`` of the own code over `DROP_AWAY_S`, ``coherence`` over what there is of the
    window; ``shunted`` if the level is so low that axles are the likely reason.
    """

    occupied: bool
    shunted: bool
    level_db: float
    coherence: float


class TrackDetector:
    """Receiver of one track circuit; it knows what the transmitter feeds in, and nothing else.

    Parameters
    ----------
    adjusted_level_db : float
        Level at the receiving end while the circuit is clear, on dry ballast [dB].
    carrier_hz, sample_rate_hz, tick_s : float
    pick_up_s, least_coherence : float

    Examples
    --------
    >>> import numpy as np
    >>> detector = TrackDetector(-3.0, 1700.0, 16e3, 0.5)
    >>> wave = np.sin(2 * np.pi * 1700.0 / 16e3 * np.arange(8000))
    >>> [detector.update(wave, 0.7 * wave).occupied for _ in range(5)]
    [True, True, True, False, False]
    >>> detector.update(wave, 0.002 * wave).occupied
    True
    """

    def __init__(
        self,
        adjusted_level_db: float,
        carrier_hz: float,
        sample_rate_hz: float,
        tick_s: float,
        *,
        pick_up_s: float = PICK_UP_S,
        least_coherence: float = LEAST_COHERENCE,
    ) -> None:
        self._adjusted_db = adjusted_level_db
        self._carrier_hz, self._rate_hz = carrier_hz, sample_rate_hz
        self._least_coherence = least_coherence
        self._needed = max(1, math.ceil(pick_up_s / tick_s - 1e-9))
        self._short = min(self._needed, max(1, math.ceil(DROP_AWAY_S / tick_s - 1e-9)))
        self._recent: deque[Match] = deque(maxlen=self._short)
        # What has arrived since the level was last too low.
        self._window: deque[Match] = deque(maxlen=self._needed)

    def update(self, sent: FloatArray | None, received: FloatArray | None) -> Detection:
        """Judge one block.

        Parameters
        ----------
        sent, received : float [samples]
            Fed in, and arrived, in the same time; None = nothing.
        """
        match = NO_MATCH
        if sent is not None and received is not None:
            match = match_block(sent, received, self._carrier_hz, self._rate_hz)
        self._recent.append(match)
        level_db = joined(self._recent).level_db
        below_db = self._adjusted_db - level_db
        if match is NO_MATCH or not below_db < OCCUPIED_BELOW_DB:
            self._window.clear()
        else:
            self._window.append(match)
        window = joined(self._window)
        clear = (
            len(self._window) == self._needed
            and window.coherence >= self._least_coherence
            and self._adjusted_db - window.level_db < OCCUPIED_BELOW_DB
        )
        return Detection(
            not clear,
            not below_db < SHUNTED_BELOW_DB,
            level_db,
            window.coherence,
        )
