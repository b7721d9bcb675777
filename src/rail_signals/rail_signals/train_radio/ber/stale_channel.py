"""Error rate of a link whose channel changes between the two symbols of a code block.

Eq 3 of An, Kim and Jeong takes the channel for constant over two symbols. On a fast train it
is not: between them it keeps the correlation ``rho = J0(2 pi f_D T)``,

    h(t + T) = rho h(t) + sqrt(1 - rho^2) w,    w independent of h, of the same power.

The combiner here uses the channel of the *first* symbol for both, as eqs 6 and 8 do. In

    x1~ = sum over receivers of h1* y(t) + h2 y*(t + T)
        = sum of (|h1|^2 + h2 h2'*) x1 + h2 (h1 - h1')* x2 + noise

the second symbol leaks in, and an error floor remains without any noise. For given symbols
the decision ``d = Re(x~)`` is a Hermitian form of jointly Gaussian values, d = v^H M v with
``v = (h1, h2, y(t), y(t + T))`` of covariance C. With the eigenvalues lambda of C M, and N_r
independent receivers,

    E exp(-s d) = prod (1 + lambda s)^(-N_r),
    P(d < 0) = 1 / (2 pi j) integral of E exp(-s d) / s over Re s = c,

which is exact; the integral is a Gauss-Chebyshev sum (Biglieri et al., 1996).
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import j0

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.train_radio.space_time_block import Scheme

_NODES = 256


def jakes_correlation(speed_m_per_s: float, carrier_hz: float, interval_s: float) -> float:
    """Correlation ``J0(2 pi f_D T)`` of a scattered channel after an interval.

    Examples
    --------
    What eq 3 neglects, ``E|h(t + T) - h(t)|^2``, at 300 km/h and 2.4 GHz [dB]:

    >>> rho = [jakes_correlation(300 / 3.6, 2.4e9, t) for t in (10e-6, 66.7e-6)]
    >>> [round(10 * math.log10(2 * (1 - r)), 1) for r in rho]
    [-30.6, -14.1]
    """
    doppler_hz = speed_m_per_s * carrier_hz / SPEED_OF_LIGHT_M_PER_S
    return float(j0(2 * math.pi * doppler_hz * interval_s))


def stale_error_rate(
    scheme: Scheme, eb_n0: ArrayLike, correlation: float, bits_per_symbol: int = 2
) -> FloatArray:
    """Bit error rate with the first symbol's channel used for both, Rayleigh fading.

    Parameters
    ----------
    eb_n0 : float [...]
        Energy per bit over noise density at each receiver (linear); infinity for the floor.
    correlation
        rho of the channel between the two symbols, in (0, 1].
    bits_per_symbol
        1 (BPSK) or 2 (QPSK).

    Examples
    --------
    >>> from rail_signals.train_radio.ber.closed_form import ALAMOUTI_2X2, error_rate
    >>> f"{stale_error_rate(ALAMOUTI_2X2, 10.0, 1.0):.6e} {error_rate(ALAMOUTI_2X2, 10.0):.6e}"
    '1.133584e-04 1.133584e-04'
    """
    if not 0 < correlation <= 1:
        raise ValueError(f"correlation must be in (0, 1], got {correlation!r}")
    if bits_per_symbol not in (1, 2):
        raise ValueError(f"bits_per_symbol must be 1 or 2, got {bits_per_symbol!r}")
    ratio = np.asarray(eb_n0, dtype=np.float64)
    if not (ratio > 0).all():
        raise ValueError(f"eb_n0 must be positive, got {eb_n0!r}")
    points = [1.0] if bits_per_symbol == 1 else [1 + 1j, 1 - 1j]
    # The first bit is positive and, by symmetry, stands for all of its symbol.
    others = [p * sign for p in points for sign in (1, -1)]
    flat = []
    for level in ratio.ravel().tolist():
        noise = scheme.transmit / level
        rates = [
            _negative_probability(scheme, correlation, noise, x, other, second)
            for x, other, second in itertools.product(points, others, (False, True))
        ]
        flat.append(sum(rates) / len(rates))
    return np.asarray(flat, dtype=np.float64).reshape(ratio.shape)


def _negative_probability(
    scheme: Scheme, rho: float, noise: float, x: complex, other: complex, second: bool
) -> float:
    """P(Re x~ < 0) of the first or second symbol, x, sent along with another."""
    # Columns of `mix`: h1, h2 at t; innovations of both; noise of both symbols.
    fresh = math.sqrt(1 - rho**2)
    x1, x2 = (other, x) if second else (x, other)
    if scheme.transmit == 1:
        received = [[x1, 0, 0, 0, 1, 0], [rho * x2, 0, fresh * x2, 0, 0, 1]]
        pairs = [(0, 3)] if second else [(0, 2)]
        signs = [1.0]
    else:
        a, b = -np.conj(x2), np.conj(x1)
        received = [[x1, x2, 0, 0, 1, 0], [rho * a, rho * b, fresh * a, fresh * b, 0, 1]]
        # Re(h1* y1 + h2 y2*) for the first symbol, Re(h2* y1 - h1 y2*) for the second.
        pairs = [(1, 2), (0, 3)] if second else [(0, 2), (1, 3)]
        signs = [1.0, -1.0] if second else [1.0, 1.0]
    mix = np.array([[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], *received], dtype=np.complex128)
    mix[:, 4:] *= math.sqrt(noise)
    form = np.zeros((4, 4), dtype=np.complex128)
    for (i, k), sign in zip(pairs, signs, strict=True):
        form[i, k] = form[k, i] = sign / 2
    return _below_zero(mix.conj().T @ form @ mix, scheme.receive)


def _below_zero(form: ComplexArray, copies: int) -> float:
    """P(sum of `copies` independent ``u^H form u`` < 0), u standard complex normal."""
    eigenvalues = np.linalg.eigvalsh(form)
    worst = -float(eigenvalues[0])
    if worst <= 1e-14 * float(np.abs(eigenvalues).max()):
        return 0.0
    # Any abscissa left of the first pole will do; the middle is close to the saddle.
    c = 0.5 / worst
    tau = np.tan((np.arange(_NODES) + 0.5) * (math.pi / (2 * _NODES)))
    s = c * (1 + 1j * tau)
    value = np.prod(1 + eigenvalues[:, None] * s, axis=0) ** -float(copies)
    return float(np.mean(value.real + tau * value.imag) / 2)
