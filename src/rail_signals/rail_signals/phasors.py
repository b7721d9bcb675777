"""Complex exponentials."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray


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
