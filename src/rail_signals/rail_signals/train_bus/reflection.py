"""Reflection where the impedance changes, and what returns of it.

Choi, Lee and Lim (S2), equation 23 and section 2.3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray


def reflection_coefficient(load_ohm: ArrayLike, impedance_ohm: ArrayLike) -> ComplexArray:
    """Reflection coefficient ``rho = (Z_L - Z0) / (Z_L + Z0)`` (23).

    Parameters
    ----------
    load_ohm : complex [...]
        Load Z_L [ohm]; infinite for an open end, zero for a short.
    impedance_ohm : complex [...]
        Characteristic impedance Z0 of the line [ohm], real part above zero.

    Returns
    -------
    complex [...]
        Reflected over incident wave.

    Examples
    --------
    >>> reflection_coefficient([math.inf, 0.0, 120.0], 120.0).real.tolist()
    [1.0, -1.0, 0.0]
    """
    load = np.asarray(load_ohm, dtype=np.complex128)
    bus_line = np.asarray(impedance_ohm, dtype=np.complex128)
    if not np.isfinite(bus_line).all() or (bus_line.real <= 0).any():
        raise ValueError(f"impedance_ohm must be finite and above 0, got {impedance_ohm!r}")
    if np.isnan(load).any() or (load.real < 0).any():
        raise ValueError(f"load_ohm must not be below 0, got {load_ohm!r}")
    is_open = np.isinf(load)
    finite = np.where(is_open, 0.0, load)
    return np.asarray(np.where(is_open, 1.0, (finite - bus_line) / (finite + bus_line)))


def load_from_reflection(rho: ArrayLike, impedance_ohm: ArrayLike) -> ComplexArray:
    """Load ``Z0 (1 + rho) / (1 - rho)`` behind a reflection, (23) solved for Z_L [ohm].

    A coefficient of exactly 1 is an open end: infinite.
    """
    coefficient = np.asarray(rho, dtype=np.complex128)
    bus_line = np.asarray(impedance_ohm, dtype=np.complex128)
    is_open = coefficient == 1
    rest = np.where(is_open, 1.0, 1 - coefficient)
    return np.asarray(np.where(is_open, math.inf, bus_line * (1 + coefficient) / rest))


def return_loss_db(rho: ArrayLike) -> FloatArray:
    """Return loss ``-20 log10 |E_r / E_i|`` [dB]: 0 for open and short, infinite if matched.

    Examples
    --------
    >>> float(return_loss_db(reflection_coefficient(95.0, 105.0))).__round__(2)
    26.02
    """
    magnitude = np.abs(np.asarray(rho, dtype=np.complex128))
    with np.errstate(divide="ignore"):
        return np.asarray(-20 * np.log10(magnitude) + 0.0)
