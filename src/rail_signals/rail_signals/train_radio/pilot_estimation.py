"""Channel estimation from pilots: Wiener interpolation of a Jakes channel.

Blocks of known symbols stand at both ends of a burst and between its data. Within a block the
antennas send orthogonal rows of +-1, so that each receiver tells them apart:

    y_p = sum_a X_{a,p} h_a(t_p) + z_p

With ``E[h_a(t) h_b(t')*] = P delta_{ab} J0(2 pi f_D (t - t'))`` and white noise of variance sigma^2
the estimate of least mean square error of every ``h_a(t)`` is linear in the pilots,

    W = snr C (snr K + I)^-1,    K = sum_a X_a X_a^T * J0(t_p - t_q),   C_a = J0(t - t_q) X_{a,q}

with ``snr = P / sigma^2`` and the error variance ``P (1 - diag(W C^T))``. The eigenvectors of K are
those of every SNR: they are found once per pattern and Doppler, and each burst is estimated at
its own SNR, which the same eigenvectors tell (maximum likelihood of a Gaussian channel).

Nothing assumes the channel constant within a block or an Alamouti pair. A line of sight has a
Doppler within the band of Jakes and is followed too, though its power is not spread as assumed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import j0

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.compiled import compiled

from .pilot_pattern import PilotPattern

MAX_SNR = 1e6
"""Ceiling of the estimated SNR (60 dB)."""

EstimatorTables: TypeAlias = tuple[
    FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray
]
"""Levels of the grid, eigenvalues, eigenvectors, shrinkage, penalty and rows of an estimator."""

_LEVELS = 10.0 ** (np.arange(-20, 61) / 10)
_LEAST_DOPPLER = 1e-6
_BINS_PER_OCTAVE = 4


@dataclass(frozen=True)
class PilotLevel:
    """What the pilots of each burst say of its level. Axes are the leading ones of the bursts.

    Attributes
    ----------
    snr : float64 [...]
        Mean channel power over noise variance (linear), on a grid of 1 dB; at most `MAX_SNR`.
    noise_variance : float64 [...]
        Variance of the noise per symbol.
    evidence : float64 [...]
        Log-likelihood ratio of a channel in noise against noise alone. Noise exceeds a value t
        with a probability below ``exp(-t)`` (measured: a fifth of it at most).
    step : intp [...]
        Place of `snr` on its grid.
    """

    snr: FloatArray
    noise_variance: FloatArray
    evidence: FloatArray
    step: NDArray[np.intp]


class WienerEstimator:
    """Estimator of one pattern at one Doppler; see :func:`wiener_estimator` for a cached one.

    Parameters
    ----------
    pattern
        Pilots of the burst.
    doppler_per_symbol
        Maximum Doppler times symbol duration, ``f_D T``, from 0 to below 0.5.

    Examples
    --------
    >>> pattern = PilotPattern(data_symbols=28, transmit=1)
    >>> estimator = WienerEstimator(pattern, 0.0)
    >>> channel = estimator.estimate(0.3j * pattern.pilots, 1e6)
    >>> channel.shape, bool(np.allclose(channel, 0.3j))
    ((1, 1, 34), True)
    """

    def __init__(self, pattern: PilotPattern, doppler_per_symbol: float) -> None:
        if not 0 <= doppler_per_symbol < 0.5:
            raise ValueError(
                f"doppler_per_symbol must lie from 0 to below 0.5, got {doppler_per_symbol!r}"
            )
        self.pattern = pattern
        self.doppler_per_symbol = float(doppler_per_symbol)
        count = pattern.symbols
        correlation = j0(2 * math.pi * doppler_per_symbol * np.arange(count))
        at, pilots = pattern.pilot_positions, pattern.pilots
        between = correlation[np.abs(at[:, None] - at)] * (pilots.T @ pilots)
        values, vectors = np.linalg.eigh(between)
        self._values = np.maximum(values, 0.0)
        self._vectors = np.ascontiguousarray(vectors)
        ahead = correlation[np.abs(np.arange(count)[:, None] - at)] * pilots[:, None, :]
        # [tx symbols, pilots]: covariance of the channel with the pilots' eigenvectors.
        covariance = ahead.reshape(-1, len(at)) @ vectors
        self._covariance_squared = covariance**2
        # Rows for the kernel, of outputs that lie side by side; zeros make up whole fours.
        self._rows = np.zeros((-(-len(at) // 4) * 4, len(covariance)))
        self._rows[: len(at)] = covariance.T
        shrink = 1 / (_LEVELS[:, None] * self._values + 1)
        self._penalty = -np.sum(np.log(shrink), axis=1)
        self._shrink = np.ascontiguousarray(shrink.T)

    def level(self, received: ArrayLike) -> PilotLevel:
        """Level of bursts from their pilots complex [..., rx, pilots].

        Channel power and noise are taken as common to the receive antennas.
        """
        y = self._check(received)
        found = np.empty((2, *y.shape[:-2]))
        step = np.empty(y.shape[:-2], dtype=np.intp)
        pilots = y.view(np.float64).reshape(-1, y.shape[-2], 2 * y.shape[-1])
        tables = self._vectors, self._shrink, self._penalty
        _levels(pilots, *tables, step.reshape(-1), found.reshape(2, -1))
        return PilotLevel(np.asarray(_LEVELS[step]), found[0], found[1], step)

    def estimate(self, received: ArrayLike, snr: ArrayLike) -> ComplexArray:
        """Channel at every symbol of the burst.

        Parameters
        ----------
        received : complex [..., rx, pilots]
            Symbols received at the pilots' places.
        snr : float [...]
            Mean channel power over noise variance (linear).

        Returns
        -------
        complex128 [..., rx, tx, symbols]
        """
        y = self._check(received)
        receive, count = y.shape[-2:]
        lead = y.shape[:-2]
        weight = np.ascontiguousarray(np.broadcast_to(self._weight(snr), (*lead, count)))
        out = np.empty((*lead, receive, self.pattern.transmit, self.pattern.symbols), np.complex128)
        _channels(
            y.view(np.float64).reshape(-1, receive, 2 * count),
            weight.reshape(-1, count),
            self._vectors,
            self._rows,
            out.view(np.float64).reshape(-1, receive, 2 * self._rows.shape[1]),
        )
        return out

    @cached_property
    def tables(self) -> tuple[EstimatorTables, FloatArray]:
        """What `rail_signals.train_radio.reception.receive_bursts` takes of an estimator.

        The mean over transmit antennas of `error_variance` is that of every level on the grid.
        """
        known = (
            _LEVELS,
            self._values,
            self._vectors,
            self._shrink,
            self._penalty,
            self._rows,
        )
        return known, np.ascontiguousarray(self.error_variance(_LEVELS).mean(axis=-2))

    def error_variance(self, snr: ArrayLike) -> FloatArray:
        """Predicted error variance of `estimate` as a fraction of the channel power.

        It holds for a channel of the Doppler of this estimator.

        Parameters
        ----------
        snr : float [...]
            Mean channel power over noise variance (linear).

        Returns
        -------
        float64 [..., tx, symbols]
        """
        weight = self._weight(snr)
        explained = np.matmul(self._covariance_squared, weight[..., None])[..., 0]
        shape = (*weight.shape[:-1], self.pattern.transmit, self.pattern.symbols)
        return np.asarray(np.maximum(1 - explained.reshape(shape), 0.0), dtype=np.float64)

    def _weight(self, snr: ArrayLike) -> FloatArray:
        level = np.asarray(snr, dtype=np.float64)[..., None]
        if not (np.isfinite(level) & (level >= 0)).all():
            raise ValueError(f"snr must be finite and not negative, got {snr!r}")
        return np.asarray(level / (level * self._values + 1))

    def _check(self, received: ArrayLike) -> ComplexArray:
        y = np.ascontiguousarray(received, dtype=np.complex128)
        count = len(self.pattern.pilot_positions)
        if y.ndim < 2 or y.shape[-2] < 1 or y.shape[-1] != count:
            raise ValueError(f"received must be [..., rx, {count}], got shape {y.shape}")
        return y


@compiled
def _along(pilots: FloatArray, vectors: FloatArray, out: FloatArray) -> None:
    """Pilots [2 pilots], parts alternating, along the eigenvectors, [part, eigenvector]."""
    out[:] = 0.0
    for p in range(len(vectors)):
        real, imag = pilots[2 * p], pilots[2 * p + 1]
        for k in range(len(vectors)):
            out[0, k] += vectors[p, k] * real
            out[1, k] += vectors[p, k] * imag


@compiled
def _levels(
    pilots: FloatArray,
    vectors: FloatArray,
    shrink: FloatArray,
    penalty: FloatArray,
    step: NDArray[np.intp],
    found: FloatArray,
) -> None:
    """Maximum likelihood level of bursts.

    Parameters
    ----------
    pilots : float64 [burst, rx, 2 pilots]
        Parts alternating.
    vectors : float64 [pilot, eigenvector]
    shrink : float64 [eigenvector, level]
    penalty : float64 [level]
    step : intp [burst]
        The level found; result.
    found : float64 [2, burst]
        Noise variance and evidence; result.
    """
    bursts, antennas, _ = pilots.shape
    count, levels = shrink.shape
    z = np.empty((2, count))
    energy, variance = np.empty(count), np.empty(levels)
    for burst in range(bursts):
        energy[:] = 0.0
        for antenna in range(antennas):
            _along(pilots[burst, antenna], vectors, z)
            for k in range(count):
                energy[k] += z[0, k] ** 2 + z[1, k] ** 2
        variance[:] = 0.0
        total = 0.0
        for k in range(count):
            total += energy[k]
            for i in range(levels):
                variance[i] += shrink[k, i] * energy[k]
        step[burst] = 0
        found[:, burst] = 0.0
        if total == 0.0:
            continue
        of = antennas * count
        least = np.inf
        for i in range(levels):
            cost = of * math.log(variance[i] / of) + antennas * penalty[i]
            if cost < least:
                least = cost
                step[burst] = i
        found[0, burst] = variance[step[burst]] / of
        found[1, burst] = max(of * math.log(total / of) - least, 0.0)


@compiled
def _channels(
    pilots: FloatArray,
    weight: FloatArray,
    vectors: FloatArray,
    rows: FloatArray,
    channel: FloatArray,
) -> None:
    """Channel of bursts by Wiener interpolation.

    Parameters
    ----------
    pilots : float64 [burst, rx, 2 pilots]
        Parts alternating.
    weight : float64 [burst, eigenvector]
    vectors : float64 [pilot, eigenvector]
    rows : float64 [eigenvector, tx symbols]
        Covariance of the channel with the eigenvectors, filled up to whole fours by zeros.
    channel : float64 [burst, rx, 2 tx symbols]
        Parts alternating; result.
    """
    bursts, antennas, _ = pilots.shape
    fours, places = rows.shape
    parts, sums = np.zeros((2 * antennas, fours)), np.empty((2 * antennas, places))
    z = np.empty((2, len(vectors)))
    for burst in range(bursts):
        for antenna in range(antennas):
            _along(pilots[burst, antenna], vectors, z)
            for k in range(len(vectors)):
                parts[2 * antenna, k] = z[0, k] * weight[burst, k]
                parts[2 * antenna + 1, k] = z[1, k] * weight[burst, k]
        sums[:] = 0.0
        # Four rows at a time for all antennas: the table is larger than the first-level cache.
        for k in range(0, fours, 4):
            row0, row1, row2, row3 = rows[k], rows[k + 1], rows[k + 2], rows[k + 3]
            for c in range(2 * antennas):
                part, total = parts[c, k : k + 4], sums[c]
                z0, z1, z2, z3 = part[0], part[1], part[2], part[3]
                for i in range(places):
                    total[i] += row0[i] * z0 + row1[i] * z1 + row2[i] * z2 + row3[i] * z3
        for antenna in range(antennas):
            for i in range(places):
                channel[burst, antenna, 2 * i] = sums[2 * antenna, i]
                channel[burst, antenna, 2 * i + 1] = sums[2 * antenna + 1, i]


def wiener_estimator(pattern: PilotPattern, doppler_per_symbol: float) -> WienerEstimator:
    """Estimator for the next Doppler upward on a grid of quarter octaves, from a cache.

    A Doppler assumed up to 19 % too high costs little; one too low would cost much. Whatever is
    below 1e-6 per symbol counts as 1e-6.

    Examples
    --------
    >>> pattern = PilotPattern(data_symbols=28)
    >>> round(wiener_estimator(pattern, 0.00667).doppler_per_symbol, 5)
    0.00689
    """
    if not 0 <= doppler_per_symbol < 0.4:
        raise ValueError(
            f"doppler_per_symbol must lie from 0 to below 0.4, got {doppler_per_symbol!r}"
        )
    octaves = math.log2(max(doppler_per_symbol, _LEAST_DOPPLER) / _LEAST_DOPPLER)
    return _binned(pattern, math.ceil(octaves * _BINS_PER_OCTAVE - 1e-9))


@lru_cache(maxsize=128)
def _binned(pattern: PilotPattern, step: int) -> WienerEstimator:
    return WienerEstimator(pattern, _LEAST_DOPPLER * 2.0 ** (step / _BINS_PER_OCTAVE))
