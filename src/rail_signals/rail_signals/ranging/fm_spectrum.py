"""The spectral components of an FM ranging signal.

By the Jacobi-Anger expansion the wave is a sum of components at ``m_1 f_1 + m_2 f_2`` with
amplitude ``J_m1(beta_1) J_m2(beta_2)`` and phase ``-(m_1 theta_1 + m_2 theta_2)``: the
order of a component is the factor by which it magnifies the lag of the tone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import jv

from rail_signals.arrays import FloatArray

from .signal import RangingSignal

LOST_INFORMATION = 3e-3
"""Fraction of the Fisher information of each tone that the kept components may leave out."""

OVERLAP_LIMIT = 1e-7
"""Largest fraction of the power that left-out components may put onto kept ones."""

_MAX_ORDER = 40


@dataclass(frozen=True)
class FmSpectrum:
    """Components that together carry the phases of the tones; arrays of L components, T tones.

    Attributes
    ----------
    orders : int [L, T]
        Order of the component in each tone.
    bins : int [L]
        Cycles of the component in one period of the signal, modulo the period.
    amplitudes : float [L]
        Product of Bessel functions, for a wave of unit amplitude.
    """

    orders: NDArray[np.int64]
    bins: NDArray[np.int64]
    amplitudes: FloatArray

    @property
    def power(self) -> float:
        """Power of the components, of a wave of unit power."""
        return float((self.amplitudes**2).sum())

    @property
    def information(self) -> FloatArray:
        """``sum m_i^2 J^2`` of each tone [T]; half its squared index if none is left out."""
        return np.asarray((self.orders**2).T @ self.amplitudes**2)

    def strongest(self, fraction: float) -> FmSpectrum:
        """Return the fewest components that carry `fraction` of the power of these, ties whole."""
        power = self.amplitudes**2
        keep = power >= _tie(_cut(power, fraction * power.sum()))
        return FmSpectrum(self.orders[keep], self.bins[keep], self.amplitudes[keep])

    def real_basis(self, period: int) -> FloatArray:
        """Matrix [2 * period, 2 L] from a period of samples to its components.

        Both are rows of interleaved real and imaginary parts: a real product of this size
        is faster than the complex one. Scaled by ``1 / period``.
        """
        turn = 2 * math.pi / period * (np.outer(np.arange(period), self.bins) % period)
        basis = np.empty((period, 2, len(self.bins), 2))
        basis[:, 0, :, 0] = basis[:, 1, :, 1] = np.cos(turn) / period
        basis[:, 1, :, 0] = np.sin(turn) / period
        basis[:, 0, :, 1] = -basis[:, 1, :, 0]
        return basis.reshape(2 * period, 2 * len(self.bins))


def fm_spectrum(signal: RangingSignal) -> FmSpectrum:
    """Components of `signal` that carry all but `LOST_INFORMATION` of each tone's phase.

    Raises
    ------
    ValueError
        If components of the two tones fall onto each other, so that neither tells its order.

    Examples
    --------
    >>> fm_spectrum(RangingSignal()).orders.ravel().tolist()
    [-3, -2, -1, 0, 1, 2, 3]
    """
    order = np.arange(-_MAX_ORDER, _MAX_ORDER + 1)
    tones = len(signal.tones_hz)
    orders = np.stack(np.meshgrid(*[order] * tones, indexing="ij"), axis=-1).reshape(-1, tones)
    amplitudes = np.ones(len(orders))
    for i, beta in enumerate(signal.indices):
        amplitudes *= np.asarray(jv(orders[:, i], beta), dtype=np.float64)
    bins = (orders @ np.array(signal.cycles_per_period)) % signal.period_samples
    power = amplitudes**2
    keep = np.zeros(len(orders), dtype=np.bool_)
    for i, beta in enumerate(signal.indices):
        information = orders[:, i] ** 2 * power
        enough = (1 - LOST_INFORMATION) * beta**2 / 2
        keep |= information >= _tie(_cut(information, enough))
    keep |= power >= float(np.max(power[keep]))
    _check_overlap(signal, bins, power, keep)
    return FmSpectrum(orders[keep], bins[keep], amplitudes[keep])


def _cut(values: FloatArray, enough: float) -> float:
    """Smallest value to keep so that the kept ones add up to `enough`."""
    falling = np.sort(values)[::-1]
    return float(falling[min(int(np.searchsorted(np.cumsum(falling), enough)), len(falling) - 1)])


def _tie(value: float) -> float:
    """Lower a cut by a shade: mirrored components, equal but for rounding, stay together."""
    return value * (1 - 1e-9)


def _check_overlap(
    signal: RangingSignal,
    bins: NDArray[np.int64],
    power: FloatArray,
    keep: NDArray[np.bool_],
) -> None:
    """Reject signals whose components share a bin with a kept component."""
    kept_bins = bins[keep]
    clash = len(np.unique(kept_bins)) < len(kept_bins)
    overlap = float(power[~keep & np.isin(bins, kept_bins)].sum())
    if clash or overlap > OVERLAP_LIMIT:
        raise ValueError(
            f"tones_hz {signal.tones_hz} with deviations_hz {signal.deviations_hz} put spectral"
            f" components onto each other; use a smaller deviation or other tones"
        )
