"""Places and signs of the pilots of a burst."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rail_signals.arrays import ComplexArray, FloatArray


@dataclass(frozen=True)
class PilotPattern:
    """Where the pilots of a burst stand, and what they are.

    A block of pilots begins every `period` symbols; the last block follows the last data. To
    follow a channel of Doppler f_D, `period` must stay well below ``1 / (2 f_D T)`` symbols: at
    half of it the error already doubles, near it neither channel nor level can be told.

    Parameters
    ----------
    data_symbols
        Data symbols n of a burst; even with two antennas.
    transmit
        Transmit antennas, 1 or 2.
    period
        Symbols from the start of one block to the next; even.
    block
        Symbols in a block; even, below `period`, so that no pair of data is parted.

    Examples
    --------
    >>> pattern = PilotPattern(data_symbols=6, transmit=2, period=6)
    >>> pattern.symbols, pattern.pilot_positions.tolist(), pattern.data_positions.tolist()
    (12, [0, 1, 6, 7, 10, 11], [2, 3, 4, 5, 8, 9])
    """

    data_symbols: int
    transmit: int = 2
    period: int = 16
    block: int = 2

    def __post_init__(self) -> None:
        """Validate every field."""
        if self.transmit not in (1, 2):
            raise ValueError(f"transmit must be 1 or 2 antennas, got {self.transmit!r}")
        if self.data_symbols < 1 or self.data_symbols % self.transmit:
            raise ValueError(
                f"data_symbols must be whole blocks of {self.transmit}, got {self.data_symbols!r}"
            )
        if self.block < 2 or self.block % 2:
            raise ValueError(f"block must be even and positive, got {self.block!r}")
        if self.period <= self.block or self.period % 2:
            raise ValueError(f"period must be even and above {self.block}, got {self.period!r}")

    @property
    def symbols(self) -> int:
        """Symbols of the burst, pilots and data."""
        return self.data_symbols + (self._stretches + 1) * self.block

    @property
    def pilot_fraction(self) -> float:
        """Fraction of the energy of a burst that the pilots take."""
        return 1 - self.data_symbols / self.symbols

    @cached_property
    def data_positions(self) -> NDArray[np.intp]:
        """Places of the data, intp [data_symbols]."""
        place = np.arange(self.data_symbols)
        return np.asarray(place + (place // (self.period - self.block) + 1) * self.block)

    @cached_property
    def pilot_positions(self) -> NDArray[np.intp]:
        """Places of the pilots, intp [pilots]."""
        free = np.ones(self.symbols, dtype=np.bool_)
        free[self.data_positions] = False
        return np.flatnonzero(free)

    @cached_property
    def pilots(self) -> FloatArray:
        """Pilots of each antenna, float64 [tx, pilots], of total power 1."""
        count = len(self.pilot_positions)
        rows = np.ones((self.transmit, count))
        rows[1:, 1::2] = -1
        return rows / math.sqrt(self.transmit)

    def insert(self, data: ArrayLike) -> ComplexArray:
        """Burst complex128 [..., tx, symbols] of data complex [..., tx, n]."""
        x = np.asarray(data, dtype=np.complex128)
        if x.ndim < 2 or x.shape[-2:] != (self.transmit, self.data_symbols):
            raise ValueError(
                f"data must be [..., {self.transmit}, {self.data_symbols}], got shape {x.shape}"
            )
        burst = np.empty((*x.shape[:-1], self.symbols), dtype=np.complex128)
        burst[..., self.pilot_positions] = self.pilots
        burst[..., self.data_positions] = x
        return burst

    @property
    def _stretches(self) -> int:
        return -(-self.data_symbols // (self.period - self.block))
