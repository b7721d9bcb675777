"""Complex amplitudes of tones of known frequency in a slot, by generalised least squares.

The transform of Kim et al. (equations 5-8) is taken at the tone frequencies instead of the
nearest bins: a slot of ``L`` samples at rate ``fs`` is modelled as

``x[n] = sum_i Re(a_i g_i exp(j 2 pi F_i t_n)) + c_0 + sum_k c_k u_k[n] + e[n]``

with the amplitudes ``a_i`` wanted, the known gain ``g_i`` of the chain at each tone, a
constant, optional waves of no interest ``u_k`` and coloured noise ``e``. Time runs to zero
at the newest sample: ``t_n = (n - L + 1) / fs``. The Gauss-Markov estimate weighs with the
inverse covariance of the noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular, toeplitz

from rail_signals.arrays import ComplexArray, FloatArray

NoiseSpectrum: TypeAlias = Callable[[FloatArray], FloatArray]
"""One-sided power density over frequency [Hz]: float [n] -> float [n]."""

_SPECTRUM_POINTS = 4096
_WORST_CONDITION = 1e6


@dataclass(frozen=True, eq=False)
class ToneEstimator:
    """Linear map from a slot to tone amplitudes, and to what the model leaves over.

    Attributes
    ----------
    matrix : complex128 [tones, samples]
        ``matrix @ slot`` are the complex amplitudes a_i at the newest sample.
    whitener : float64 [freedom, samples]
        ``whitener @ slot`` are independent residuals of equal variance.
    spread : float64 [tones]
        Standard deviation of each real part of a_i where those residuals have variance 1.
    condition
        Condition number of the whitened model.
    """

    matrix: ComplexArray
    whitener: FloatArray
    spread: FloatArray
    condition: float

    def amplitudes(self, slots: ArrayLike) -> ComplexArray:
        """Complex amplitudes [..., tones] of slots [..., samples]."""
        return np.asarray(np.asarray(slots) @ self.matrix.T, dtype=np.complex128)

    def noise(self, slots: ArrayLike) -> FloatArray:
        """Standard deviation [..., tones] of the amplitudes, told from the residuals."""
        left = np.asarray(slots) @ self.whitener.T
        scale = np.sqrt(np.mean(left * left, axis=-1))
        return np.asarray(scale[..., None] * self.spread, dtype=np.float64)


def tone_columns(tones_hz: ArrayLike, rate_hz: float, samples: int) -> ComplexArray:
    """Waves ``exp(j 2 pi F_i t_n)`` with ``t_n = 0`` at the newest sample.

    Returns
    -------
    complex128 [samples, tones]
    """
    tones = np.asarray(tones_hz, dtype=np.float64)
    time_s = np.arange(1 - samples, 1) / rate_hz
    return np.asarray(np.exp(2j * math.pi * time_s[:, None] * tones), dtype=np.complex128)


def noise_covariance(spectrum: NoiseSpectrum | None, rate_hz: float, samples: int) -> FloatArray:
    """Covariance of successive samples of noise with the given spectrum.

    ``r[k] = int_0^{fs/2} S(f) cos(2 pi f k / fs) df``, normalised to ``r[0] = 1``.

    Parameters
    ----------
    spectrum
        Power density over [0, fs / 2], aliases included; None for white noise.

    Returns
    -------
    float64 [samples, samples]

    Examples
    --------
    >>> noise_covariance(None, 64.0, 3).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    if spectrum is None:
        return np.eye(samples)
    points = max(_SPECTRUM_POINTS, 8 * samples)
    frequency = np.linspace(0.0, rate_hz / 2, points + 1)
    density = np.asarray(spectrum(frequency), dtype=np.float64)
    if density.shape != frequency.shape or not np.isfinite(density).all() or np.min(density) < 0:
        raise ValueError("noise_spectrum must return a finite density from zero per frequency")
    # An even spectrum: its inverse transform is the trapezoidal rule of the integral above.
    lags = np.fft.irfft(density)[:samples]
    if lags[0] <= 0:
        raise ValueError(f"noise_spectrum must not be zero everywhere, got a power of {lags[0]!r}")
    return np.asarray(toeplitz(lags / lags[0]), dtype=np.float64)


