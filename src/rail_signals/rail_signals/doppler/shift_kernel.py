"""Compiled sums of the Doppler solver: frames of the line, cost, step, minimum, profile.

With some five stations and three unknowns, calls of NumPy cost more than the sums themselves.
A station is a row of ``received``: antenna x, y, z [m], shift [Hz], one over its variance
[1/Hz^2], shift per rate and speed [Hz s/m], share of the offset. A line is ``cubics``
[segment, 12] with its first chainage [m] and the reciprocal of its step [1/m]
(`SurveyedLine.cubics`). ``known`` holds mean and one over the variance of speed and offset.
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import FloatArray
from rail_signals.compiled import compiled

Unknowns = tuple[float, float, float]
"""Chainage [m], speed [m/s], offset at the carrier [Hz]."""

Symmetric = tuple[float, float, float, float, float, float]
"""Of a symmetric matrix [3, 3]: 00, 01, 02, 11, 12, 22."""

Known = tuple[float, float, float, float]
"""Speed [m/s], one over its variance, offset [Hz], one over its variance."""

Frame = tuple[float, float, float, float, float, float, float, float, float]
"""Place and its first and second derivative by chainage, x, y, z each."""

_MOST_STEPS = 12
# A step of Gauss and Newton leaves its square over the distance of the nearest station.
_STEP_M, _STEP_MPS = 0.02, 1e-3
_MOST_STEP_M = 20.0


@compiled
def line_frame(cubics: FloatArray, start_m: float, per_m: float, chainage_m: float) -> Frame:
    """Place, first and second derivative by chainage at one point; straight past an end."""
    steps = (chainage_m - start_m) * per_m
    # Of what is not a number, the first.
    index = int(min(steps, cubics.shape[0] - 1.0)) if steps > 0.0 else 0
    whole = steps - index
    t = min(max(whole, 0.0), 1.0)
    beyond = whole - t
    c = cubics[index]
    two, three, six = 2.0 * t, 3.0 * t * t, 6.0 * t
    tx = c[3] + two * c[6] + three * c[9]
    ty = c[4] + two * c[7] + three * c[10]
    tz = c[5] + two * c[8] + three * c[11]
    square = t * t
    cube = square * t
    x = c[0] + t * c[3] + square * c[6] + cube * c[9] + beyond * tx
    y = c[1] + t * c[4] + square * c[7] + cube * c[10] + beyond * ty
    z = c[2] + t * c[5] + square * c[8] + cube * c[11] + beyond * tz
    bend = per_m * per_m if beyond == 0.0 else 0.0
    bx, by, bz = 2.0 * c[6] + six * c[9], 2.0 * c[7] + six * c[10], 2.0 * c[8] + six * c[11]
    return x, y, z, tx * per_m, ty * per_m, tz * per_m, bx * bend, by * bend, bz * bend


@compiled
def _rate(frame: Frame, row: FloatArray) -> tuple[float, float]:
    """dR/ds of a station and its derivative by chainage [1/m]."""
    px, py, pz, tx, ty, tz, bx, by, bz = frame
    dx, dy, dz = px - row[0], py - row[1], pz - row[2]
    distance = sqrt(dx * dx + dy * dy + dz * dz)
    rate = (dx * tx + dy * ty + dz * tz) / distance
    turn = tx * tx + ty * ty + tz * tz + dx * bx + dy * by + dz * bz
    return rate, (turn - rate * rate) / distance


@compiled
def shift_cost(
    cubics: FloatArray,
    start_m: float,
    per_m: float,
    received: FloatArray,
    tau_s: float,
    known: Known,
    at: Unknowns,
) -> float:
    """Weighted squares of what is left of shifts and of what is known beforehand."""
    s, v, delta = at
    before = line_frame(cubics, start_m, per_m, s - v * tau_s)
    after = line_frame(cubics, start_m, per_m, s + v * tau_s)
    total = known[1] * (v - known[0]) ** 2 + known[3] * (delta - known[2]) ** 2
    for row in received:
        rate = _rate(before, row)[0] + _rate(after, row)[0]
        total += row[4] * (row[3] - row[5] * v * 0.5 * rate - row[6] * delta) ** 2
    return total


@compiled
def newton_step(
    cubics: FloatArray,
    start_m: float,
    per_m: float,
    received: FloatArray,
    tau_s: float,
    known: Known,
    at: Unknowns,
) -> tuple[Unknowns, float, Symmetric]:
    """Step of Gauss and Newton, the cost where it leads, and the normal matrix.

    The cost is that of a parabola.
    """
    s, v, delta = at
    run_m = v * tau_s
    before = line_frame(cubics, start_m, per_m, s - run_m)
    after = line_frame(cubics, start_m, per_m, s + run_m)
    off_v, off_d = known[0] - v, known[2] - delta
    n00, n01, n02, n11, n12, n22 = 0.0, 0.0, 0.0, known[1], 0.0, known[3]
    f0, f1, f2 = 0.0, known[1] * off_v, known[3] * off_d
    total = f1 * off_v + f2 * off_d
    for row in received:
        shift, weight, per_mps, scale = row[3], row[4], row[5], row[6]
        rate_before, bend_before = _rate(before, row)
        rate_after, bend_after = _rate(after, row)
        mean = 0.5 * (rate_before + rate_after)
        left = shift - per_mps * v * mean - scale * delta
        by_s = per_mps * v * 0.5 * (bend_before + bend_after)
        by_v = per_mps * (mean + 0.5 * run_m * (bend_after - bend_before))
        ws, wv = weight * by_s, weight * by_v
        n00 += ws * by_s
        n01 += ws * by_v
        n02 += ws * scale
        n11 += wv * by_v
        n12 += wv * scale
        n22 += weight * scale * scale
        f0 += ws * left
        f1 += wv * left
        f2 += weight * scale * left
        total += weight * left * left
    normal = (n00, n01, n02, n11, n12, n22)
    c00, c01, c02, c11, c12, c22 = inverse(normal)
    ds = c00 * f0 + c01 * f1 + c02 * f2
    dv = c01 * f0 + c11 * f1 + c12 * f2
    dd = c02 * f0 + c12 * f1 + c22 * f2
    return (ds, dv, dd), total - f0 * ds - f1 * dv - f2 * dd, normal


@compiled
def cost_minimum(
    cubics: FloatArray,
    start_m: float,
    per_m: float,
    received: FloatArray,
    tau_s: float,
    known: Known,
    at: Unknowns,
    low_m: float,
    high_m: float,
    worst: float,
) -> tuple[Unknowns, float, FloatArray]:
    """Minimum near a place, its cost, and the covariance [3, 3] of its parabola.

    The cost is infinite if it is not within the window, costs more than `worst`, or is not
    reached.
    """
    s, v, delta = at
    covariance = np.full((3, 3), inf)
    for _ in range(_MOST_STEPS):
        (ds, dv, dd), cost, normal = newton_step(
            cubics, start_m, per_m, received, tau_s, known, (s, v, delta)
        )
        if cost > worst or not abs(ds) < 1e9:
            break
        # No farther than where the rates keep their shape, and not far off the line.
        fraction = min(1.0, _MOST_STEP_M / max(abs(ds), 1e-9))
        there = s + fraction * ds
        s = min(max(there, low_m), high_m)
        v += fraction * dv
        delta += fraction * dd
        short = fraction * abs(ds) < _STEP_M and fraction * abs(dv) < _STEP_MPS
        if there == s and short:
            found = (s, v, delta)
            cost = shift_cost(cubics, start_m, per_m, received, tau_s, known, found)
            c00, c01, c02, c11, c12, c22 = inverse(normal)
            covariance[0] = c00, c01, c02
            covariance[1] = c01, c11, c12
            covariance[2] = c02, c12, c22
            return found, cost, covariance
    return (s, v, delta), inf, covariance


@compiled
def inverse(matrix: Symmetric) -> Symmetric:
    """Inverse of a symmetric matrix [3, 3]; of a singular one infinite."""
    a, b, c, d, e, f = matrix
    # Scaled to unit diagonal, so that rank is seen whatever the units.
    if not (a > 0.0 and d > 0.0 and f > 0.0):
        return inf, inf, inf, inf, inf, inf
    p, q, r = 1.0 / sqrt(a), 1.0 / sqrt(d), 1.0 / sqrt(f)
    b, c, e = b * p * q, c * p * r, e * q * r
    determinant = 1.0 - b * b - c * c - e * e + 2.0 * b * c * e
    if not determinant > 0.0:
        return inf, inf, inf, inf, inf, inf
    over = 1.0 / determinant
    return (
        (1.0 - e * e) * over * p * p,
        (c * e - b) * over * p * q,
        (b * e - c) * over * p * r,
        (1.0 - c * c) * over * q * q,
        (b * c - e) * over * q * r,
        (1.0 - b * b) * over * r * r,
    )


@compiled
def cost_profile(
    rates: FloatArray,
    stations: NDArray[np.int64],
    first: int,
    last: int,
    received: FloatArray,
    known: Known,
    direction: int,
) -> tuple[float, FloatArray, FloatArray]:
    """Cost of a train that stands; at places, least cost and best speed [places].

    Parameters
    ----------
    rates : float [station, place]
        dR/ds of all stations at all places.
    stations : int [n]
        Numbers of those received.
    first, last
        The places asked for.
    direction
        In which direction the train may run; 0 = not known. The other way the cost is what
        standing still would cost, or more.
    """
    # The offset of a train that stands. What it leaves is small where the shifts are not,
    # and so are the sums of what follows, which would otherwise cancel.
    square, pull = known[3], known[3] * known[2]
    for row in received:
        square += row[4] * row[6] * row[6]
        pull += row[4] * row[6] * row[3]
    still_hz = pull / square
    prior_hz = known[2] - still_hz
    standing = known[3] * prior_hz * prior_hz + known[1] * known[0] * known[0]
    for row in received:
        left = row[3] - row[6] * still_hz
        standing += row[4] * left * left
    places = last - first
    share, cost, speed = np.zeros(places), np.empty(places), np.empty(places)
    weight = np.full(places, known[1])
    force = np.full(places, known[1] * known[0])
    # What the offset cannot take over of the effect of a speed.
    for n in range(len(stations)):
        row, rate = received[n], rates[stations[n], first:last]
        factor = row[4] * row[6] * row[5] / square
        for place in range(places):
            share[place] += factor * rate[place]
    for n in range(len(stations)):
        row, rate = received[n], rates[stations[n], first:last]
        w, per_mps, scale = row[4], row[5], row[6]
        pulled = w * (row[3] - scale * still_hz)
        for place in range(places):
            effect = per_mps * rate[place] - scale * share[place]
            weight[place] += w * effect * effect
            force[place] += pulled * effect
    for place in range(places):
        pull = force[place] - known[3] * prior_hz * share[place]
        v = pull / (weight[place] + known[3] * share[place] * share[place])
        speed[place] = v
        cost[place] = standing if v * direction < 0.0 else standing - v * pull
    return standing, cost, speed


@compiled
def deepest_minima(cost: FloatArray, most: int) -> tuple[float, NDArray[np.int64]]:
    """Least cost, and places of the deepest minima within, at most so many, deepest first."""
    where = np.empty(most, dtype=np.int64)
    count = 0
    before, here = cost[0], cost[1]
    for i in range(1, len(cost) - 1):
        after = cost[i + 1]
        lowest = (here <= before) & (here < after)
        before, here = here, after
        if lowest:
            count = _insert(cost, where, count, i)
    least = min(cost[0], cost[-1])
    if count:
        least = min(least, cost[where[0]])
    return least, where[:count]


@compiled
def _insert(cost: FloatArray, where: NDArray[np.int64], count: int, place: int) -> int:
    """Put a place among the deepest so far, as many as there is room for; their new number."""
    most, depth = len(where), cost[place]
    if count == most:
        if not depth < cost[where[most - 1]]:
            return count
        count -= 1
    slot = count
    while slot > 0 and depth < cost[where[slot - 1]]:
        where[slot] = where[slot - 1]
        slot -= 1
    where[slot] = place
    return count + 1
