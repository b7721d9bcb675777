"""What a two-conductor line does to a wave: constants per metre and the rules made of them.

Choi, Lee and Lim, "Study on the Characteristics of the Transmitter Line for Data Transmitter
between Vehicles for High speed train" (S2), equations 3, 8, 9, 14 and 17-22. Equation 18 names
the wave that runs backwards ``v_p1``; it is ``v_p2 = -w / beta``.

==================  ===========================================================
``R, L, G, C``      resistance [ohm/m], inductance [H/m], conductance [S/m] and
                    capacitance [F/m] of the line, both conductors together
``Z, Y``            series impedance [ohm/m] and shunt admittance [S/m] (3)
``gamma``           propagation constant ``alpha + j beta`` [1/m] (9)
``alpha``           attenuation constant [Np/m]
``beta``            phase constant [rad/m]
``Z0``              characteristic impedance [ohm] (14)
``v_p``             phase velocity [m/s] (17)
==================  ===========================================================
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S

from .root_kernel import principal_roots

DB_PER_NEPER: Final = 20 / math.log(10)
"""One neper in decibels, 8.68589; S2 rounds it to 8.686."""

VELOCITY_FACTORS: Final = {"polyethylene": 0.66, "pulp": 0.72, "semi-solid polyethylene": 0.84}
"""Phase velocity over that of light by insulation, as S2 lists them after equation 18."""

TRANSITION_FRACTION: Final = 0.1
"""Fraction of the transition time that a stub may delay the wave: the rule of thumb (22)."""


def series_impedance(
    frequency_hz: ArrayLike, resistance_ohm_per_m: ArrayLike, inductance_h_per_m: ArrayLike
) -> ComplexArray:
    """Series impedance ``Z = R + j w L`` per metre (3) [...]."""
    omega = _omega(frequency_hz)
    r = _not_negative("resistance_ohm_per_m", resistance_ohm_per_m)
    return np.asarray(r + 1j * omega * _not_negative("inductance_h_per_m", inductance_h_per_m))


def shunt_admittance(
    frequency_hz: ArrayLike, conductance_s_per_m: ArrayLike, capacitance_f_per_m: ArrayLike
) -> ComplexArray:
    """Shunt admittance ``Y = G + j w C`` per metre (3) [...]."""
    omega = _omega(frequency_hz)
    g = _not_negative("conductance_s_per_m", conductance_s_per_m)
    return np.asarray(g + 1j * omega * _not_negative("capacitance_f_per_m", capacitance_f_per_m))


def propagation_constant(series: ArrayLike, shunt: ArrayLike) -> ComplexArray:
    """Propagation constant ``gamma = sqrt(Z Y)`` (8, 9), the root that decays forwards.

    Parameters
    ----------
    series, shunt : complex [...]
        Series impedance [ohm/m] and shunt admittance [S/m], real parts not negative.

    Returns
    -------
    complex [...]
        Attenuation [Np/m] and phase constant [rad/m] as real and imaginary part.
    """
    return complex_root(_passive("series", series) * _passive("shunt", shunt))


def characteristic_impedance(series: ArrayLike, shunt: ArrayLike) -> ComplexArray:
    """Characteristic impedance ``Z0 = sqrt(Z / Y)`` (13, 14) [ohm], real part not negative.

    Raises
    ------
    ValueError
        If the admittance is zero somewhere: an uncharged line has no impedance.
    """
    across = _passive("shunt", shunt)
    if not across.all():
        raise ValueError("shunt must not be zero, got 0")
    return complex_root(_passive("series", series) / across)


def complex_root(value: ArrayLike) -> ComplexArray:
    """Principal square root, exact in both parts, of values whose squares are in range.

    ``t = sqrt((|z| + |Re z|) / 2)`` is one part and ``Im z / (2 t)`` the other: no difference
    of nearly equal numbers, so that a small loss beside a large phase keeps its digits.

    Examples
    --------
    >>> complex_root([3 + 4j, -3 + 4j, -4.0, 0.0]).tolist()
    [(2+1j), (1+2j), 2j, 0j]
    """
    z = np.asarray(value, dtype=np.complex128)
    root = np.empty(z.shape, dtype=np.complex128)
    principal_roots(np.ascontiguousarray(z).reshape(-1), root.reshape(-1))
    return root


def neper_to_db(neper: ArrayLike) -> FloatArray:
    """Attenuation in decibels of one in nepers, per metre or not.

    Examples
    --------
    >>> round(float(neper_to_db(1.0)), 5)
    8.68589
    """
    return np.asarray(np.asarray(neper, dtype=np.float64) * DB_PER_NEPER)


def db_to_neper(decibel: ArrayLike) -> FloatArray:
    """Attenuation in nepers of one in decibels, per metre or not."""
    return np.asarray(np.asarray(decibel, dtype=np.float64) / DB_PER_NEPER)


def phase_velocities(
    frequency_hz: ArrayLike, phase_rad_per_m: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Velocities ``v_p1 = w / beta`` (17) and ``v_p2 = -w / beta`` (18) of the two waves [m/s]."""
    beta = _positive("phase_rad_per_m", phase_rad_per_m)
    forward = np.asarray(_omega(frequency_hz) / beta)
    return forward, -forward


