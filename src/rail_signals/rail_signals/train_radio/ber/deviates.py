"""Random words and normal deviates of many lanes at once, for compiled kernels.

Words are those of SFC32 (Doty-Humphrey, PractRand), one generator per lane. A complex normal
deviate is that of Box and Muller from one word w: radius ``sqrt(-ln u)``, ``u = (w | 1) / 2^32``,
direction by the low 8 bits of w. So the radius reaches 6.7 standard deviations of one part; beyond
5.7 (probability 6e-8), where u has only 8 bits left, it depends on the direction. Means over
256 equal directions are the midpoint rule for Craig's integral: Q(x) comes out within 1e-6 of
itself up to x = 6.

Logarithm, sine and cosine are polynomials in single precision, of least largest error: 1.1e-6 of
the logarithm, 6e-7 and 5e-8 of the direction. Each loop works on one view of a buffer only, so
that it can be compiled for several lanes at once.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.random import BitGenerator
from numpy.typing import NDArray

from rail_signals.compiled import compiled

SingleArray: TypeAlias = NDArray[np.float32]
WordArray: TypeAlias = NDArray[np.uint32]

_SETTLING = 12
_SCALE = np.float32(2.0**-32)
_STEP, _MIDDLE = np.float32(math.pi / 128), np.float32(63.5)
_ONE, _LN_2 = np.float32(1), np.float32(math.log(2))
# A single-precision number: bits of sqrt(1/2), and of its fraction.
_ROOT_HALF, _FRACTION = np.int32(0x3F3504F3), np.int32(0x7FFFFF)
# ln(1 + f) / f from sqrt(1/2) to sqrt(2).
_L0, _L1, _L2 = np.float32(1.00000097), np.float32(-0.50001113), np.float32(0.33314509)
_L3, _L4, _L5 = np.float32(-0.24909744), np.float32(0.2049633), np.float32(-0.1866786)
_L6 = np.float32(0.11896109)
# sin(a) / a and (cos(a) - 1) / a^2 from -pi/2 to pi/2, by a^2.
_S0, _S1 = np.float32(0.999996617), np.float32(-0.166648287)
_S2, _S3 = np.float32(8.30632773e-3), np.float32(-1.83637144e-4)
_C0, _C1 = np.float32(-0.499999324), np.float32(0.0416639920)
_C2, _C3 = np.float32(-1.38559437e-3), np.float32(2.31947054e-5)


def seeded_lanes(generator: BitGenerator, lanes: int) -> WordArray:
    """States of as many generators as there are lanes, uint32 [4, lanes], from one generator."""
    states = generator.random_raw(2 * lanes).view(np.uint32).reshape(4, lanes)
    states[3] = 1  # the counter
    _settle(states, np.empty(lanes, dtype=np.uint32))
    return states


@compiled
def draw_words(states: WordArray, word: WordArray) -> None:
    """Next word of every lane.

    Parameters
    ----------
    states : uint32 [4, lanes]
        Carried on.
    word : uint32 [lanes]
        Result.
    """
    a, b, c, counter = states[0], states[1], states[2], states[3]
    for i in range(len(word)):
        total = np.uint32(np.uint32(a[i] + b[i]) + counter[i])
        counter[i] = np.uint32(counter[i] + np.uint32(1))
        a[i] = b[i] ^ (b[i] >> np.uint32(9))
        last = c[i]
        b[i] = np.uint32(last + np.uint32(last << np.uint32(3)))
        turned = np.uint32(np.uint32(last << np.uint32(21)) | (last >> np.uint32(11)))
        c[i] = np.uint32(turned + total)
        word[i] = total


@compiled
def _settle(states: WordArray, word: WordArray) -> None:
    """Let go of the first words, which still show the seed."""
    for _ in range(_SETTLING):
        draw_words(states, word)


@compiled
def normal_deviates(
    word: WordArray,
    negative_power: np.float32,
    uniform: SingleArray,
    uniform_bits: NDArray[np.int32],
    mantissa: SingleArray,
    mantissa_bits: NDArray[np.int32],
    out: SingleArray,
) -> None:
    """Circular complex normal deviates.

    Parameters
    ----------
    word : uint32 [lanes]
    negative_power
        Mean square of a deviate, times -1.
    uniform, uniform_bits, mantissa, mantissa_bits : float32 and int32 [lanes]
        Two buffers, each with the view of its bits.
    out : float32 [2, lanes]
        Real and imaginary parts; result.
    """
    real, imag = out[0], out[1]
    for i in range(len(word)):
        uniform[i] = np.float32(word[i] | np.uint32(1)) * _SCALE
    for i in range(len(word)):
        bits = np.int32(uniform_bits[i] - _ROOT_HALF)
        mantissa_bits[i] = np.int32((bits & _FRACTION) + _ROOT_HALF)
        real[i] = np.float32(np.int32(bits >> np.int32(23)))
    for i in range(len(word)):
        f = mantissa[i] - _ONE
        log = f * (_L0 + f * (_L1 + f * (_L2 + f * (_L3 + f * (_L4 + f * (_L5 + f * _L6))))))
        radius = math.sqrt((real[i] * _LN_2 + log) * negative_power)
        low = np.int32(word[i])
        # Half a turn by the sign, 128 directions about zero by the rest; none is along an axis.
        radius *= np.float32(np.int32(np.int32(1) - ((low >> np.int32(6)) & np.int32(2))))
        a = (np.float32(np.int32(low & np.int32(127))) - _MIDDLE) * _STEP
        z = a * a
        real[i] = radius * (_ONE + z * (_C0 + z * (_C1 + z * (_C2 + z * _C3))))
        imag[i] = radius * (a * (_S0 + z * (_S1 + z * (_S2 + z * _S3))))
