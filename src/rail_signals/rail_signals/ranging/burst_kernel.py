"""Compiled part of the line receiver: from sums of a burst to its estimates.

Each burst is computed by itself, in double precision and in one order, so that its result does
not depend on the batch. Tables come from `OffsetSearch` and `TonePhaseFit`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .burst_sums import (
    add_pair,
    add_row,
    energy_of,
    project,
    project_rows,
    sum_of_squares,
    sum_rows,
    weight_of,
)

_TURN = 2 * math.pi
_LANES = 8
#: Numbers of the search, before those of the fit.
SEARCH_NUMBERS = 6


@compiled
def estimate_bursts(
    energy: FloatArray,
    rows: NDArray[np.floating],
    bases: FloatArray,
    grid: FloatArray,
    tapers: FloatArray,
    orders: NDArray[np.int64],
    fit: FloatArray,
    pairs: NDArray[np.int64],
    pair_weights: FloatArray,
    numbers: FloatArray,
    table: FloatArray,
    detected: BoolArray,
) -> None:
    """Fill the fields of `ToneEstimate` of each burst.

    Parameters
    ----------
    energy : float64 [batch]
        Energy of each burst; empty if it is to be computed here, from rows that are the periods.
    rows : float [batch, rows * 2 period]
        Its periods, or sums of them weighted by `tapers`, real and imaginary parts in turn.
    bases : float64 [2 strong + 2 components, 2 period]
        From a period to its strong components, real parts, then imaginary parts; and from a
        folded period to all components, real and imaginary parts in turn.
    grid : float64 [2, frequencies, segments]
        Cosine and sine of the turns of the segments at the offsets of the grid from zero up.
    tapers : float64 [rows, half]
        Weights of the periods from the middle of the burst up, twice, but for that in the
        middle, then zeros; empty if the rows are the periods.
    orders : int64 [components, tones]
        Orders of the components.
    fit : float64 [components, tones + 2]
        Weights of amplitude and steps, and whether the component is a strong one.
    pairs : int64 [pairs, 3], pair_weights : float64 [pairs]
        Tone, upper and lower component of neighbours, and their weights.
    numbers : float64 [13 + 2 tones]
        `OffsetSearch.numbers`, all zero if there is no search. Ceiling of the carrier-to-noise
        ratio; scales (`TonePhaseFit`): noise, fold, power of the components, chi-square,
        threshold; largest order; variances and curvatures.
    table : float64 [batch, 2 tones + 4], detected : bool [batch]
        The result.
    """
    width, count, tones = bases.shape[1], orders.shape[0], orders.shape[1]
    strong, segments = len(bases) - 2 * count, grid.shape[2]
    top = int(numbers[SEARCH_NUMBERS + 6])
    vectors = np.empty((3, width))
    folded, in_phase, quadrature = vectors[0], vectors[1], vectors[2]
    turn = np.empty((2, max(rows.shape[1] // width, tapers.shape[1], width // 2)))
    own, found = np.empty((segments, strong)), np.empty((1, 2 * count))
    responses = np.empty((2 * grid.shape[1], strong + 1))
    components = found[0]
    phasors = np.empty((tones, 2 * top + 1), dtype=np.complex128)
    for burst in range(len(rows)):
        total = energy[burst] if len(energy) else energy_of(rows, burst)
        offset_hz = 0.0
        if numbers[0] == 0.0:
            sum_rows(folded, rows, burst, 0, 1)
        else:
            repeats = rows.shape[1] // (width * segments)
            if repeats == 1:
                for segment in range(0, segments, 2):
                    other = min(segment + 1, segments - 1)
                    project_rows(rows, burst, segment, other, bases, own)
            else:
                for segment in range(segments):
                    sum_rows(folded, rows, burst, segment * repeats, (segment + 1) * repeats)
                    project(folded, bases, 0, own, segment)
            offset_hz = _offset_hz(own, grid, numbers, responses)
            _fold(rows, burst, tapers, numbers, offset_hz, turn, in_phase, quadrature, folded)
        project(folded, bases, strong, found, 0)
        detected[burst] = _fit_tones(
            total,
            offset_hz,
            sum_of_squares(folded),
            components,
            orders,
            fit,
            pairs,
            pair_weights,
            numbers,
            phasors,
            table,
            burst,
        )


@compiled
def _offset_hz(
    components: FloatArray, grid: FloatArray, numbers: FloatArray, responses: FloatArray
) -> float:
    """Offset [Hz] where the summed power of the components peaks.

    `responses` [2 frequencies, 2 strong + 1] is space for the components at each offset, and
    their power.
    """
    count = components.shape[1] // 2
    power = 2 * count
    zero = grid.shape[1] - 1
    for g in range(zero + 1):
        above, below = 0.0, 0.0
        up, down = zero + g, zero - g
        for c in range(count):
            # The turns below zero are the conjugates of those above.
            rr, ri, ir, ii = 0.0, 0.0, 0.0, 0.0
            for segment in range(components.shape[0]):
                re, im = components[segment, c], components[segment, count + c]
                cosine, sine = grid[0, g, segment], grid[1, g, segment]
                rr += cosine * re
                ii += sine * im
                ri += cosine * im
                ir += sine * re
            responses[up, c], responses[up, count + c] = rr - ii, ri + ir
            responses[down, c], responses[down, count + c] = rr + ii, ri - ir
            above += (rr - ii) * (rr - ii) + (ri + ir) * (ri + ir)
            below += (rr + ii) * (rr + ii) + (ri - ir) * (ri - ir)
        responses[down, power] = below
        responses[up, power] = above
    peak = 1
    for g in range(2, 2 * zero):
        if responses[g, power] > responses[peak, power]:
            peak = g
    total = 0.0
    for c in range(2 * count):
        both = responses[peak - 1, c] + responses[peak + 1, c]
        total += both * both
    quotient = (responses[peak + 1, power] - responses[peak - 1, power]) / total
    return float(math.atan(quotient * numbers[1]) * numbers[2] + numbers[0] * (peak - zero))


@compiled
def _turns(count: int, half: int, half_step: float, turn: FloatArray) -> None:
    """Cosine and sine of ``(n - (count - 1) / 2) step``, so many from the middle up."""
    cosine, sine = math.cos(half_step), math.sin(half_step)
    square, cross = cosine * cosine - sine * sine, 2.0 * cosine * sine
    turn[0, 0], turn[1, 0] = (1.0, 0.0) if count % 2 else (cosine, sine)
    for n in range(1, min(half, _LANES)):
        re, im = turn[0, n - 1], turn[1, n - 1]
        turn[0, n], turn[1, n] = re * square - im * cross, re * cross + im * square
    # Eight steps at once: chains of products that do not wait for each other.
    for _ in range(3):
        square, cross = square * square - cross * cross, 2.0 * square * cross
    for n in range(_LANES, half):
        re, im = turn[0, n - _LANES], turn[1, n - _LANES]
        turn[0, n], turn[1, n] = re * square - im * cross, re * cross + im * square


@compiled
def _fold(
    rows: NDArray[np.floating],
    burst: int,
    tapers: FloatArray,
    numbers: FloatArray,
    offset_hz: float,
    turn: FloatArray,
    in_phase: FloatArray,
    quadrature: FloatArray,
    folded: FloatArray,
) -> None:
    """Sum of the periods after turning back by an offset about the middle of the burst."""
    width = len(folded)
    count = rows.shape[1] // width
    for j in range(width):
        in_phase[j], quadrature[j] = 0.0, 0.0
    if tapers.shape[1]:
        _turns(int(numbers[5]), tapers.shape[1], numbers[4] * offset_hz, turn)
        # Even sequences have cosines only, odd ones sines.
        for k in range(count):
            factor = weight_of(turn, k % 2, tapers, k)
            add_row(in_phase if k % 2 == 0 else quadrature, factor, rows, burst, k)
    else:
        half = (count + 1) // 2
        _turns(count, half, numbers[4] * offset_hz, turn)
        for n in range(half):
            late, early = count - half + n, half - 1 - n
            if late == early:
                add_row(in_phase, 1.0, rows, burst, late)
            else:
                cosine, sine = turn[0, n], turn[1, n]
                add_pair(in_phase, quadrature, cosine, sine, rows, burst, late, early)
    period = width // 2
    half = (period + 1) // 2
    _turns(period, half, numbers[3] * offset_hz, turn)
    for n in range(half):
        cosine, sine = turn[0, n], turn[1, n]
        late, early = 2 * (period - half + n), 2 * (half - 1 - n)
        re, im = in_phase[late] + quadrature[late + 1], in_phase[late + 1] - quadrature[late]
        folded[late], folded[late + 1] = re * cosine + im * sine, im * cosine - re * sine
        re, im = in_phase[early] + quadrature[early + 1], in_phase[early + 1] - quadrature[early]
        if early != late:
            folded[early], folded[early + 1] = re * cosine - im * sine, im * cosine + re * sine


@compiled
def _wrapped(phase_rad: float) -> float:
    """Phase [rad] in [0, 2 pi): that of a tiny negative one would round to a full turn."""
    wrapped = phase_rad - _TURN * math.floor(phase_rad / _TURN)
    return 0.0 if wrapped >= _TURN else max(wrapped, 0.0)


@compiled
def _fit_tones(
    energy: float,
    offset_hz: float,
    folded_energy: float,
    found: FloatArray,
    orders: NDArray[np.int64],
    fit: FloatArray,
    pairs: NDArray[np.int64],
    pair_weights: FloatArray,
    numbers: FloatArray,
    phasors: ComplexArray,
    table: FloatArray,
    burst: int,
) -> bool:
    """One Gauss-Newton step from the products of neighbours; False if nothing is detected."""
    count, tones = orders.shape
    inside, strong = 0.0, 0.0
    for c in range(count):
        square = found[2 * c] * found[2 * c] + found[2 * c + 1] * found[2 * c + 1]
        inside += square
        strong += fit[c, tones + 1] * square
    if not strong > energy * numbers[SEARCH_NUMBERS + 5]:
        for tone in range(tones):
            table[burst, tone], table[burst, tones + tone] = math.nan, math.inf
        table[burst, 2 * tones], table[burst, 2 * tones + 1] = 0.0, 0.0
        table[burst, 2 * tones + 2], table[burst, 2 * tones + 3] = math.nan, math.nan
        return False
    top = int(numbers[SEARCH_NUMBERS + 6])
    for tone in range(tones):
        re, im = 0.0, 0.0
        for p in range(len(pairs)):
            if pairs[p, 0] == tone:
                u, v, w = 2 * pairs[p, 1], 2 * pairs[p, 2], pair_weights[p]
                re += w * (found[u] * found[v] + found[u + 1] * found[v + 1])
                im += w * (found[u] * found[v + 1] - found[u + 1] * found[v])
        phase = math.atan2(im, re)
        table[burst, tone] = phase
        step = complex(math.cos(phase), math.sin(phase))
        power = 1.0 + 0.0j
        phasors[tone, top] = power
        for order in range(1, top + 1):
            power *= step
            phasors[tone, top + order] = power
            phasors[tone, top - order] = power.conjugate()
    amplitude = 0j
    for c in range(count):
        turned = complex(found[2 * c], found[2 * c + 1])
        for tone in range(tones):
            turned *= phasors[tone, top + orders[c, tone]]
        found[2 * c], found[2 * c + 1] = turned.real, turned.imag
        amplitude += turned * fit[c, 0]
    square = amplitude.real * amplitude.real + amplitude.imag * amplitude.imag
    power_found = square
    for tone in range(tones):
        re, im = 0.0, 0.0
        for c in range(count):
            re += found[2 * c] * fit[c, 1 + tone]
            im += found[2 * c + 1] * fit[c, 1 + tone]
        slope = im * amplitude.real - re * amplitude.imag
        step_rad = slope / square
        table[burst, tone] = _wrapped(table[burst, tone] - step_rad)
        # The step adds to what the fit explains, to second order.
        power_found += slope * step_rad * numbers[SEARCH_NUMBERS + 7 + tones + tone]
    # Every component is in the folded period, so the energy outside it is noise.
    noise = max(
        energy * numbers[SEARCH_NUMBERS + 1] - folded_energy * numbers[SEARCH_NUMBERS + 2],
        power_found / numbers[SEARCH_NUMBERS + 0],
    )
    snr = power_found / noise
    for tone in range(tones):
        table[burst, tones + tone] = numbers[SEARCH_NUMBERS + 7 + tone] / snr
    table[burst, 2 * tones] = math.sqrt(power_found)
    table[burst, 2 * tones + 1] = snr
    table[burst, 2 * tones + 2] = offset_hz
    table[burst, 2 * tones + 3] = (
        (inside - power_found * numbers[SEARCH_NUMBERS + 3]) * numbers[SEARCH_NUMBERS + 4] / noise
    )
    return True
