"""A kind of cable: its constants per metre at any frequency, real or complex.

Beside R, L, G and C of Choi, Lee and Lim (S2, equation 3) a cable has a skin effect. The field
in a conductor obeys a diffusion equation, whose internal impedance is taken as

    Z_i(s) = sqrt(R^2 + S^2 s / pi),    at s = j w:  sqrt(R^2 + 2 j f S^2),

which is R at direct current and ``S (1 + j) sqrt(f)`` where the skin is thin: the resistance
grows with the root of the frequency and brings an internal reactance of the same size. The
function is analytic to the right of ``s = -pi R^2 / S^2``, so that the line stays causal and
passive. L is the external inductance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray

from .cable_constants import (
    capacitance_from_velocity,
    complex_root,
    inductance_from_impedance,
    lossless_impedance,
    lossless_velocity,
    neper_to_db,
    propagation_constant,
)


class WaveConstants(NamedTuple):
    """Constants of a cable over frequency, each [frequencies]."""

    propagation: ComplexArray
    """Propagation constant gamma [1/m]."""
    attenuation: FloatArray
    """Its real part [Np/m]."""
    phase: FloatArray
    """Its imaginary part [rad/m]."""
    impedance: ComplexArray
    """Characteristic impedance Z0 [ohm]."""
    admittance: ComplexArray
    """Its reciprocal [S]."""


@dataclass(frozen=True)
class Cable:
    """Constants per metre of one kind of cable, both conductors together.

    Parameters
    ----------
    inductance_h_per_m, capacitance_f_per_m
        External inductance L [H/m] and capacitance C [F/m], above zero.
    resistance_ohm_per_m
        Loop resistance R at direct current [ohm/m].
    conductance_s_per_m
        Conductance G of the insulation [S/m].
    skin_ohm_per_m_sqrt_hz
        Factor S of the skin effect: the resistance tends to ``S sqrt(f)`` [ohm/(m sqrt(Hz))].

    Raises
    ------
    ValueError
        If a value is out of range; the message names and quotes it.
    """

    inductance_h_per_m: float
    capacitance_f_per_m: float
    resistance_ohm_per_m: float = 0.0
    conductance_s_per_m: float = 0.0
    skin_ohm_per_m_sqrt_hz: float = 0.0

    def __post_init__(self) -> None:
        """Validate every constant."""
        for name in ("inductance_h_per_m", "capacitance_f_per_m"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, got {value!r}")
        for name in ("resistance_ohm_per_m", "conductance_s_per_m", "skin_ohm_per_m_sqrt_hz"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and 0 or more, got {value!r}")

    @classmethod
    def from_impedance(
        cls,
        impedance_ohm: float,
        velocity_factor: float,
        resistance_ohm_per_m: float = 0.0,
        conductance_s_per_m: float = 0.0,
        skin_ohm_per_m_sqrt_hz: float = 0.0,
    ) -> Cable:
        """Cable of a given lossless impedance [ohm] and velocity over that of light."""
        capacitance = float(capacitance_from_velocity(impedance_ohm, velocity_factor))
        inductance = float(inductance_from_impedance(impedance_ohm, capacitance))
        return cls(
            inductance,
            capacitance,
            resistance_ohm_per_m,
            conductance_s_per_m,
            skin_ohm_per_m_sqrt_hz,
        )

    @property
    def impedance_ohm(self) -> float:
        """Characteristic impedance without loss (S2, 19) [ohm]."""
        return float(lossless_impedance(self.inductance_h_per_m, self.capacitance_f_per_m))

    @property
    def velocity_m_per_s(self) -> float:
        """Phase velocity without loss (S2, 20) [m/s]."""
        return float(lossless_velocity(self.inductance_h_per_m, self.capacitance_f_per_m))

    def internal_impedance(self, s_rad_per_s: ArrayLike) -> ComplexArray:
        """Impedance of the conductors themselves, ``sqrt(R^2 + S^2 s / pi)`` [ohm/m]."""
        s = np.asarray(s_rad_per_s, dtype=np.complex128)
        if self.skin_ohm_per_m_sqrt_hz == 0:
            return np.full(s.shape, self.resistance_ohm_per_m, dtype=np.complex128)
        skin = self.skin_ohm_per_m_sqrt_hz**2 / math.pi
        return complex_root(self.resistance_ohm_per_m**2 + skin * s)

    def wave_constants(self, s_rad_per_s: ArrayLike) -> WaveConstants:
        """Propagation constant (S2, 9) and characteristic impedance (S2, 14).

        Parameters
        ----------
        s_rad_per_s : complex [frequencies]
            Complex frequency ``s = c + j w`` [rad/s], c not negative, s not zero where the
            insulation does not conduct.
        """
        s = np.asarray(s_rad_per_s, dtype=np.complex128)
        series = self.internal_impedance(s) + s * self.inductance_h_per_m
        shunt = self.conductance_s_per_m + s * self.capacitance_f_per_m
        gamma = propagation_constant(series, shunt)
        if not shunt.all():
            raise ValueError(f"s must not be zero where conductance_s_per_m is, got {self}")
        impedance = gamma / shunt
        return WaveConstants(gamma, gamma.real.copy(), gamma.imag.copy(), impedance, 1 / impedance)

    def attenuation_db_per_m(self, frequency_hz: ArrayLike) -> FloatArray:
        """Attenuation at a frequency [dB/m].

        Examples
        --------
        >>> round(float(Cable.from_impedance(120.0, 0.7, 0.24).attenuation_db_per_m(1e6)), 5)
        0.00868
        """
        s = 2j * math.pi * np.asarray(frequency_hz, dtype=np.float64)
        return neper_to_db(self.wave_constants(s).attenuation)
