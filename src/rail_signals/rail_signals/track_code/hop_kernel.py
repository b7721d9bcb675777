"""Compiled part of the demodulator for long inputs: one hop after the other, each read once.

Whatever a hop needs stays in the innermost cache: its samples, the carrier's band, the angles. A
hop is computed by itself, in one order, so that its result does not depend on how many there are.
"""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.compiled import compiled, compiled_sums
from rail_signals.single_precision import angle

SingleArray: TypeAlias = NDArray[np.float32]

#: Numbers of taps are a multiple of these: of the filter in the band, and of those that decimate.
BAND_STEP, WINDOW_STEP = 4, 32
_1, _2, _3 = np.uint64(1), np.uint64(2), np.uint64(3)
_ZERO = np.float32(0.0)
_BLOCK = 8


@compiled
def demodulate_hops(
    frames: NDArray[np.floating],
    bits: NDArray[np.signedinteger],
    marks: NDArray[np.signedinteger],
    front: SingleArray,
    band: SingleArray,
    low_pass: SingleArray,
    sections: FloatArray,
    unturn: SingleArray,
    samples: SingleArray,
    decimated: SingleArray,
    in_band: SingleArray,
    angles: SingleArray,
    state: FloatArray,
    demodulated: FloatArray,
    amplitude: FloatArray,
    faulty: BoolArray,
) -> None:
    """Check, filter, decimate and demodulate a batch of hops.

    Parameters
    ----------
    frames : float32 or float64 [hops, frame]
        Passband wave.
    bits : int32 or int64 [hops, frame]
        The same as it is stored: magnitudes are in the order of these numbers.
    marks : int32 or int64 [3]
        All bits but the sign; those of the largest magnitude allowed; how many samples may
        have the peak value.
    front : float32 [2, taps]
        First filter, real and imaginary parts, the tap of the newest sample last.
    band : float32 [2, taps]
        Second filter, likewise.
    low_pass : float32 [taps]
        Filter behind the discriminator, likewise.
    sections : float64 [sections, 6]
        Filters at 128 Hz, of which every second output is kept.
    unturn : float32 [2]
        Cosine and sine of the carrier's own turn from sample to sample.
    samples : float32 [n], decimated, in_band : float32 [2, n], angles : float32 [n]
        What is kept of the hops before, then space for one more: the wave, its real and
        imaginary parts behind the first and the second filter, and its angles from sample to
        sample.
    state : float64 [sections, 2]
        Of `sections`.
    demodulated : float64 [hops, samples at 64 Hz], amplitude : float64 [hops]
        The result: frequency [Hz], and root mean square amplitude of the carrier in its band.
    faulty : bool [hops]
        Result: which hops are at fault as samples; they count as zeros.
    """
    fast = in_band.shape[1] - 1
    frame, low = frames.shape[1], np.empty(2 * demodulated.shape[1], np.float32)
    decimation, every = frame // fast, fast // len(low)
    # Views are made once: counting their references takes longer than much of the work.
    new_samples, new_angles = samples[len(samples) - frame :], angles[len(angles) - fast :]
    real, imag = decimated[0], decimated[1]
    new_real, new_imag = real[len(real) - fast :], imag[len(imag) - fast :]
    band_real, band_imag = in_band[0], in_band[1]
    front_re, front_im, band_re, band_im = front[0], front[1], band[0], band[1]
    for hop in range(len(frames)):
        if hop % _BLOCK == 0:
            # One long reading brings some hops into the cache sooner than many short ones.
            for ahead in range(hop, min(hop + _BLOCK, len(frames))):
                faulty[ahead] = _is_faulty(bits, ahead, marks)
        _take(frames, hop, faulty[hop], new_samples)
        _decimate(samples, front_re, front_im, decimation, new_real, new_imag)
        power = _filter_band(real, imag, band_re, band_im, band_real, band_imag)
        amplitude[hop] = math.sqrt(power / fast)
        _discriminate(band_real, band_imag, unturn[0], unturn[1], new_angles)
        _decimate_real(angles, low_pass, every, low)
        _filter_sections(low, sections, state, demodulated, hop)
        _move_down(samples, frame)
        _move_down(real, fast)
        _move_down(imag, fast)
        _move_down(angles, fast)


@compiled
def _is_faulty(bits: NDArray[np.signedinteger], hop: int, marks: NDArray[np.signedinteger]) -> bool:
    """Whether samples are silent, too loud, not finite or clipped; NaN is the largest.

    Integers are compared, which several lanes at once can do in any order.
    """
    kind: Any = bits.dtype.type
    mask = marks[0]
    peak = kind(0)
    for i in range(bits.shape[1]):
        size = kind(bits[hop, i] & mask)
        peak = size if size > peak else peak
    count = kind(0)
    for i in range(bits.shape[1]):
        count = kind(count + (kind(bits[hop, i] & mask) == peak))
    return not (0 < peak <= marks[1] and count <= marks[2])


@compiled
def _take(frames: NDArray[np.floating], hop: int, is_faulty: bool, samples: SingleArray) -> None:
    """Samples in single precision; zeros, where they are at fault."""
    if is_faulty:
        for i in range(len(samples)):
            samples[i] = _ZERO
    else:
        for i in range(len(samples)):
            samples[i] = np.float32(frames[hop, i])


