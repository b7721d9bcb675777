"""What the roughness of a cable scatters back, as noise whose covariance is known.

The impedance of a real cable is not constant along it. To first order each short stretch k whose
impedance is off by a fraction z_k adds ``z_k c_k`` to the trace, with the column c_k of
`rail_signals.train_bus.tdr.model`: half of z_k for as long as the edge needs to pass it. With z a
stationary process of standard deviation s and correlation ``exp(-|x| / l)``, whose means over the
stretches have the covariance ``K = G G'``, the trace has, beside white noise, the covariance ``S'
S`` with ``S = G' C``. The stretches are half as long as what the reflectometer can tell apart at
their distance.

Everything that is judged by its distance in noise is judged in the metric of both:

    |r|^2 = r'r / sigma^2 - |L^-1 S r / sigma^2|^2,    L L' = 1 + S S' / sigma^2.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import wave_exponential
from rail_signals.train_bus.consist import Consist

from .fields import Fields
from .parts import Piece
from .response import TimeGrid

_LEAST_M = 0.5
_FRACTION = 0.5


def spread_s(cable: Cable, place_m: float, rise_time_s: float) -> float:
    """Time an edge needs after it has been to a place and back: rise time and skin effect [s].

    The step response of a skin effect over the way to a place and back is ``erfc(a x /
    sqrt(t))`` with ``a = S / (2 Z0 sqrt(pi))``; it climbs from a tenth to a half in about
    ``4 (a x)^2``.
    """
    a = cable.skin_ohm_per_m_sqrt_hz / (2 * cable.impedance_ohm * math.sqrt(math.pi))
    return rise_time_s + 2 * (a * place_m) ** 2


def resolution_m(cable: Cable, place_m: float, rise_time_s: float) -> float:
    """Length of cable that an edge covers while it rises, at a place [m]."""
    return 0.5 * cable.velocity_m_per_s * spread_s(cable, place_m, rise_time_s)


def stretch_covariance(roughness: float, correlation_m: float, bounds_m: FloatArray) -> FloatArray:
    """Covariance of the means of an exponentially correlated process over adjoining stretches.

    With lengths D and the correlation length l, for one stretch ``2 s^2 q (1 - q (1 -
    exp(-1/q)))`` with ``q = l / D``, for two the product of their ``s q (1 - exp(-1/q))`` times
    ``exp(-gap / l)``.

    Parameters
    ----------
    roughness, correlation_m
        Standard deviation s and correlation length l [m].
    bounds_m : float64 [stretches + 1]
        Where stretches meet [m].

    Examples
    --------
    >>> stretch_covariance(0.01, 3.0, np.array([0.0, 1e-3])).round(8).tolist()
    [[9.999e-05]]
    """
    lengths = np.diff(bounds_m)
    q = correlation_m / lengths
    end = -np.expm1(-1 / q)
    gap = bounds_m[:-1][None, :] - bounds_m[1:][:, None]
    far = np.exp(-np.maximum(gap, 0.0) / correlation_m) * np.outer(q * end, q * end)
    upper = np.triu(far, 1)
    own = 2 * q * (1 - q * end)
    return np.asarray(roughness**2 * (upper + upper.T + np.diag(own)))


class Metric:
    """Distances in noise: white noise of one trace, and backscatter.

    Parameters
    ----------
    sigma
        Standard deviation of the white noise.
    backscatter : float64 [stretches, samples]
        Rows of S; none where the cable is smooth.
    """

    def __init__(self, sigma: float, backscatter: FloatArray) -> None:
        self.sigma = sigma
        self.rows = backscatter / sigma
        if len(self.rows):
            matrix = self.rows @ self.rows.T
            matrix[np.diag_indices_from(matrix)] += 1
            self._factor = cholesky(matrix, lower=True)

    def explained(self, rows: FloatArray) -> FloatArray:
        """What backscatter explains of rows over the noise: [stretches, rows]."""
        if not len(self.rows):
            return np.zeros((0, len(rows)))
        right = self.rows @ rows.T
        return np.asarray(solve_triangular(self._factor, right, lower=True, check_finite=False))

    def square(self, row: FloatArray) -> float:
        """Squared distance of one row over the white noise."""
        part = self.explained(row[None])[:, 0]
        return float(row @ row - part @ part)


def backscatter_rows(
    consist: Consist, rise_time_s: float, grid: TimeGrid, s: ComplexArray, fields: Fields
) -> FloatArray:
    """Rows of S for a train: float64 [stretches, samples].

    Parameters
    ----------
    consist
        Drawing of the train.
    rise_time_s
        Rise time of the incident edge [s].
    grid, s
        Samples and complex frequencies [rad/s] of the trace.
    fields
        Of the train as drawn.
    """
    t = consist.tolerances
    if t.roughness == 0:
        return np.zeros((0, grid.samples))
    columns = []
    bounds = [0.0]
    scratch = np.empty_like(s)
    for port, part in enumerate(fields.chain.parts):
        if not isinstance(part, Piece):
            continue
        run = consist.runs[part.run]
        start = float(consist.starts_m[part.run])
        wanted = max(_LEAST_M, _FRACTION * resolution_m(run.cable, start, rise_time_s))
        count = max(1, round(run.length_m / wanted))
        bounds += (start + run.length_m / count * np.arange(1, count + 1)).tolist()
        wave, factor = part.wave, part.impedance_factor
        half_step = wave_exponential(wave.attenuation, wave.phase, part.length_m / count, scratch)
        step = np.square(half_step)
        # V I = (u^2 - w^2) / Z0 at the bounds of the stretches; u falls from the front, w from
        # the rear.
        drop = fields.current[port] * wave.impedance * factor
        ahead = np.square((fields.voltage[port] + drop) / 2)
        drop = fields.current[port + 1] * wave.impedance * factor
        behind = np.square((fields.voltage[port + 1] - drop) / 2)
        power = np.empty((count + 1, len(s)), dtype=np.complex128)
        for k in range(count + 1):
            power[k] = ahead
            ahead *= step
        for k in range(count, -1, -1):
            power[k] -= behind
            behind *= step
        power *= wave.admittance * (1 / factor)
        columns.append(power[:-1] - power[1:])
    covariance = stretch_covariance(t.roughness, t.roughness_length_m, np.array(bounds))
    root = cholesky(covariance, lower=True)
    return np.asarray(root.T @ grid.to_time(np.concatenate(columns)))
