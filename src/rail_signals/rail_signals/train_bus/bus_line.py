"""The parts of a line, from its head to its far end, as data.

A `BusLine` is a chain of elements - sections of cable, couplers, stubs and lumped elements - that
a termination closes. Nothing is computed here but what each part is: a two-port of a length of
cable, an impedance in series, an admittance across, or a load.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from rail_signals.arrays import ComplexArray

from .cable import Cable


@dataclass(frozen=True)
class CableSection:
    """A length of cable.

    Parameters
    ----------
    cable
        Its kind.
    length_m
        Length [m]; zero is a section that is not there.
    impedance_factor, delay_factor
        What manufacture made of it: characteristic impedance and propagation constant are
        those of the kind times these.
    """

    cable: Cable
    length_m: float
    impedance_factor: float = 1.0
    delay_factor: float = 1.0

    def __post_init__(self) -> None:
        """Validate length and factors."""
        _check(self, "length_m")
        for name in ("impedance_factor", "delay_factor"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} must be above 0, got {getattr(self, name)!r}")

    @property
    def delay_s(self) -> float:
        """Time a wave takes through it, without loss [s]."""
        return self.length_m * self.delay_factor / self.cable.velocity_m_per_s

    @property
    def impedance_ohm(self) -> float:
        """Characteristic impedance without loss [ohm]."""
        return self.cable.impedance_ohm * self.impedance_factor


@dataclass(frozen=True)
class Termination:
    """A load across the end: a resistor, and a capacitor in series with it if finite.

    Parameters
    ----------
    resistance_ohm
        Resistance [ohm]; infinite is an open end, zero a short.
    capacitance_f
        Capacitance in series [F]; infinite is none.
    """

    resistance_ohm: float = math.inf
    capacitance_f: float = math.inf

    def __post_init__(self) -> None:
        """Validate both."""
        if math.isnan(self.resistance_ohm) or self.resistance_ohm < 0:
            raise ValueError(f"resistance_ohm must be 0 or more, got {self.resistance_ohm!r}")
        if math.isnan(self.capacitance_f) or self.capacitance_f <= 0:
            raise ValueError(f"capacitance_f must be above 0, got {self.capacitance_f!r}")

    def voltage_and_current(self, s: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """A voltage and current that the load admits at each complex frequency."""
        ones, zeros = np.ones_like(s), np.zeros_like(s)
        if math.isinf(self.resistance_ohm):
            return ones, zeros
        if math.isinf(self.capacitance_f):
            return ones * self.resistance_ohm, ones
        charge = s * self.capacitance_f
        return 1 + charge * self.resistance_ohm, charge


@dataclass(frozen=True)
class SeriesElement:
    """Resistance [ohm], inductance [H] and capacitance [F; infinite: none] in series."""

    resistance_ohm: float = 0.0
    inductance_h: float = 0.0
    capacitance_f: float = math.inf

    def __post_init__(self) -> None:
        """Validate all."""
        _check(self, "resistance_ohm", "inductance_h")
        if math.isnan(self.capacitance_f) or self.capacitance_f <= 0:
            raise ValueError(f"capacitance_f must be above 0, got {self.capacitance_f!r}")

    def impedance(self, s: ComplexArray) -> ComplexArray:
        """Impedance [ohm] at each complex frequency."""
        impedance = self.resistance_ohm + s * self.inductance_h
        if not math.isinf(self.capacitance_f):
            impedance += 1 / (s * self.capacitance_f)
        return impedance


@dataclass(frozen=True)
class ShuntElement:
    """Conductance [S] and capacitance [F] across the line."""

    conductance_s: float = 0.0
    capacitance_f: float = 0.0

    def __post_init__(self) -> None:
        """Validate both."""
        _check(self, "conductance_s", "capacitance_f")

    def admittance(self, s: ComplexArray) -> ComplexArray:
        """Admittance [S] at each complex frequency."""
        return self.conductance_s + s * self.capacitance_f


@dataclass(frozen=True)
class Coupler:
    """A connector between two cars: contacts in series, then its capacitance across.

    Parameters
    ----------
    resistance_ohm, inductance_h
        Of both contacts together [ohm], [H].
    capacitance_f
        Across the line behind them [F].
    """

    resistance_ohm: float = 0.0
    inductance_h: float = 0.0
    capacitance_f: float = 0.0

    def __post_init__(self) -> None:
        """Validate all."""
        _check(self, "resistance_ohm", "inductance_h", "capacitance_f")


@dataclass(frozen=True)
class Stub:
    """A node tapped onto the line: a short cable to a load, and capacitance beside it.

    Parameters
    ----------
    section
        The stub cable.
    load
        What it ends in.
    capacitance_f
        Input capacitance beside the load [F].
    """

    section: CableSection
    load: Termination = Termination()
    capacitance_f: float = 0.0

    def __post_init__(self) -> None:
        """Validate the capacitance."""
        _check(self, "capacitance_f")


Element: TypeAlias = CableSection | SeriesElement | ShuntElement | Coupler | Stub
"""Anything a line may be made of."""


@dataclass(frozen=True)
class BusLine:
    """Elements in the order in which a wave from the head meets them, and what ends them."""

    elements: tuple[Element, ...]
    termination: Termination = Termination()

    def __post_init__(self) -> None:
        """Coerce to a tuple."""
        object.__setattr__(self, "elements", tuple(self.elements))

    @property
    def length_m(self) -> float:
        """Length of the trunk, stubs not counted [m]."""
        return sum(e.length_m for e in self.elements if isinstance(e, CableSection))

    @property
    def delay_s(self) -> float:
        """Time a wave takes from head to end through the cables, without loss [s]."""
        return sum(e.delay_s for e in self.elements if isinstance(e, CableSection))


def _check(element: object, *names: str) -> None:
    """Reject values that are negative or not finite."""
    for name in names:
        value = getattr(element, name)
        if not (math.isfinite(value) and value >= 0):
            raise ValueError(f"{name} must be finite and 0 or more, got {value!r}")
