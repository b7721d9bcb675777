"""What the other tones leave in the pieces of a block that was turned back by one of them.

The mean over L samples of a tone whose angle a sample is 2 x away from what was turned back is
Dirichlet's kernel ``sin(L x) / (L sin x)`` of its value at the middle. With x = a + b, a of the
two tones and b of the piece (a tone that sweeps is elsewhere in every piece, but only a little,
so that ``1 / sin(a + b)`` is ``(1 - b cot a) / sin a``), the kernel is a sum of four
products, and the leakage of all tones into all tones one product of matrices.
"""

from __future__ import annotations

import itertools
import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray


class Leakage:
    """Leakage among tones near given frequencies.

    Parameters
    ----------
    frequency_hz : [n]
        What the pieces of each tone were turned back by [Hz].
    sample_rate_hz, length
        Sample rate [Hz], and samples L in a piece.
    """

    def __init__(self, frequency_hz: FloatArray, sample_rate_hz: float, length: int) -> None:
        self._per_hz, self._length = math.pi / sample_rate_hz, length
        places = [self._per_hz * f for f in frequency_hz.tolist()]
        count = len(places)
        rows = [[[0.0] * count for _ in range(4)] for _ in range(count)]
        # Even and odd in a; a dozen numbers are quicker without arrays.
        for k, n in itertools.combinations(range(count), 2):
            a = places[n] - places[k]
            scale = 1.0 / (length * math.sin(a))
            even, odd = math.sin(length * a) * scale, math.cos(length * a) * scale
            cot = 1.0 / math.tan(a)
            for row, column, side in ((rows[k], n, 1.0), (rows[n], k, -1.0)):
                row[0][column], row[1][column] = even, side * odd
                row[2][column], row[3][column] = -side * even * cot, -odd * cot
        self._matrix = np.array(rows, dtype=np.complex128).reshape(count, -1)
        self._terms: FloatArray = np.zeros((4, count, 1))
        self.own: FloatArray = np.ones((count, 1))
        """Response [n, pieces] of the pieces to their own tone."""

    def move(self, moving_hz: FloatArray) -> None:
        """Tell how far from its frequency each tone is in each piece, [n, pieces] [Hz]."""
        b = self._per_hz * moving_hz
        terms = np.empty((4, *b.shape))
        angle = self._length * b
        np.cos(angle, out=terms[0])
        np.sin(angle, out=terms[1])
        np.multiply(terms[:2], b, out=terms[2:])
        self._terms = terms
        square = angle**2
        self.own = 1.0 - square * (1.0 / 6.0 - square / 120.0)

    def into(self, tones: ComplexArray) -> ComplexArray:
        """Leakage of all tones into the pieces of each, both [n, pieces].

        ``tones`` are their values at the middles of the pieces, which must have been told by
        `move`; the leakage is not yet turned back.
        """
        spread = (self._terms * tones).reshape(-1, tones.shape[1])
        return np.asarray(self._matrix @ spread)