@compiled_sums
def _decimate(
    samples: SingleArray,
    tap_re: SingleArray,
    tap_im: SingleArray,
    step: int,
    real: SingleArray,
    imag: SingleArray,
) -> None:
    """Products of complex taps with windows, each so many samples after the one before.

    Two at once: a tap that is loaded serves both.
    """
    for k in range(0, len(real) - 1, 2):
        # Without a sign there is no counting from the end, and a loop becomes vectors.
        one, other = np.uint64(k * step), np.uint64((k + 1) * step)
        a, b, c, d = np.float32(0.0), np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for i in range(len(tap_re)):
            x, y = samples[one + np.uint64(i)], samples[other + np.uint64(i)]
            a += x * tap_re[i]
            b += x * tap_im[i]
            c += y * tap_re[i]
            d += y * tap_im[i]
        real[k], imag[k], real[k + 1], imag[k + 1] = a, b, c, d


@compiled_sums
def _decimate_real(samples: SingleArray, taps: SingleArray, step: int, out: SingleArray) -> None:
    """The same with real taps."""
    for k in range(0, len(out) - 1, 2):
        one, other = np.uint64(k * step), np.uint64((k + 1) * step)
        a, b = np.float32(0.0), np.float32(0.0)
        for i in range(len(taps)):
            a += samples[one + np.uint64(i)] * taps[i]
            b += samples[other + np.uint64(i)] * taps[i]
        out[k], out[k + 1] = a, b


@compiled
def _filter_band(
    real: SingleArray,
    imag: SingleArray,
    tap_re: SingleArray,
    tap_im: SingleArray,
    out_real: SingleArray,
    out_imag: SingleArray,
) -> float:
    """Complex FIR filter of complex samples; sum of squares of its outputs.

    The first output is the last one of the call before.
    """
    newest = len(out_real) - 1
    out_real[0], out_imag[0] = out_real[newest], out_imag[newest]
    for k in range(newest):
        out_real[k + 1], out_imag[k + 1] = _ZERO, _ZERO
    for first in range(0, len(tap_re), BAND_STEP):
        _add_taps(real, imag, tap_re, tap_im, first, out_real, out_imag)
    return _sum_of_squares(out_real, out_imag)


@compiled_sums
def _add_taps(
    real: SingleArray,
    imag: SingleArray,
    tap_re: SingleArray,
    tap_im: SingleArray,
    first: int,
    out_real: SingleArray,
    out_imag: SingleArray,
) -> None:
    """Add the share of `BAND_STEP` taps to all outputs but the first.

    With so many, taps and samples stay in the processor's registers.
    """
    i, start = first, np.uint64(first)
    a, b, c, d = tap_re[i], tap_re[i + 1], tap_re[i + 2], tap_re[i + 3]
    p, q, r, s = tap_im[i], tap_im[i + 1], tap_im[i + 2], tap_im[i + 3]
    for k in range(len(out_real) - 1):
        j = start + np.uint64(k)
        x0, x1, x2, x3 = real[j], real[j + _1], real[j + _2], real[j + _3]
        y0, y1, y2, y3 = imag[j], imag[j + _1], imag[j + _2], imag[j + _3]
        out_real[k + 1] += (a * x0 + b * x1 + c * x2 + d * x3) - (p * y0 + q * y1 + r * y2 + s * y3)
        out_imag[k + 1] += (a * y0 + b * y1 + c * y2 + d * y3) + (p * x0 + q * x1 + r * x2 + s * x3)


@compiled_sums
def _sum_of_squares(one: SingleArray, other: SingleArray) -> float:
    """Of all but the first of both."""
    total = np.float32(0.0)
    for i in range(1, len(one)):
        total += one[i] * one[i] + other[i] * other[i]
    return float(total)


@compiled
def _discriminate(
    real: SingleArray, imag: SingleArray, cosine: Any, sine: Any, angles: SingleArray
) -> None:
    """Angle from each sample to the next, but for the carrier's own turn."""
    for j in range(len(angles)):
        along = real[j + 1] * real[j] + imag[j + 1] * imag[j]
        across = imag[j + 1] * real[j] - real[j + 1] * imag[j]
        angles[j] = angle(along * cosine + across * sine, across * cosine - along * sine)


@compiled
def _filter_sections(
    samples: SingleArray, sections: FloatArray, state: FloatArray, out: FloatArray, hop: int
) -> None:
    """Second-order sections in the order of `scipy.signal.sosfilt`; every second output."""
    for n in range(len(samples)):
        y = float(samples[n])
        for k in range(len(sections)):
            x = y
            y = sections[k, 0] * x + state[k, 0]
            state[k, 0] = sections[k, 1] * x - sections[k, 4] * y + state[k, 1]
            state[k, 1] = sections[k, 2] * x - sections[k, 5] * y
        if n % 2:
            out[hop, n // 2] = y


@compiled
def _move_down(kept: SingleArray, count: int) -> None:
    """Make room for so many at the end."""
    for i in range(len(kept) - count):
        kept[i] = kept[i + count]
