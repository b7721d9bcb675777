"""Rows of complex exponentials, made from two short tables instead of one long one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.ranging_signal import ComplexArray


def rotation(cycles_per_sample: ArrayLike, samples: int) -> ComplexArray:
    """Rotations ``exp(j 2 pi c (n - (samples - 1) / 2))``, without phase at mid-burst.

    Parameters
    ----------
    cycles_per_sample : [...]
        Frequencies c as fractions of the sample rate.
    samples
        Samples n in a row.

    Returns
    -------
    complex128 [..., samples]

    Examples
    --------
    >>> rotation(0.25, 3).round(12).tolist()
    [-1j, (1+0j), 1j]
    """
    turn = 2.0 * math.pi * np.asarray(cycles_per_sample, dtype=np.float64)[..., None]
    fine_count = math.isqrt(samples - 1) + 1
    coarse_count = -(-samples // fine_count)
    fine = cis(turn * np.arange(fine_count))
    start = fine_count * np.arange(coarse_count) - (samples - 1) / 2
    coarse = cis(turn * start)
    shape = (*turn.shape[:-1], coarse_count * fine_count)
    return (coarse[..., :, None] * fine[..., None, :]).reshape(shape)[..., :samples]


def cis(angle_rad: ArrayLike) -> ComplexArray:
    """``exp(j angle)`` without the detour over a complex exponential."""
    angle = np.asarray(angle_rad, dtype=np.float64)
    out = np.empty(angle.shape, dtype=np.complex128)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out
