"""Compiled pass over sections of one kind of cable.

NumPy would write and read back every step of the sums for every section. Here a block of
frequencies stays in the registers and the nearest cache while it runs through all sections.
Exponential, sine and cosine are written out, because a compiler makes vector instructions of
sums and products but not of calls: reduction by Cody and Waite ("Software Manual for the
Elementary Functions", 1980), the series of the exponential to the thirteenth power, and the
polynomials of sine and cosine of Sun's fdlibm; within 4e-16 of the exact value.
"""

from __future__ import annotations

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.compiled import compiled

_BLOCK = 512

#: Added and taken away again, it rounds to a whole number.
_ROUND = 1.5 * 2.0**52
_PER_LN_2 = 1.4426950408889634
_LN_2_HIGH, _LN_2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
#: Two raised to less would not be a normal number.
_LEAST = -1021.0
_PER_QUARTER = 0.6366197723675814
_QUARTER_HIGH = 1.57079632673412561417e00
_QUARTER_MIDDLE = 6.07710050630396597660e-11
_QUARTER_LOW = 2.02226624879595063154e-21


@compiled
def through_sections(
    voltage: FloatArray,
    drop: FloatArray,
    attenuation: FloatArray,
    phase: FloatArray,
    length_m: FloatArray,
    ratio: FloatArray,
) -> None:
    """Carry voltage and current over sections of one cable, from the load on, in place.

    Parameters
    ----------
    voltage, drop : float [2 frequencies]
        Voltage, and the current times the impedance of the cable, real and imaginary parts in
        turn. Both come out multiplied by one factor.
    attenuation, phase : float [frequencies]
        Attenuation constant [Np/m] and phase constant [rad/m].
    length_m : float [sections]
        Electrical lengths [m], the last section first.
    ratio : float [sections]
        Impedance of each section over that of the one before, of the first over the cable's.
    """
    v_re, v_im = np.empty(_BLOCK), np.empty(_BLOCK)
    d_re, d_im = np.empty(_BLOCK), np.empty(_BLOCK)
    decay_re, decay_im = np.empty(_BLOCK), np.empty(_BLOCK)
    bits = np.empty(_BLOCK, dtype=np.int64)
    for first in range(0, len(phase), _BLOCK):
        count = min(_BLOCK, len(phase) - first)
        v, d = voltage[2 * first : 2 * (first + count)], drop[2 * first : 2 * (first + count)]
        for n in range(count):
            v_re[n], v_im[n] = v[2 * n], v[2 * n + 1]
            d_re[n], d_im[n] = d[2 * n], d[2 * n + 1]
        alpha, beta = attenuation[first : first + count], phase[first : first + count]
        for section in range(len(length_m)):
            section_decay(alpha, beta, 2.0 * length_m[section], bits, decay_re, decay_im)
            _through(ratio[section], count, decay_re, decay_im, v_re, v_im, d_re, d_im)
        for n in range(count):
            v[2 * n], v[2 * n + 1] = v_re[n], v_im[n]
            d[2 * n], d[2 * n + 1] = d_re[n], d_im[n]


@compiled
def section_decay(
    attenuation: FloatArray,
    phase: FloatArray,
    length_m: float,
    bits: np.ndarray[tuple[int], np.dtype[np.int64]],
    decay_re: FloatArray,
    decay_im: FloatArray,
) -> None:
    """Real and imaginary part of ``exp(-(alpha + j beta) l)`` [frequencies].

    `bits` is room for as many numbers; exponentials below 1e-307 are told as that.
    """
    power = bits.view(np.float64)
    for n in range(len(phase)):
        whole = (-attenuation[n] * length_m * _PER_LN_2 + _ROUND) - _ROUND
        bits[n] = (np.int64(max(whole, _LEAST)) + 1023) << 52
    for n in range(len(phase)):
        x = max(-attenuation[n] * length_m, _LEAST / _PER_LN_2)
        whole = (x * _PER_LN_2 + _ROUND) - _ROUND
        r = (x - whole * _LN_2_HIGH) - whole * _LN_2_LOW
        p = 1.0 / 479001600.0 + r * (1.0 / 6227020800.0)
        p = 1.0 / 39916800.0 + r * p
        p = 1.0 / 3628800.0 + r * p
        p = 1.0 / 362880.0 + r * p
        p = 1.0 / 40320.0 + r * p
        p = 1.0 / 5040.0 + r * p
        p = 1.0 / 720.0 + r * p
        p = 1.0 / 120.0 + r * p
        p = 1.0 / 24.0 + r * p
        p = 1.0 / 6.0 + r * p
        p = 0.5 + r * p
        size = (1.0 + r * (1.0 + r * p)) * power[n]
        angle = phase[n] * length_m
        k = (angle * _PER_QUARTER + _ROUND) - _ROUND
        t = ((angle - k * _QUARTER_HIGH) - k * _QUARTER_MIDDLE) - k * _QUARTER_LOW
        z = t * t
        s = -2.50507602534068634195e-08 + z * 1.58969099521155010221e-10
        s = 2.75573137070700676789e-06 + z * s
        s = -1.98412698298579493134e-04 + z * s
        s = 8.33333333332248946124e-03 + z * s
        sine = t + t * z * (-1.66666666666666324348e-01 + z * s)
        c = 2.08757232129817482790e-09 + z * -1.13596475577881948265e-11
        c = -2.75573143513906633035e-07 + z * c
        c = 2.48015872894767294178e-05 + z * c
        c = -1.38888888888741095749e-03 + z * c
        c = 4.16666666666666019037e-02 + z * c
        cosine = 1.0 - (0.5 * z - z * z * c)
        # Quarter turns from -2 to 2.
        q = k - 4.0 * ((k * 0.25 + _ROUND) - _ROUND)
        odd, even = q * (2.0 - abs(q)), 1.0 - abs(q)
        even = even * abs(even)
        decay_re[n] = size * (even * cosine - odd * sine)
        decay_im[n] = -size * (even * sine + odd * cosine)


@compiled
def _through(
    ratio: float,
    count: int,
    decay_re: FloatArray,
    decay_im: FloatArray,
    v_re: FloatArray,
    v_im: FloatArray,
    d_re: FloatArray,
    d_im: FloatArray,
) -> None:
    """One section: voltage and drop from forward and backward wave."""
    half = 0.5 * ratio
    for n in range(count):
        re, im = half * d_re[n], half * d_im[n]
        f_re, f_im = 0.5 * v_re[n] + re, 0.5 * v_im[n] + im
        b_re, b_im = 0.5 * v_re[n] - re, 0.5 * v_im[n] - im
        w_re = b_re * decay_re[n] - b_im * decay_im[n]
        w_im = b_re * decay_im[n] + b_im * decay_re[n]
        v_re[n], v_im[n] = f_re + w_re, f_im + w_im
        d_re[n], d_im[n] = f_re - w_re, f_im - w_im