def lossless_impedance(inductance_h_per_m: ArrayLike, capacitance_f_per_m: ArrayLike) -> FloatArray:
    """Characteristic impedance ``sqrt(L0 / C0)`` of a line without loss (19) [ohm]."""
    inductance = _positive("inductance_h_per_m", inductance_h_per_m)
    return np.asarray(np.sqrt(inductance / _positive("capacitance_f_per_m", capacitance_f_per_m)))


def lossless_velocity(inductance_h_per_m: ArrayLike, capacitance_f_per_m: ArrayLike) -> FloatArray:
    """Phase velocity ``1 / sqrt(L0 C0)`` of a line without loss (20) [m/s]."""
    inductance = _positive("inductance_h_per_m", inductance_h_per_m)
    return np.asarray(1 / np.sqrt(inductance * _positive("capacitance", capacitance_f_per_m)))


def velocity_from_impedance(impedance_ohm: ArrayLike, capacitance_f_per_m: ArrayLike) -> FloatArray:
    """Phase velocity ``1 / (Z0 C0)`` of a line without loss (21) [m/s].

    Examples
    --------
    >>> round(float(velocity_from_impedance(120.0, 65e-12)) / 1e6, 1)
    128.2
    """
    impedance = _positive("impedance_ohm", impedance_ohm)
    return np.asarray(1 / (impedance * _positive("capacitance_f_per_m", capacitance_f_per_m)))


def inductance_from_impedance(
    impedance_ohm: ArrayLike, capacitance_f_per_m: ArrayLike
) -> FloatArray:
    """Inductance ``Z0^2 C0`` of a line without loss, equation 19 solved for L0 [H/m]."""
    impedance = _positive("impedance_ohm", impedance_ohm)
    return np.asarray(impedance**2 * _positive("capacitance_f_per_m", capacitance_f_per_m))


def capacitance_from_velocity(impedance_ohm: ArrayLike, velocity_factor: ArrayLike) -> FloatArray:
    """Capacitance ``1 / (Z0 v_p)``, equation 21 solved for C0 [F/m].

    Parameters
    ----------
    impedance_ohm, velocity_factor : [...]
        Z0 [ohm], and phase velocity over that of light, above 0 and not above 1.

    Examples
    --------
    >>> round(float(capacitance_from_velocity(120.0, 0.66)) * 1e12, 1)
    42.1
    """
    factor = _positive("velocity_factor", velocity_factor)
    if (factor > 1).any():
        raise ValueError(f"velocity_factor must not be above 1, got {velocity_factor!r}")
    velocity = factor * SPEED_OF_LIGHT_M_PER_S
    return np.asarray(1 / (_positive("impedance_ohm", impedance_ohm) * velocity))


def low_loss_attenuation(
    resistance_ohm_per_m: ArrayLike, conductance_s_per_m: ArrayLike, impedance_ohm: ArrayLike
) -> FloatArray:
    """Attenuation ``R / (2 Z0) + G Z0 / 2`` of a line with little loss [Np/m].

    The first term of equation 9 for ``w L >> R`` and ``w C >> G``.
    """
    impedance = _positive("impedance_ohm", impedance_ohm)
    series = _not_negative("resistance_ohm_per_m", resistance_ohm_per_m) / (2 * impedance)
    shunt = _not_negative("conductance_s_per_m", conductance_s_per_m) * impedance / 2
    return np.asarray(series + shunt)


def longest_stub_m(transition_time_s: ArrayLike, velocity_m_per_s: ArrayLike) -> FloatArray:
    """Longest stub ``t_pd v_p`` with ``t_pd = t_ID / 10`` (22) [m].

    Parameters
    ----------
    transition_time_s, velocity_m_per_s : [...]
        Transition time of the driver [s] and phase velocity of the stub [m/s].

    Examples
    --------
    >>> velocity = velocity_from_impedance(120.0, 65e-12)
    >>> round(float(longest_stub_m(13e-9, velocity)) * 1e3, 1)
    166.7
    """
    time = _positive("transition_time_s", transition_time_s)
    return np.asarray(TRANSITION_FRACTION * time * _positive("velocity", velocity_m_per_s))


def shortest_transition_s(stub_m: ArrayLike, velocity_m_per_s: ArrayLike) -> FloatArray:
    """Shortest transition time that a stub of given length bears, (22) the other way [s]."""
    delay = _positive("stub_m", stub_m) / _positive("velocity_m_per_s", velocity_m_per_s)
    return np.asarray(delay / TRANSITION_FRACTION)


def _omega(frequency_hz: ArrayLike) -> FloatArray:
    return 2 * math.pi * _not_negative("frequency_hz", frequency_hz)


def _passive(name: str, value: ArrayLike) -> ComplexArray:
    array = np.asarray(value, dtype=np.complex128)
    if not np.isfinite(array).all() or (array.real < 0).any():
        raise ValueError(f"{name} must be finite with a real part of 0 or more, got {value!r}")
    return array


def _not_negative(name: str, value: ArrayLike) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all() or (array < 0).any():
        raise ValueError(f"{name} must be finite and 0 or more, got {value!r}")
    return array


def _positive(name: str, value: ArrayLike) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if not np.isfinite(array).all() or (array <= 0).any():
        raise ValueError(f"{name} must be finite and above 0, got {value!r}")
    return array
