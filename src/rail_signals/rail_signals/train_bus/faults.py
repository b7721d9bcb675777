"""Faults of a bus cable: what each does to the line it sits in.

Choi, Lee and Lim (S2, sections 1 and 4) name connectors, shields, moisture and splices as the
usual faults. Places are metres of cable from the head, sections and couplers are counted from
it, from 0. Each fault has a method ``apply`` that returns the line with the fault in it.

The missing shield ground is a model of ours. A reflectometer drives one conductor against the
other, not in perfect balance, so that a grounded shield carries part of the return and adds
its share to the capacitance. A shield that floats does not: C falls and, as all modes of one
insulation share one velocity, L rises as much. So the impedance of the car's section rises, the
velocity stays, the return in the pair alone costs loss, and the line picks up noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TypeAlias

from .bus_line import (
    BusLine,
    CableSection,
    Coupler,
    Element,
    SeriesElement,
    ShuntElement,
    Termination,
)
from .cable import Cable

KINDS = (
    "open",
    "short",
    "water_ingress",
    "bad_splice",
    "wrong_cable",
    "missing_shield_ground",
    "loose_connector",
)
"""The kinds of fault, by the names under which they are reported."""


@dataclass(frozen=True)
class OpenCircuit:
    """The line is cut at `place_m`; nothing behind it is seen."""

    place_m: float
    kind = "open"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line that ends open at the cut."""
        elements, index = split_at(bus_line, self.place_m)
        return BusLine(elements[:index])


@dataclass(frozen=True)
class ShortCircuit:
    """The conductors touch at `place_m` with a resistance left between them [ohm]."""

    place_m: float
    resistance_ohm: float = 0.0
    kind = "short"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the short across it."""
        elements, index = split_at(bus_line, self.place_m)
        if self.resistance_ohm == 0:
            return BusLine(elements[:index], Termination(0.0))
        shunt = ShuntElement(1 / self.resistance_ohm)
        return BusLine((*elements[:index], shunt, *elements[index:]), bus_line.termination)


@dataclass(frozen=True)
class WaterIngress:
    """A stretch of cable is wet: more capacitance, and insulation that conducts.

    Parameters
    ----------
    place_m, length_m
        Start and length of the stretch [m]; it must not reach past an end of its section.
    capacitance_rise
        Fraction by which C rises; impedance and velocity fall with its root.
    conductance_s_per_m
        Added to G [S/m].
    """

    place_m: float
    length_m: float
    capacitance_rise: float
    conductance_s_per_m: float = 0.0
    kind = "water_ingress"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the wet stretch in it."""
        first, index = split_at(bus_line, self.place_m)
        elements, end = split_at(BusLine(first, bus_line.termination), self.place_m + self.length_m)
        wet = elements[index]
        if end != index + 1 or not isinstance(wet, CableSection):
            raise ValueError(f"the wet stretch must lie in one section, got {self}")
        cable = replace(
            wet.cable,
            capacitance_f_per_m=wet.cable.capacitance_f_per_m * (1 + self.capacitance_rise),
            conductance_s_per_m=wet.cable.conductance_s_per_m + self.conductance_s_per_m,
        )
        return _replaced(BusLine(elements, bus_line.termination), index, replace(wet, cable=cable))


@dataclass(frozen=True)
class BadSplice:
    """A joint at `place_m`: resistance [ohm], and the inductance [H] of untwisted ends."""

    place_m: float
    resistance_ohm: float
    inductance_h: float = 0.0
    kind = "bad_splice"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the joint in series."""
        elements, index = split_at(bus_line, self.place_m)
        joint = SeriesElement(self.resistance_ohm, self.inductance_h)
        return BusLine((*elements[:index], joint, *elements[index:]), bus_line.termination)


@dataclass(frozen=True)
class WrongCable:
    """Section number `section` is of another kind of cable."""

    section: int
    cable: Cable
    kind = "wrong_cable"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the cable replaced; length and tolerances stay."""
        index, section = _section(bus_line, self.section)
        return _replaced(bus_line, index, replace(section, cable=self.cable))