def tone_estimator(
    tones_hz: ArrayLike,
    rate_hz: float,
    samples: int,
    *,
    noise_spectrum: NoiseSpectrum | None = None,
    gain: ArrayLike | None = None,
    nuisance: ArrayLike | None = None,
) -> ToneEstimator:
    """Design the estimator of a slot.

    Parameters
    ----------
    tones_hz : [tones]
        Frequencies F_i [Hz], distinct, between 0 and half the rate.
    rate_hz
        Sample rate fs of the slot [Hz].
    samples
        Length L of the slot.
    noise_spectrum
        One-sided power density of the noise in the slot, any scale; None for white. It
        should not vanish inside [0, fs / 2], or the estimate trusts the void blindly.
    gain : complex [tones], optional
        Gain g_i of the chain at each tone; 1 unless given.
    nuisance : float [samples, waves], optional
        Waves u_k to be ignored besides a constant.

    Raises
    ------
    ValueError
        If the slot is too short for the tones, or an argument has the wrong shape.

    Examples
    --------
    >>> estimator = tone_estimator([20.0, 25.0, 30.0], 100.0, 100)
    >>> wave = np.cos(2 * np.pi * 25.0 * np.arange(100) / 100.0)
    >>> abs(estimator.amplitudes(wave)).round(12).tolist()
    [0.0, 1.0, 0.0]
    """
    tones = np.asarray(tones_hz, dtype=np.float64)
    if tones.ndim != 1 or not tones.size or not np.all((tones > 0) & (tones < rate_hz / 2)):
        raise ValueError(f"tones_hz must lie between 0 and {rate_hz / 2} Hz, got {tones_hz!r}")
    gains = np.ones(tones.size) if gain is None else np.asarray(gain, dtype=np.complex128)
    if gains.shape != tones.shape or not np.all(np.abs(gains) > 0):
        raise ValueError(f"gain must hold one value that is not zero per tone, got {gain!r}")
    waves = tone_columns(tones, rate_hz, samples) * gains
    columns = [waves.real, -waves.imag, np.ones((samples, 1))]
    if nuisance is not None:
        extra = np.asarray(nuisance, dtype=np.float64)
        if extra.ndim != 2 or extra.shape[0] != samples:
            raise ValueError(f"nuisance must have {samples} rows, got shape {extra.shape}")
        columns.append(extra / np.linalg.norm(extra, axis=0) * math.sqrt(samples))
    model = np.hstack(columns)
    if samples <= model.shape[1]:
        raise ValueError(f"samples must exceed the {model.shape[1]} unknowns, got {samples}")
    root = np.linalg.cholesky(noise_covariance(noise_spectrum, rate_hz, samples))
    white = solve_triangular(root, model, lower=True)
    # Columns of like size, so that the condition speaks of the tones and not of the noise.
    size = np.linalg.norm(white, axis=0)
    q, r = np.linalg.qr(white / size, mode="complete")
    unknowns = model.shape[1]
    condition = float(np.linalg.cond(r[:unknowns]))
    if not condition < _WORST_CONDITION:
        raise ValueError(f"samples must tell the tones apart, got {samples}")
    inverse = solve_triangular(r[:unknowns], np.eye(unknowns)) / size[:, None]
    unwhiten = solve_triangular(root, q, lower=True, trans="T").T
    solution = inverse @ unwhiten[:unknowns]
    count = tones.size
    variance = np.sum(inverse[: 2 * count] ** 2, axis=1)
    return ToneEstimator(
        matrix=np.asarray(solution[:count] + 1j * solution[count : 2 * count]),
        whitener=np.asarray(unwhiten[unknowns:]),
        spread=np.sqrt((variance[:count] + variance[count:]) / 2),
        condition=condition,
    )
