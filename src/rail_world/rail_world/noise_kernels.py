"""White Gaussian noise at places of its own, compiled.

Words are those of Philox 4x64-10 (Salmon et al., *Parallel random numbers: as easy as 1, 2, 3*,
2011, section 4.3), numbered as `numpy.random.Philox` puts them out: word w of a place is word
``w mod 4`` of the counter ``(1 + w div 4, stage, port, tick)``. So any stretch of a block is drawn
without what is before it. A word has two halves of 32 bits, the lower one first.

Of a block of n numbers, number i is made of half i, its magnitude, and of half n + i, its angle
(Box and Muller, 1958).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from rail_signals.compiled import compiled
from rail_signals.single_precision import phasor

#: Halves of 32 bits that one counter gives.
_HALVES = 8
_ROUNDS = 10
_M0, _M1 = np.uint64(0xD2E7470EE14C6C93), np.uint64(0xCA5A826395121157)
_W0, _W1 = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xBB67AE8584CAA73B)
_LOW, _32 = np.uint64(0xFFFFFFFF), np.uint64(32)
_ONE, _TWO, _HALF = np.float32(1.0), np.float32(2.0), np.float32(0.5)
_WORD, _QUARTERS = np.float32(2.0**-32), np.float32(2.0**-30)
# FreeBSD's logf between sqrt(1/2) and sqrt(2), and the bits of that root and of one.
_L2, _L4 = np.float32(0.66666662693), np.float32(0.40000972152)
_L6, _L8 = np.float32(0.28498786688), np.float32(0.24279078841)
_LN2_HIGH, _LN2_LOW = np.float32(6.9313812256e-01), np.float32(9.0580006145e-06)
_ROOT_BITS, _ONE_BITS = np.int32(0x3F3504F3), np.int32(0x3F800000)


@compiled
def _high(a: Any, b: Any) -> Any:
    """Upper 64 bits of a product of two words."""
    a0, a1, b0, b1 = a & _LOW, a >> _32, b & _LOW, b >> _32
    cross0, cross1 = a0 * b1, a1 * b0
    carried = ((a0 * b0) >> _32) + (cross0 & _LOW) + (cross1 & _LOW)
    return a1 * b1 + (cross0 >> _32) + (cross1 >> _32) + (carried >> _32)


@compiled
def placed_words(key: Any, stage: Any, port: Any, tick: Any, first: Any, words: Any) -> None:
    """Fill ``words`` uint64 [counter, 4] from the counter ``1 + first`` on.

    ``key`` uint64 [2]; the others integers.
    """
    for row in range(words.shape[0]):
        c0, c1 = np.uint64(1 + first + row), np.uint64(stage)
        c2, c3 = np.uint64(port), np.uint64(tick)
        k0, k1 = key[0], key[1]
        for _ in range(_ROUNDS):
            high0, high1 = _high(_M0, c0), _high(_M1, c2)
            c0, c1, c2, c3 = high1 ^ c1 ^ k0, _M1 * c2, high0 ^ c3 ^ k1, _M0 * c0
            k0, k1 = k0 + _W0, k1 + _W1
        words[row, 0], words[row, 1], words[row, 2], words[row, 3] = c0, c1, c2, c3


@compiled
def _halves(key: Any, stage: Any, port: Any, tick: Any, begin: Any, count: Any, words: Any) -> Any:
    """Halves ``begin`` to ``begin + count`` of a place, uint32 [count]; ``words`` is room."""
    first = begin // _HALVES
    counters = (begin + count + _HALVES - 1) // _HALVES - first
    placed_words(key, stage, port, tick, first, words[:counters])
    skip = begin - first * _HALVES
    return words.reshape(-1).view(np.uint32)[skip : skip + count]


@compiled
def _minus_logarithm(halves: Any, mantissa: Any, exponent: Any, out: Any) -> None:
    """``-ln((halves + 1/2) / 2^32)``, float32 [n]; of (0, 1], as a logarithm of 0 is infinite."""
    bits = mantissa.view(np.int32)
    for i in range(out.shape[0]):
        mantissa[i] = (np.float32(halves[i]) + _HALF) * _WORD
    for i in range(out.shape[0]):
        shifted = np.int32(bits[i] + (_ONE_BITS - _ROOT_BITS))
        exponent[i] = np.float32(np.int32((shifted >> 23) - 127))
        bits[i] = np.int32((shifted & 0x7FFFFF) + _ROOT_BITS)
    for i in range(out.shape[0]):
        f = mantissa[i] - _ONE
        s = f / (_TWO + f)
        z = s * s
        w = z * z
        series = z * (_L2 + w * _L6) + w * (_L4 + w * _L8)
        square = _HALF * f * f
        low = s * (square + series) + exponent[i] * _LN2_LOW
        out[i] = -(low - square + f + exponent[i] * _LN2_HIGH)


@compiled
def _turned(halves: Any, i: Any) -> Any:
    """Cosine and sine of a half as a fraction of a turn."""
    half = halves[i]
    quarter = np.uint32(np.uint32(half + np.uint32(1 << 29)) >> np.uint32(30))
    rest = np.int32(np.uint32(half - np.uint32(quarter << np.uint32(30))))
    return phasor(np.int32(quarter), np.float32(rest) * _QUARTERS)


@compiled
def complex_stretch(
    key: Any, stage: Any, port: Any, tick: Any, block: Any, begin: Any, sigma: Any, out: Any
) -> None:
    """Complex numbers from ``begin`` of a block of ``block`` on, of the mean power ``sigma^2``.

    ``out`` float32 [2 n], real and imaginary parts in turn; ``sigma`` float32.
    """
    count = out.shape[0] // 2
    words = np.empty((count // _HALVES + 2, 4), np.uint64)
    magnitude = np.empty(count, np.float32)
    mantissa, exponent = np.empty(count, np.float32), np.empty(count, np.float32)
    halves = _halves(key, stage, port, tick, begin, count, words)
    _minus_logarithm(halves, mantissa, exponent, magnitude)
    for i in range(count):
        magnitude[i] = np.sqrt(magnitude[i])
    halves = _halves(key, stage, port, tick, block + begin, count, words)
    for i in range(count):
        cosine, sine = _turned(halves, i)
        out[2 * i] = magnitude[i] * cosine * sigma
        out[2 * i + 1] = magnitude[i] * sine * sigma


@compiled
def complex_blocks(key: Any, stage: Any, ports: Any, tick: Any, sigma: Any, out: Any) -> None:
    """Whole blocks ``out`` float32 [port, 2 n] as of `complex_stretch`; ``sigma`` [port]."""
    for row in range(len(ports)):
        block = out.shape[1] // 2
        complex_stretch(key, stage, ports[row], tick, block, 0, sigma[row], out[row])


@compiled
def real_blocks(key: Any, stage: Any, ports: Any, tick: Any, out: Any) -> None:
    """Real numbers ``out`` float32 [port, n] of variance 1.

    Of a block the cosines stand in the first half, the sines in the second.
    """
    samples = out.shape[1]
    half = (samples + 1) // 2
    words = np.empty((half // _HALVES + 2, 4), np.uint64)
    magnitude = np.empty(half, np.float32)
    mantissa, exponent = np.empty(half, np.float32), np.empty(half, np.float32)
    whole = np.empty(2 * half, np.float32)
    for row in range(len(ports)):
        halves = _halves(key, stage, ports[row], tick, 0, half, words)
        _minus_logarithm(halves, mantissa, exponent, magnitude)
        for i in range(half):
            magnitude[i] = np.sqrt(_TWO * magnitude[i])
        halves = _halves(key, stage, ports[row], tick, half, half, words)
        for i in range(half):
            cosine, sine = _turned(halves, i)
            whole[i] = magnitude[i] * cosine
            whole[half + i] = magnitude[i] * sine
        out[row] = whole[:samples]


@compiled
def words_at(key: Any, stage: Any, ports: Any, tick: Any, words: Any) -> None:
    """Fill ``words`` uint64 [port, counter, 4] with the first ones of each port."""
    for row in range(len(ports)):
        placed_words(key, stage, ports[row], tick, 0, words[row])


@compiled
def complex_windows(
    key: Any, stage: Any, windows: Any, tick: Any, each: Any, sigma: Any, out: Any
) -> None:
    """Windows of `rail_world.ranging.noise.NoiseSource.windows`, side by side.

    ``each`` samples of an antenna in a block; ``sigma`` float32 [window]; ``out`` float32
    [antenna, 2 n].
    """
    antennas = out.shape[0]
    at = 0
    for window in range(len(windows)):
        port, start, stop = windows[window, 0], windows[window, 1], windows[window, 2]
        sample = start
        while sample < stop:
            block = sample // each
            end = min(stop, (block + 1) * each)
            after = at + end - sample
            for antenna in range(antennas):
                begin = antenna * each + sample - block * each
                row = out[antenna, 2 * at : 2 * after]
                complex_stretch(
                    key, stage, port + block, tick, antennas * each, begin, sigma[window], row
                )
            at, sample = after, end