@dataclass(frozen=True)
class MissingShieldGround:
    """The shield of section number `section` floats.

    Parameters
    ----------
    section
        Number of the section.
    impedance_rise
        Fraction by which L rises and C falls, and with them the impedance.
    loss_rise
        Fraction by which the resistance rises.
    noise_factor
        Factor on the standard deviation of the noise of a reflectogram.
    """

    section: int
    impedance_rise: float
    loss_rise: float = 0.0
    noise_factor: float = 1.0
    kind = "missing_shield_ground"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the section changed."""
        index, section = _section(bus_line, self.section)
        cable, rise, loss = section.cable, 1 + self.impedance_rise, 1 + self.loss_rise
        floating = replace(
            cable,
            inductance_h_per_m=cable.inductance_h_per_m * rise,
            capacitance_f_per_m=cable.capacitance_f_per_m / rise,
            resistance_ohm_per_m=cable.resistance_ohm_per_m * loss,
            skin_ohm_per_m_sqrt_hz=cable.skin_ohm_per_m_sqrt_hz * loss,
        )
        return _replaced(bus_line, index, replace(section, cable=floating))


@dataclass(frozen=True)
class LooseConnector:
    """Contacts of coupler number `coupler` that do not hold.

    Parameters
    ----------
    coupler
        Number of the coupler.
    resistance_ohm, inductance_h
        Added in series with the contacts [ohm], [H].
    spread
        Standard deviation of the logarithm of the resistance from one trace to the next; it
        is drawn by whoever takes the traces.
    """

    coupler: int
    resistance_ohm: float
    inductance_h: float = 0.0
    spread: float = 0.0
    kind = "loose_connector"

    def apply(self, bus_line: BusLine) -> BusLine:
        """Return the line with the connector changed."""
        indices = [i for i, e in enumerate(bus_line.elements) if isinstance(e, Coupler)]
        if not 0 <= self.coupler < len(indices):
            raise ValueError(f"coupler must be one of {len(indices)}, got {self.coupler!r}")
        index = indices[self.coupler]
        element = bus_line.elements[index]
        assert isinstance(element, Coupler)
        loose = replace(
            element,
            resistance_ohm=element.resistance_ohm + self.resistance_ohm,
            inductance_h=element.inductance_h + self.inductance_h,
        )
        return _replaced(bus_line, index, loose)


BusFault: TypeAlias = (
    OpenCircuit
    | ShortCircuit
    | WaterIngress
    | BadSplice
    | WrongCable
    | MissingShieldGround
    | LooseConnector
)
"""Any of the faults."""


def place_of(fault: BusFault, bus_line: BusLine) -> float:
    """Where a fault begins [m of cable from the head]: its place, section or coupler."""
    if isinstance(fault, WrongCable | MissingShieldGround):
        index, _ = _section(bus_line, fault.section)
        return _start_m(bus_line, index)
    if isinstance(fault, LooseConnector):
        indices = [i for i, e in enumerate(bus_line.elements) if isinstance(e, Coupler)]
        return _start_m(bus_line, indices[fault.coupler])
    return fault.place_m


def split_at(bus_line: BusLine, place_m: float) -> tuple[tuple[Element, ...], int]:
    """Elements of a line with a boundary at a place, and the number of what lies behind it.

    Raises
    ------
    ValueError
        If the place is not within the line.
    """
    if not (math.isfinite(place_m) and 0 <= place_m <= bus_line.length_m):
        raise ValueError(f"place_m must lie within 0 and {bus_line.length_m:g} m, got {place_m!r}")
    start = 0.0
    for index, element in enumerate(bus_line.elements):
        if not isinstance(element, CableSection):
            continue
        inside = place_m - start
        if inside < element.length_m:
            if inside == 0:
                return bus_line.elements, index
            parts = (
                replace(element, length_m=inside),
                replace(element, length_m=element.length_m - inside),
            )
            return (*bus_line.elements[:index], *parts, *bus_line.elements[index + 1 :]), index + 1
        start += element.length_m
    return bus_line.elements, len(bus_line.elements)


def _section(bus_line: BusLine, number: int) -> tuple[int, CableSection]:
    """Index and element of a section by its number."""
    sections = [(i, e) for i, e in enumerate(bus_line.elements) if isinstance(e, CableSection)]
    if not 0 <= number < len(sections):
        raise ValueError(f"section must be one of {len(sections)}, got {number!r}")
    return sections[number]


def _start_m(bus_line: BusLine, index: int) -> float:
    return sum(e.length_m for e in bus_line.elements[:index] if isinstance(e, CableSection))


def _replaced(bus_line: BusLine, index: int, element: Element) -> BusLine:
    return BusLine(
        (*bus_line.elements[:index], element, *bus_line.elements[index + 1 :]), bus_line.termination
    )
