"""Rows of complex exponentials, made from two short tables instead of one long one."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray


def rotation(
    cycles_per_sample: ArrayLike,
    samples: int,
    dtype: Any = np.complex128,
) -> ComplexArray:
    """Rotations ``exp(j 2 pi c (n - (samples - 1) / 2))``, without phase at mid-burst.

    Parameters
    ----------
    cycles_per_sample : [...]
        Frequencies c as fractions of the sample rate.
    samples
        Samples n in a row.
    dtype
        Of the result; the tables are made in double precision.

    Returns
    -------
    complex [..., samples]

    Examples
    --------
    >>> rotation(0.25, 3).round(12).tolist()
    [-1j, (1+0j), 1j]
    """
    turn = 2.0 * math.pi * np.asarray(cycles_per_sample, dtype=np.float64)[..., None]
    fine_count = math.isqrt(samples - 1) + 1
    coarse_count = -(-samples // fine_count)
    fine = cis(turn * np.arange(fine_count)).astype(dtype, copy=False)
    start = fine_count * np.arange(coarse_count) - (samples - 1) / 2
    coarse = cis(turn * start).astype(dtype, copy=False)
    shape = (*turn.shape[:-1], coarse_count * fine_count)
    rows: ComplexArray = (coarse[..., :, None] * fine[..., None, :]).reshape(shape)
    return rows[..., :samples]


def cis(angle_rad: ArrayLike) -> ComplexArray:
    """``exp(j angle)`` without the detour over a complex exponential.

    Of angles in single precision it is complex64.
    """
    angle = np.asarray(angle_rad)
    kind: Any = np.complex64 if angle.dtype == np.float32 else np.complex128
    out: ComplexArray = np.empty(angle.shape, dtype=kind)
    np.cos(angle, out=out.real)
    np.sin(angle, out=out.imag)
    return out
