"""Random words of a track code and their check, many at a time.

The remainder by the generator is linear: with one column of H per bit, the remainder of its
place, ``H word = syndrome`` modulo 2 for every word, and for no other bits.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import BoolArray
from rail_signals.track_code.profile import TrackCodeProfile
from rail_signals.track_code.word import crc


class CheckedWords:
    """Words of a profile with a CRC, all of them equally likely.

    Parameters
    ----------
    profile
        With a polynomial, and an inversion: without one the bare carrier would pass the check.

    Attributes
    ----------
    check : int64 [checks, tones]
        Parity-check matrix H.
    syndrome : int64 [checks]
        ``H word`` modulo 2 of every word.
    pass_rate : float
        Share of random bits that pass the check.

    Raises
    ------
    ValueError
        If the profile has no such check.

    Examples
    --------
    >>> from rail_signals.track_code.profile import load_profile
    >>> words = CheckedWords(load_profile("tones27"))
    >>> drawn = words.draw(np.random.default_rng(1), 4)
    >>> drawn.shape, words.pass_check(drawn).tolist(), words.pass_check(~drawn[0]).tolist()
    ((4, 27), [True, True, True, True], False)
    """

    def __init__(self, profile: TrackCodeProfile) -> None:
        if not (profile.crc_polynomial and profile.crc_inversion):
            raise ValueError(
                "profile must have a CRC that a bare carrier does not pass, got crc_polynomial"
                f" {profile.crc_polynomial!r} and crc_inversion {profile.crc_inversion!r}"
            )
        degree = profile.crc_polynomial.bit_length() - 1
        columns = [
            crc(profile.crc_polynomial, 1 << (bit - degree)) if bit >= degree else 1 << bit
            for bit in range(profile.tones)
        ]
        place = np.arange(degree)
        self.check: Final[NDArray[np.int64]] = np.array(columns) >> place[:, None] & 1
        self.syndrome: Final[NDArray[np.int64]] = profile.crc_inversion >> place & 1
        self.pass_rate: Final = 2.0**-degree

    def draw(self, rng: np.random.Generator, count: int) -> BoolArray:
        """Words, bool [count, tones]."""
        checks, tones = self.check.shape
        bits = rng.integers(0, 2, (count, tones))
        bits[:, :checks] = 0
        bits[:, :checks] = (bits @ self.check.T + self.syndrome) & 1
        return bits.astype(np.bool_)

    def pass_check(self, bits: ArrayLike) -> BoolArray:
        """Whether the CRC of bits is right, bool [...] of bool [..., tones]."""
        found = np.asarray(bits, dtype=np.int64) @ self.check.T & 1
        return np.asarray((found == self.syndrome).all(axis=-1))
