"""What the other tones leave in the pieces of a block that was turned back by one of them.

The mean over L samples of a tone whose angle a sample is 2 x away from what was turned back is
Dirichlet's kernel ``sin(L x) / (L sin x)`` of its value at the middle. With x = a + b, a of the
two tones and b of the piece (a tone that sweeps is elsewhere in every piece, but only a little,
so that ``1 / sin(a + b)`` is ``(1 - b cot a) / sin a``), the kernel is a sum of four
products of what depends on the two tones and what depends on the piece.
"""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled


@compiled
def leakage_matrix(frequency_hz: FloatArray, sample_rate_hz: float, length: int) -> FloatArray:
    """Of each tone on each other one what depends on the two, float64 [onto, from, 4].

    Parameters
    ----------
    frequency_hz : float64 [tone]
        What the pieces of each tone were turned back by.
    sample_rate_hz, length
        Sample rate, and samples L in a piece.
    """
    tones = len(frequency_hz)
    matrix = np.zeros((tones, tones, 4))
    for k in range(tones):
        for n in range(k + 1, tones):
            # Even and odd in a.
            a = math.pi / sample_rate_hz * (frequency_hz[n] - frequency_hz[k])
            scale = 1.0 / (length * math.sin(a))
            even, odd = math.sin(length * a) * scale, math.cos(length * a) * scale
            cot = 1.0 / math.tan(a)
            matrix[k, n] = even, odd, -even * cot, -odd * cot
            matrix[n, k] = even, -odd, even * cot, -odd * cot
    return matrix


@compiled
def add_leakage(
    tones: ComplexArray,
    moving_hz: FloatArray,
    matrix: FloatArray,
    sample_rate_hz: float,
    length: int,
    leakage: ComplexArray,
    own: FloatArray,
) -> None:
    """Leakage of all tones into the pieces of each.

    Parameters
    ----------
    tones : complex128 [tone, piece]
        Their values at the middles of the pieces, not turned back.
    moving_hz : float64 [tone, piece]
        How far from its frequency each tone is there.
    matrix, sample_rate_hz, length
        See `leakage_matrix`.
    leakage : complex128 [tone, piece]
        Not turned back either; result.
    own : float64 [tone, piece]
        Response of the pieces to their own tone; result.
    """
    count, pieces = tones.shape
    leakage[:] = 0.0
    for n in range(count):
        for p in range(pieces):
            b = math.pi / sample_rate_hz * moving_hz[n, p]
            angle = length * b
            square = angle * angle
            own[n, p] = 1.0 - square * (1.0 / 6.0 - square / 120.0)
            c, s = math.cos(angle), math.sin(angle)
            for k in range(count):
                if k != n:
                    of = matrix[k, n]
                    share = c * (of[0] + b * of[2]) + s * (of[1] + b * of[3])
                    leakage[k, p] += share * tones[n, p]
