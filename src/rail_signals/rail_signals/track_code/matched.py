"""Matched detection: how much of what arrives is what was sent, in the band of the carrier.

A track circuit knows the wave that it feeds in. With ``R_k`` and ``S_k`` the spectra of a block
received and sent, over the bins ``k`` of the band (`HALF_BAND_HZ` to either side),

    gain = sum R conj(S) / sum |S|^2        coherence = |sum R conj(S)|^2 / (sum |R|^2 sum |S|^2)

of all blocks of a window together. The wave itself, however weak, has a coherence of 1. Where
there is none of it but Gaussian noise of any power, the coherence of n bins follows Beta(1, n - 1)
(N. R. Goodman, Annals of Mathematical Statistics 34, 1963), so that

    P(coherence > c) = (1 - c)^(n - 1)                                              (false_alarm)

The bound does not depend on the level of the noise. A line of the traction current, whatever its
amplitude, has no more of it than the wave has of any one line.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.ranging.band_level import HALF_BAND_HZ


@dataclass(frozen=True)
class Match:
    """Sums over the bins of a band: of the cross spectrum, and of both powers."""

    cross: complex
    sent: float
    received: float
    bins: int

    @property
    def coherence(self) -> float:
        """Part of the power received that is the wave sent, 0 to 1 [1]."""
        power = self.sent * self.received
        return abs(self.cross) ** 2 / power if 0.0 < power < math.inf else 0.0

    @property
    def gain(self) -> float:
        """Amplitude of the wave where it is received over that where it is sent [1]."""
        return abs(self.cross) / self.sent if self.sent > 0.0 else 0.0

    @property
    def level_db(self) -> float:
        """The gain as a level [dB]; minus infinity if there is none."""
        gain = self.gain
        return 20.0 * math.log10(gain) if 0.0 < gain < math.inf else -math.inf


NO_MATCH = Match(0j, 0.0, 0.0, 0)


def match_block(
    sent: FloatArray, received: FloatArray, carrier_hz: float, sample_rate_hz: float
) -> Match:
    """Match of one block.

    Parameters
    ----------
    sent, received : float [samples]
    carrier_hz, sample_rate_hz : float

    Returns
    -------
    Match
        `NO_MATCH` if there is nothing in one of them, or not numbers.

    Examples
    --------
    >>> wave = np.sin(2 * np.pi * 1700.0 / 16e3 * np.arange(4000))
    >>> match = match_block(wave, 0.5 * wave, 1700.0, 16e3)
    >>> round(match.level_db, 2), round(match.coherence, 6)
    (-6.02, 1.0)
    """
    count = len(sent)
    if count == 0 or len(received) != count:
        return NO_MATCH
    step_hz = sample_rate_hz / count
    low = max(0, math.ceil((carrier_hz - HALF_BAND_HZ) / step_hz))
    band = slice(low, math.floor((carrier_hz + HALF_BAND_HZ) / step_hz) + 1)
    s, r = np.fft.rfft(sent)[band], np.fft.rfft(received)[band]
    match = Match(
        complex(np.vdot(s, r)), float(np.vdot(s, s).real), float(np.vdot(r, r).real), len(s)
    )
    finite = math.isfinite(match.received) and math.isfinite(abs(match.cross))
    return match if finite and match.sent > 0.0 else NO_MATCH


def joined(matches: Iterable[Match]) -> Match:
    """Match of several blocks as one window."""
    cross, sent, received, bins = 0j, 0.0, 0.0, 0
    for each in matches:
        cross += each.cross
        sent += each.sent
        received += each.received
        bins += each.bins
    return Match(cross, sent, received, bins)


def false_alarm(coherence: float, bins: int) -> float:
    """Probability that noise alone has more than this coherence.

    Examples
    --------
    >>> false_alarm(0.5, 11)
    0.0009765625
    """
    return (1.0 - coherence) ** max(0, bins - 1)
