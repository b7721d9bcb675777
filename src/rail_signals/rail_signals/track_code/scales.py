"""What the numbers in the fields of a track code stand for, the same at both ends.

The speed field holds two indices into a table of 16 speeds: the high nibble the speed allowed in
the block, the low nibble the one allowed at its end.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from math import floor

GRAVITY_MPS2 = 9.80665
#: Rotating masses take part of what a rise gives to braking; a fall is taken in full.
ROTATING_MASS_FACTOR = 1.15
#: Less deceleration than this is not counted on at all.
LEAST_BRAKING_MPS2 = 0.05

SPEEDS_KMH = (
    *(0.0, 25.0, 40.0, 50.0, 60.0, 70.0, 80.0, 100.0),
    *(130.0, 160.0, 190.0, 220.0, 245.0, 265.0, 285.0, 300.0),
)
"""Default table of speeds, for metros and high-speed lines alike.

Going up, a step must be no more than one block takes back: from 300 km/h on level blocks of 1500 m
with the default braking, up to 100 km/h on blocks of 500 m. No code leads over a larger one.
"""


#: Identities of circuits, in turn along a track. Two bits at least: with them no word is near to a
#: line of the spectrum. No circuit has that of the one after the next, which has its carrier again.
IDENTITIES = (3, 5, 6, 7)


def identity_after(identity: int) -> int:
    """Identity of the next circuit.

    Examples
    --------
    >>> [identity_after(each) for each in IDENTITIES]
    [5, 6, 7, 3]
    """
    return IDENTITIES[(IDENTITIES.index(identity) + 1) % len(IDENTITIES)]


@dataclass(frozen=True)
class TrackCode:
    """A code in SI units: speeds now and at the end, length and gradient of the block."""

    now_mps: float
    end_mps: float
    length_m: float
    gradient_permil: float


@dataclass(frozen=True)
class CodeScales:
    """What the numbers in the fields stand for.

    ``gradient_permil = gradient_step_permil * (index - gradient_zero)``.

    Raises
    ------
    ValueError
        If the table of speeds is not 16 rising ones from 0, or a step is not above zero.
    """

    speeds_kmh: tuple[float, ...] = SPEEDS_KMH
    length_step_m: float = 25.0
    gradient_step_permil: float = 5.0
    gradient_zero: int = 10

    def __post_init__(self) -> None:
        table = self.speeds_kmh
        if len(table) != 16 or table[0] != 0.0 or list(table) != sorted(set(table)):
            raise ValueError(f"speeds_kmh: {table} are not 16 rising speeds from 0")
        if not (self.length_step_m > 0.0 and self.gradient_step_permil > 0.0):
            raise ValueError("length_step_m, gradient_step_permil: must be above zero")

    def speed_index(self, speed_mps: float) -> int:
        """Largest index of a speed not above ``speed_mps``."""
        # Rounding must not turn a limit of 80 km/h into the speed below it.
        return max(0, bisect_right(self.speeds_kmh, 3.6 * speed_mps + 1e-9) - 1)

    def length_index(self, length_m: float) -> int:
        """Length in steps, rounded down: the block ends no sooner than coded."""
        return min(63, floor(length_m / self.length_step_m + 1e-9))

    def gradient_index(self, gradient_permil: float) -> int:
        """Gradient in steps, rounded to the downhill side.

        Raises
        ------
        ValueError
            If the fall is steeper than any that can be told.
        """
        index = floor(gradient_permil / self.gradient_step_permil + 1e-9) + self.gradient_zero
        if index < 0:
            raise ValueError(f"gradient_permil: {gradient_permil} is steeper than any code")
        return min(15, index)

    def read(self, fields: Mapping[str, int]) -> TrackCode:
        """Return the meaning of the fields ``speed``, ``block_length`` and ``gradient``."""
        now, end = divmod(fields["speed"], 16)
        # The end is part of the block: a code that allows more there is held to less.
        return TrackCode(
            now_mps=self.speeds_kmh[now] / 3.6,
            end_mps=self.speeds_kmh[min(now, end)] / 3.6,
            length_m=self.length_step_m * fields["block_length"],
            gradient_permil=self.gradient_step_permil * (fields["gradient"] - self.gradient_zero),
        )


def deceleration_mps2(braking_mps2: float, gradient_permil: float) -> float:
    """Braking on a gradient: a fall counts in full, a rise less the rotating masses.

    Examples
    --------
    >>> round(deceleration_mps2(0.6, -20.0), 3)
    0.404
    """
    slope_mps2 = GRAVITY_MPS2 * 1e-3 * gradient_permil
    return braking_mps2 + (slope_mps2 if slope_mps2 < 0.0 else slope_mps2 / ROTATING_MASS_FACTOR)
