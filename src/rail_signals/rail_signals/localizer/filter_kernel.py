"""Compiled steps of the filters of one train.

For many runs side by side `FilterBank` goes through whole arrays; with the eleven filters of one
train the calls of NumPy cost more than the sums. The sums are the same, in the same order.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rail_signals.arrays import BoolArray, FloatArray
from rail_signals.compiled import compiled


@compiled
def predict_filters(
    x: FloatArray,
    p: FloatArray,
    step_s: float,
    transition: FloatArray,
    added: FloatArray,
    per_m: FloatArray,
    per_s: FloatArray,
    settled: FloatArray,
    starts_anew: int,
) -> None:
    """Let time pass; see `FilterBank.predict`.

    Parameters
    ----------
    x, p : float64 [state, filter], [state, state, filter]
        Changed in place.
    step_s : float
    transition, added : float64 [3, 3]
        As of `singer`.
    per_m, per_s, settled : float64 [state, 1]
        Decay with the distance run and with time, and the variances that are settled at.
    starts_anew : int
        State of which nothing is known any more, -1 if there is none.
    """
    states, filters = x.shape
    decay, rows = np.empty(states), np.empty((2, states))
    for f in range(filters):
        run_m = step_s * abs(x[1, f])
        for i in range(states):
            decay[i] = math.exp(per_m[i, 0] * run_m + step_s * per_s[i, 0])
        if starts_anew >= 0:
            decay[starts_anew] = 0.0
        s, v, a = x[0, f], x[1, f], x[2, f]
        for i in range(2):
            x[i, f] = transition[i, 0] * s + transition[i, 1] * v + transition[i, 2] * a
        for i in range(states):
            x[i, f] *= decay[i]
        for i in range(2):
            one, two, three = transition[i, 0], transition[i, 1], transition[i, 2]
            for j in range(states):
                rows[i, j] = one * p[0, j, f] + two * p[1, j, f] + three * p[2, j, f]
        for i in range(2):
            one, two, three = rows[i, 0], rows[i, 1], rows[i, 2]
            for j in range(2):
                rows[i, j] = transition[j, 0] * one + transition[j, 1] * two
                rows[i, j] += transition[j, 2] * three
        rows[1, 0] = rows[0, 1]
        for i in range(2):
            for j in range(states):
                p[i, j, f] = p[j, i, f] = rows[i, j]
        for i in range(states):
            for j in range(states):
                p[i, j, f] *= decay[i] * decay[j]
        for i in range(3):
            for j in range(3):
                p[i, j, f] += added[i, j]
        for i in range(states):
            p[i, i, f] += settled[i, 0] * (1.0 - decay[i] * decay[i])


@compiled
def take_scalar(
    x: FloatArray,
    p: FloatArray,
    row: NDArray[np.int64],
    factors: FloatArray,
    reading: float,
    variance: float,
    gate2: float,
    use: BoolArray,
    refused: BoolArray,
    innovation: FloatArray,
    total: FloatArray,
) -> bool:
    """Take a scalar reading; see `FilterBank.take`. Whether some filter would refuse it.

    Parameters
    ----------
    x, p : float64 [state, filter], [state, state, filter]
        Changed in place.
    row, factors : int64, float64
        States of a row and their coefficients.
    reading, variance, gate2 : float
    use : bool [filter]
        Which filters it is offered to.
    refused, innovation, total : [filter]
        As of `UpdateResult`; result.
    """
    states, filters = x.shape
    outside = False
    g = np.empty(states)
    for f in range(filters):
        for i in range(states):
            g[i] = factors[0] * p[row[0], i, f]
            for k in range(1, len(row)):
                g[i] += factors[k] * p[row[k], i, f]
        expected, total[f] = factors[0] * x[row[0], f], factors[0] * g[row[0]]
        for k in range(1, len(row)):
            expected += factors[k] * x[row[k], f]
            total[f] += factors[k] * g[row[k]]
        total[f] += variance
        innovation[f] = reading - expected
        weight = 1.0 / math.sqrt(total[f])
        normal = innovation[f] * weight
        inside = normal * normal <= gate2
        outside |= not inside
        refused[f] = use[f] and not inside
        weight *= 1.0 if use[f] and inside else 0.0
        for i in range(states):
            g[i] *= weight
            x[i, f] += g[i] * normal
        for i in range(states):
            for j in range(states):
                p[i, j, f] -= g[i] * g[j]
    return outside
