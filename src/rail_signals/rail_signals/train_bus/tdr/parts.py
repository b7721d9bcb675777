"""Parts of a supposed line on one frequency axis: cable, what is in series, what is across.

`rail_signals.train_bus.tdr.chain` puts them together for given deviations of a train and a supposed
fault.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cable_constants import complex_root

NANO: Final = 1e-9
"""Inductances among the values of a fault are in nanohenry."""

MICRO: Final = 1e-6
"""Conductances among the values of a fault are in microsiemens per metre."""


@dataclass(frozen=True)
class FaultGuess:
    """A supposed fault.

    Parameters
    ----------
    kind
        One of `bus_faults.KINDS`.
    index
        Number of the car it is in; of the coupler for a loose connector.
    values
        By kind: ``open``: place; ``short``: place, resistance; ``water_ingress``: place,
        length, rise of the capacitance, conductance; ``bad_splice``: place, resistance,
        inductance; ``loose_connector``: resistance, inductance; ``wrong_cable``: logarithms
        of the factors on impedance, delay, resistance and skin effect;
        ``missing_shield_ground``: on impedance, and on both losses together. Places [m] count
        from the start of the car's run; resistances [ohm], inductances [nH], conductances
        [uS/m].
    """

    kind: str
    index: int
    values: FloatArray


@dataclass(frozen=True)
class WaveSpectra:
    """A cable over frequency: spectra [frequencies]."""

    propagation: ComplexArray
    attenuation: FloatArray
    phase: FloatArray
    impedance: ComplexArray
    admittance: ComplexArray
    shunt: ComplexArray
    """Shunt admittance per metre [S/m]."""
    resistive_fraction: ComplexArray
    """Derivative of the logarithm of the series impedance by that of the resistance."""
    skin_fraction: ComplexArray
    """The same by the factor of the skin effect."""


class Waves:
    """Spectra of cables on one axis, computed once each.

    Parameters
    ----------
    s_rad_per_s : complex [frequencies]
        Complex frequencies.
    """

    _MOST = 16

    def __init__(self, s_rad_per_s: ComplexArray) -> None:
        self.s = s_rad_per_s
        self._known: dict[tuple[Cable, float, float], WaveSpectra] = {}

    def of(self, cable: Cable, resistance_factor: float, skin_factor: float) -> WaveSpectra:
        """Spectra of a cable with other losses."""
        key = (cable, resistance_factor, skin_factor)
        if key not in self._known:
            if len(self._known) >= self._MOST:
                self._known.clear()
            self._known[key] = self.make(*key)
        return self._known[key]

    def make(
        self,
        cable: Cable,
        resistance_factor: float,
        skin_factor: float,
        rise: float = 0.0,
        conductance_s_per_m: float = 0.0,
    ) -> WaveSpectra:
        """Spectra of a cable with other losses, more capacitance and more conductance."""
        direct = (cable.resistance_ohm_per_m * resistance_factor) ** 2
        skin = (cable.skin_ohm_per_m_sqrt_hz * skin_factor) ** 2 / math.pi * self.s
        own = complex_root(direct + skin)
        series = own + self.s * cable.inductance_h_per_m
        shunt = self.s * (cable.capacitance_f_per_m * (1 + rise))
        shunt += cable.conductance_s_per_m + conductance_s_per_m
        gamma = complex_root(series * shunt)
        impedance = gamma / shunt
        return WaveSpectra(
            gamma,
            np.ascontiguousarray(gamma.real),
            np.ascontiguousarray(gamma.imag),
            impedance,
            1 / impedance,
            shunt,
            *_fractions(direct, skin, own * series),
        )


def _fractions(
    direct: float, skin: ComplexArray, product: ComplexArray
) -> tuple[ComplexArray, ComplexArray]:
    """Shares of direct and alternating resistance: those of the squares in ``own / series``."""
    if not product.any():
        return np.zeros_like(product), np.zeros_like(product)
    return direct / product, skin / product


@dataclass(frozen=True)
class Piece:
    """A length of cable in run number `run`."""

    wave: WaveSpectra
    impedance_factor: float
    length_m: float
    run: int


@dataclass(frozen=True)
class Series:
    """Resistance and inductance in series; `coupler` is its number if it is one."""

    resistance_ohm: float
    inductance_h: float
    coupler: int | None = None

    def impedance(self, s: ComplexArray) -> ComplexArray:
        """Impedance [ohm]."""
        return self.resistance_ohm + s * self.inductance_h


@dataclass(frozen=True)
class Shunt:
    """An admittance across; of a node also its derivative by capacitance."""

    admittance: ComplexArray
    run: int
    slope: ComplexArray | None = None


Part = Piece | Series | Shunt


@dataclass
class Chain:
    """Parts from the head on, and what ends them.

    Parameters
    ----------
    parts
        The parts.
    reached
        Runs of cable in it.
    is_terminated
        Whether the train's terminator ends it.
    load_ohm
        Load at the end; infinite is open, None is the impedance of the last piece.
    fault_part
        Number of the part that is the fault; that of the end if it is cut there.
    stretch_factor
        Delay factor of the run the fault is in.
    """

    parts: list[Part] = field(default_factory=list)
    reached: int = 0
    is_terminated: bool = False
    load_ohm: float | None = None
    fault_part: int | None = None
    stretch_factor: float = 1.0

    @property
    def pieces(self) -> list[Piece]:
        """The pieces of cable among the parts."""
        return [part for part in self.parts if isinstance(part, Piece)]

    def pieces_before(self, part: int) -> int:
        """Pieces of cable in front of part number `part`."""
        return sum(isinstance(p, Piece) for p in self.parts[:part])

    def end(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Voltage and current at the end, but for a factor."""
        ones = np.ones_like(s)
        if self.load_ohm is None:
            last = self.parts[-1]
            assert isinstance(last, Piece)
            return last.wave.impedance * last.impedance_factor, ones
        if math.isinf(self.load_ohm):
            return ones, np.zeros_like(s)
        return ones * self.load_ohm, ones
