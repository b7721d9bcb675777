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

_TURN = 2 * math.pi
_LANES = 4


@compiled
def estimate_bursts(
    energy: NDArray[np.floating],
    rows: NDArray[np.floating],
    components: NDArray[np.floating],
    strong: FloatArray,
    grid: FloatArray,
    tapers: FloatArray,
    search: FloatArray,
    basis: FloatArray,
    orders: NDArray[np.int64],
    fit: FloatArray,
    pairs: NDArray[np.int64],
    pair_weights: FloatArray,
    levels: FloatArray,
    table: FloatArray,
    detected: BoolArray,
) -> None:
    """Fill the fields of `ToneEstimate` of each burst.

    Parameters
    ----------
    energy : float [batch]
        Energy of each burst; empty if it is to be computed here, from rows that are the periods.
    rows : float [batch, rows, 2 period]
        Its periods, or sums of them weighted by `tapers`, real and imaginary parts in turn.
    components : float [batch, segments, 2 components]
        Strong components of its segments, real parts, then imaginary parts; empty if they are to
        be computed here.
    strong : float [2 components, 2 period]
        From a period to these.
    grid : float [2, frequencies, segments]
        Cosine and sine of the turns of the segments at the offsets of the grid from zero up.
    tapers : float [rows, half]
        Weights of the periods from the middle of the burst up, twice, but for that in the
        middle; empty if the rows are the periods.
    search : float [6]
        `OffsetSearch.numbers`; all zero if there is no search.
    basis : float [2 period, columns]
        From a folded period to its components, real and imaginary parts in turn.
    orders : int [components, tones]
        Orders of the components.
    fit : float [components, tones + 2]
        Weights of amplitude and steps, and whether the component is a strong one.
    pairs : int [pairs, 3], pair_weights : float [pairs]
        Tone, upper and lower component of neighbours, and their weights.
    levels : float [7 + 2 tones]
        Ceiling of the carrier-to-noise ratio; scales (`TonePhaseFit`): noise, fold, power of
        the components, chi-square, threshold; largest order; variances and curvatures.
    table : float [batch, 2 tones + 4], detected : bool [batch]
        The result.
    """
    width = rows.shape[2]
    folded = np.empty(width)
    in_phase, quadrature = np.empty(width), np.empty(width)
    turn = np.empty((2, max(rows.shape[1], tapers.shape[1], width // 2)))
    lanes, own_lanes = np.empty(width), np.empty(width, rows.dtype)
    own = np.empty((grid.shape[2], len(strong)))
    found = np.empty(basis.shape[1])
    responses = np.empty((2 * grid.shape[1], len(strong)))
    power = np.empty(2 * grid.shape[1])
    phasors = np.empty((orders.shape[1], 2 * int(levels[6]) + 1), dtype=np.complex128)
    for burst in range(len(rows)):
        offset_hz = 0.0
        if search[0] == 0.0:
            for j in range(width):
                folded[j] = rows[burst, 0, j]
        else:
            if len(components):
                for segment in range(len(own)):
                    for c in range(len(strong)):
                        own[segment, c] = components[burst, segment, c]
            else:
                _segment_components(rows[burst], strong, folded, own)
            offset_hz = _offset_hz(own, grid, search, responses, power)
            _fold(rows[burst], tapers, search, offset_hz, turn, in_phase, quadrature, folded)
        total = 0.0
        if len(energy):
            total = float(energy[burst])
        else:
            total = float(_sum_of_squares(rows[burst].ravel(), own_lanes))
        _project(folded, basis, found)
        detected[burst] = _fit_tones(
            total,
            offset_hz,
            _sum_of_squares(folded, lanes),
            found,
            orders,
            fit,
            pairs,
            pair_weights,
            levels,
            phasors,
            table[burst],
        )


@compiled
def _segment_components(
    rows: NDArray[np.floating], strong: FloatArray, period: FloatArray, own: FloatArray
) -> None:
    """Strong components of segments [segments, components] of so many rows each."""
    repeats = len(rows) // len(own)
    for segment in range(len(own)):
        period[:] = 0.0
        for n in range(segment * repeats, (segment + 1) * repeats):
            _add(period, 1.0, rows[n])
        for c in range(len(strong)):
            own[segment, c] = _dot(period, strong[c], len(period))


@compiled
def _offset_hz(
    components: FloatArray,
    grid: FloatArray,
    search: FloatArray,
    responses: FloatArray,
    power: FloatArray,
) -> float:
    """Offset [Hz] where the summed power of the components peaks."""
    count = components.shape[1] // 2
    zero = grid.shape[1] - 1
    for g in range(zero + 1):
        above, below = 0.0, 0.0
        up, down = responses[zero + g], responses[zero - g]
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
            up[c], up[count + c] = rr - ii, ri + ir
            down[c], down[count + c] = rr + ii, ri - ir
            above += (rr - ii) * (rr - ii) + (ri + ir) * (ri + ir)
            below += (rr + ii) * (rr + ii) + (ri - ir) * (ri - ir)
        power[zero - g] = below
        power[zero + g] = above
    peak = 1
    for g in range(2, 2 * zero):
        if power[g] > power[peak]:
            peak = g
    total = 0.0
    for c in range(2 * count):
        both = responses[peak - 1, c] + responses[peak + 1, c]
        total += both * both
    quotient = (power[peak + 1] - power[peak - 1]) / total
    return float(math.atan(quotient * search[1]) * search[2] + search[0] * (peak - zero))


@compiled
def _turns(count: int, half_step: float, turn: FloatArray) -> int:
    """Cosine and sine of ``(n - (count - 1) / 2) step``, from the middle up; how many."""
    cosine, sine = math.cos(half_step), math.sin(half_step)
    square, cross = cosine * cosine - sine * sine, 2.0 * cosine * sine
    half = (count + 1) // 2
    turn[0, 0], turn[1, 0] = (1.0, 0.0) if count % 2 else (cosine, sine)
    for n in range(1, min(half, _LANES)):
        re, im = turn[0, n - 1], turn[1, n - 1]
        turn[0, n], turn[1, n] = re * square - im * cross, re * cross + im * square
    # Four steps at once: chains of products that do not wait for each other.
    for _ in range(2):
        square, cross = square * square - cross * cross, 2.0 * square * cross
    for n in range(_LANES, half):
        re, im = turn[0, n - _LANES], turn[1, n - _LANES]
        turn[0, n], turn[1, n] = re * square - im * cross, re * cross + im * square
    return half


@compiled
def _dot(one: FloatArray, other: FloatArray, count: int) -> float:
    """Sum of products, in four partial sums that do not wait for each other."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    whole = count - count % _LANES
    for n in range(0, whole, _LANES):
        a += one[n] * other[n]
        b += one[n + 1] * other[n + 1]
        c += one[n + 2] * other[n + 2]
        d += one[n + 3] * other[n + 3]
    for n in range(whole, count):
        a += one[n] * other[n]
    return (a + b) + (c + d)


@compiled
def _add(total: FloatArray, factor: float, row: NDArray[np.floating]) -> None:
    for j in range(len(total)):
        total[j] += factor * row[j]


@compiled
def _add_pair(
    in_phase: FloatArray,
    quadrature: FloatArray,
    cosine: float,
    sine: float,
    late: NDArray[np.floating],
    early: NDArray[np.floating],
) -> None:
    for j in range(len(in_phase)):
        in_phase[j] += cosine * (late[j] + early[j])
        quadrature[j] += sine * (late[j] - early[j])


@compiled
def _fold(
    rows: NDArray[np.floating],
    tapers: FloatArray,
    search: FloatArray,
    offset_hz: float,
    turn: FloatArray,
    in_phase: FloatArray,
    quadrature: FloatArray,
    folded: FloatArray,
) -> None:
    """Sum of the periods after turning back by an offset about the middle of the burst."""
    width, count = len(folded), rows.shape[0]
    in_phase[:] = 0.0
    quadrature[:] = 0.0
    if tapers.shape[1]:
        half = _turns(int(search[5]), search[4] * offset_hz, turn)
        # Even sequences have cosines only, odd ones sines.
        for k in range(count):
            factor = _dot(turn[k % 2], tapers[k], half)
            _add(in_phase if k % 2 == 0 else quadrature, factor, rows[k])
    else:
        half = _turns(count, search[4] * offset_hz, turn)
        for n in range(half):
            late, early = count - half + n, half - 1 - n
            if late == early:
                _add(in_phase, 1.0, rows[late])
            else:
                _add_pair(in_phase, quadrature, turn[0, n], turn[1, n], rows[late], rows[early])
    period = width // 2
    half = _turns(period, search[3] * offset_hz, turn)
    for n in range(half):
        cosine, sine = turn[0, n], turn[1, n]
        late, early = 2 * (period - half + n), 2 * (half - 1 - n)
        re, im = in_phase[late] + quadrature[late + 1], in_phase[late + 1] - quadrature[late]
        folded[late], folded[late + 1] = re * cosine + im * sine, im * cosine - re * sine
        re, im = in_phase[early] + quadrature[early + 1], in_phase[early + 1] - quadrature[early]
        if early != late:
            folded[early], folded[early + 1] = re * cosine - im * sine, im * cosine + re * sine


@compiled
def _project(vector: FloatArray, matrix: FloatArray, out: FloatArray) -> None:
    """``out = vector @ matrix``; both sides hold a multiple of two rows."""
    out[:] = 0.0
    for n in range(0, len(vector) - 1, 2):
        one, other = vector[n], vector[n + 1]
        upper, lower = matrix[n], matrix[n + 1]
        for c in range(len(out)):
            out[c] += one * upper[c] + other * lower[c]


@compiled
def _sum_of_squares(parts: NDArray[np.floating], lanes: NDArray[np.floating]) -> float:
    """Energy of a row that is a multiple of the lanes long, in as many partial sums."""
    lanes[:] = 0.0
    width = len(lanes)
    rows = len(parts) // width
    whole = rows - rows % 4
    for first in range(0, whole * width, 4 * width):
        a = parts[first : first + width]
        b = parts[first + width : first + 2 * width]
        c = parts[first + 2 * width : first + 3 * width]
        d = parts[first + 3 * width : first + 4 * width]
        for j in range(width):
            lanes[j] += (a[j] * a[j] + b[j] * b[j]) + (c[j] * c[j] + d[j] * d[j])
    for first in range(whole * width, rows * width, width):
        a = parts[first : first + width]
        for j in range(width):
            lanes[j] += a[j] * a[j]
    total = 0.0
    for j in range(0, len(lanes), 2):
        total += lanes[j] + lanes[j + 1]
    return total


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
    levels: FloatArray,
    phasors: ComplexArray,
    row: FloatArray,
) -> bool:
    """One Gauss-Newton step from the products of neighbours; False if nothing is detected."""
    count, tones = orders.shape
    inside, strong = 0.0, 0.0
    for c in range(count):
        square = found[2 * c] * found[2 * c] + found[2 * c + 1] * found[2 * c + 1]
        inside += square
        strong += fit[c, tones + 1] * square
    if not strong > energy * levels[5]:
        row[:tones] = math.nan
        row[tones : 2 * tones] = math.inf
        row[2 * tones : 2 * tones + 2] = 0.0
        row[2 * tones + 2 :] = math.nan
        return False
    top = int(levels[6])
    for tone in range(tones):
        re, im = 0.0, 0.0
        for p in range(len(pairs)):
            if pairs[p, 0] == tone:
                u, v, w = 2 * pairs[p, 1], 2 * pairs[p, 2], pair_weights[p]
                re += w * (found[u] * found[v] + found[u + 1] * found[v + 1])
                im += w * (found[u] * found[v + 1] - found[u + 1] * found[v])
        phase = math.atan2(im, re)
        row[tone] = phase
        power = phasors[tone]
        step = complex(math.cos(phase), math.sin(phase))
        power[top] = 1.0
        for order in range(1, top + 1):
            power[top + order] = power[top + order - 1] * step
            power[top - order] = power[top + order].conjugate()
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
        row[tone] = _wrapped(row[tone] - step_rad)
        # The step adds to what the fit explains, to second order.
        power_found += slope * step_rad * levels[7 + tones + tone]
    # Every component is in the folded period, so the energy outside it is noise.
    noise = max(energy * levels[1] - folded_energy * levels[2], power_found / levels[0])
    snr = power_found / noise
    for tone in range(tones):
        row[tones + tone] = levels[7 + tone] / snr
    row[2 * tones] = math.sqrt(power_found)
    row[2 * tones + 1] = snr
    row[2 * tones + 2] = offset_hz
    row[2 * tones + 3] = (inside - power_found * levels[3]) * levels[4] / noise
    return True
