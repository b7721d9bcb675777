"""What a receiver of track codes decides at one instant, and when a word counts.

The decision by minimum and maximum value of Kim et al., section 4.2, with the error
detection that their conclusion asks for. A word is valid if

1. every level lies in the window for absent or in the one for present,
2. the noise of the levels, told from what the model of the tones leaves over, is small,
3. the word decodes: its CRC is right, or exactly one tone is present where one may be, and
4. the same word came out of as many successive long slots as the rule of confirmation
   asks; each costs one more hop of reaction time.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import BoolArray, FloatArray

from .profile import TrackCodeProfile
from .word import decode

Number = TypeVar("Number", bound=np.generic)

MOST_NOISE = 0.1
"""Largest standard deviation of a level, as a fraction of the tone's nominal deviation."""


class Decision(NamedTuple):
    """What a receiver makes of the signal up to one instant.

    Attributes
    ----------
    time_s
        Time of the newest sample considered, from the first one fed [s].
    bits : bool [tones], read-only
        Tones present, level above the middle between the windows; False without levels.
    levels : float64 [tones], read-only
        Deviation of each tone over the nominal one; NaN while there is no full slot.
    valid
        Whether the word counts.
    fields
        The message of the word, None unless valid.
    reason
        Why the word does not count; empty if it does.
    """

    time_s: float
    bits: BoolArray
    levels: FloatArray
    valid: bool
    fields: Mapping[str, int] | None
    reason: str


def no_slot(profile: TrackCodeProfile, time_s: float, reason: str) -> Decision:
    """Decision without levels."""
    bits = np.zeros(profile.tones, dtype=np.bool_)
    levels = np.full(profile.tones, np.nan)
    return Decision(time_s, read_only(bits), read_only(levels), False, None, reason)


def read_only(array: NDArray[Number]) -> NDArray[Number]:
    """The array itself, no longer to be written."""
    array.setflags(write=False)
    return array


def judge_levels(
    profile: TrackCodeProfile, levels: ArrayLike, noise: ArrayLike
) -> tuple[BoolArray, dict[str, int] | None, str]:
    """Decide one slot by its levels alone.

    Parameters
    ----------
    profile
        Windows, fields and coding.
    levels : float [tones]
        Deviations over the nominal ones.
    noise : float [tones]
        Their standard deviations.

    Returns
    -------
    bits : bool [tones]
        Tones present, by the middle between the windows.
    fields
        Message, or None if the slot does not hold one.
    reason
        Why not; empty if it does.
    """
    level = np.asarray(levels, dtype=np.float64)
    bits = np.asarray(level > (profile.absent_max + profile.present_min) / 2, dtype=np.bool_)
    absent = level <= profile.absent_max
    present = (level >= profile.present_min) & (level <= profile.present_max)
    doubtful = np.flatnonzero(~(absent | present))
    if doubtful.size:
        tone = int(doubtful[0])
        frequency = profile.tones_hz[tone]
        return bits, None, f"level {level[tone]:.2f} of tone {frequency:g} Hz is in no window"
    worst = float(np.max(np.asarray(noise, dtype=np.float64)))
    if not worst <= MOST_NOISE:
        return bits, None, f"noise of the levels is {worst:.2f}, more than {MOST_NOISE:g}"
    fields = decode(profile, bits)
    if fields is None:
        if not bits.any():
            return bits, None, "no tone is present"
        if profile.coding == "one_of_n":
            return bits, None, f"{np.count_nonzero(bits)} tones are present, not one"
        return bits, None, "check bits are wrong"
    return bits, fields, ""


class Confirmation:
    """Counts successive long slots that hold the same word.

    Parameters
    ----------
    needed
        Slots that a word needs, 1 or more.

    Examples
    --------
    >>> rule = Confirmation(2)
    >>> word = np.array([True, False])
    >>> rule.confirm(word), rule.confirm(word), rule.confirm(~word)
    (False, True, False)
    """

    def __init__(self, needed: int) -> None:
        if isinstance(needed, bool) or needed != int(needed) or needed < 1:
            raise ValueError(f"confirmations must be a positive integer, got {needed!r}")
        self.needed = int(needed)
        self.reset()

    def reset(self) -> None:
        """Forget the word counted so far."""
        self._word: BoolArray | None = None
        self.count = 0

    def confirm(self, word: BoolArray) -> bool:
        """Count one more slot with this word; whether it is confirmed now."""
        same = self._word is not None and np.array_equal(self._word, word)
        self.count = min(self.count + 1, self.needed) if same else 1
        self._word = word
        return self.count >= self.needed

    @property
    def reason(self) -> str:
        """Why a word that is not confirmed does not count."""
        return f"confirmed {self.count} of {self.needed} times"
