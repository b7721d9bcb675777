"""Frequency response of a line: what its head reflects and what reaches its nodes.

Voltage V and current I are carried from the load to the head. With forward and backward waves
``u = (V + Z0 I) / 2`` and ``w = (V - Z0 I) / 2`` (Choi, Lee and Lim, S2, equations 10-14) a
section of length l is, but for the factor ``exp(gamma l)`` that V and I share,

    V' = u + w exp(-2 gamma l),    Z0 I' = u - w exp(-2 gamma l).

The reflection does not know the factor; the transfer gets it back as ``exp(-sum gamma l)`` of
the sections in front. So two numbers per frequency and element do, instead of a matrix, nothing
grows on long lossy lines, and open and shorted ends are no special cases.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import ComplexArray, FloatArray

from .bus_line import BusLine, CableSection, Coupler, Element, SeriesElement, ShuntElement, Stub
from .cable import Cable, WaveConstants
from .section_kernel import through_sections


def input_reflection(
    bus_line: BusLine, frequency_hz: ArrayLike, reference_ohm: float
) -> ComplexArray:
    """Reflection coefficient of the head of a line (S2, 23).

    Parameters
    ----------
    bus_line
        The line.
    frequency_hz : [frequencies]
        Frequencies above zero [Hz]; zero too where every cable's insulation conducts.
    reference_ohm
        Impedance that the reflection is told against [ohm].

    Returns
    -------
    complex [frequencies]

    Examples
    --------
    A quarter wave of 120 ohm makes 144 ohm of 100:

    >>> from rail_signals.train_bus.bus_line import Termination
    >>> cable = Cable.from_impedance(120.0, 0.66)
    >>> line = BusLine((CableSection(cable, cable.velocity_m_per_s / 4e6),), Termination(100.0))
    >>> rho = input_reflection(line, [1e6], 100.0)
    >>> round(abs(100 * (1 + rho[0]) / (1 - rho[0])), 6)
    144.0
    """
    return reflection_at(bus_line, laplace_axis(frequency_hz), reference_ohm)


def input_impedance(bus_line: BusLine, frequency_hz: ArrayLike) -> ComplexArray:
    """Impedance of the head of a line [ohm]; infinite where no current flows."""
    voltage, current = CascadePass(laplace_axis(frequency_hz)).head(bus_line)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.where(current == 0, math.inf, voltage / current))


def transfer(
    bus_line: BusLine, frequency_hz: ArrayLike, source_ohm: float, load_ends: bool = False
) -> ComplexArray:
    """Voltages along a line over that which the source would give a matched load.

    Parameters
    ----------
    bus_line
        The line.
    frequency_hz : [frequencies]
        Frequencies [Hz], as of :func:`input_reflection`.
    source_ohm
        Resistance of the source at the head [ohm].
    load_ends
        Whether of a stub the voltage at its load is wanted instead of that where it is tapped.

    Returns
    -------
    complex [elements + 1, frequencies]
        Voltage behind each element and, first, at the head.
    """
    run = CascadePass(laplace_axis(frequency_hz))
    voltages, currents, decays = run.ports(bus_line)
    scale = 2 / (voltages[0] + _positive("source_ohm", source_ohm) * currents[0])
    rows = [scale * voltages[0]]
    for voltage, decay, element in zip(voltages[1:], decays, bus_line.elements, strict=True):
        if decay is not None:
            scale = scale * decay
        rows.append(scale * voltage)
        if load_ends and isinstance(element, Stub):
            rows[-1] = rows[-1] * run.stub_transfer(element)
    return np.stack(rows)


def reflection_at(
    bus_line: BusLine, s_rad_per_s: ComplexArray, reference_ohm: float
) -> ComplexArray:
    """Reflection coefficient of the head at complex frequencies s [rad/s]: [frequencies]."""
    reference = _positive("reference_ohm", reference_ohm)
    voltage, current = CascadePass(s_rad_per_s).head(bus_line)
    current *= reference
    total = voltage + current
    voltage -= current
    voltage /= total
    return voltage


def laplace_axis(frequency_hz: ArrayLike) -> ComplexArray:
    """``s = j w`` of frequencies in hertz, checked: complex [frequencies]."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    if frequency.ndim != 1 or not np.isfinite(frequency).all() or (frequency < 0).any():
        raise ValueError(f"frequency_hz must be one axis of 0 or more, got {frequency_hz!r}")
    return np.asarray(2j * math.pi * frequency)


class CascadePass:
    """One pass over lines on one axis of complex frequencies.

    What cables of a kind and stubs alike have in common is computed once. Sums and real
    factors run over the real view of a complex array: NumPy has vector instructions for these.

    Parameters
    ----------
    s_rad_per_s : complex [frequencies]
        Complex frequencies.
    """

    def __init__(self, s_rad_per_s: ComplexArray) -> None:
        self.s = np.ascontiguousarray(s_rad_per_s, dtype=np.complex128)
        self._waves: dict[Cable, WaveConstants] = {}
        self._stubs: dict[Stub, ComplexArray] = {}
        self._backward, self._decay = np.empty_like(self.s), np.empty_like(self.s)

    def head(self, bus_line: BusLine) -> tuple[ComplexArray, ComplexArray]:
        """Voltage and current at the head, but for a factor they share."""
        voltage, current = bus_line.termination.voltage_and_current(self.s)
        elements = reversed(bus_line.elements)
        for cable, run in groupby(elements, _cable_of):
            if cable is None:
                for element in run:
                    self._past(element, voltage, current)
            else:
                self._through_run(cable, list(run), voltage, current)
        return voltage, current

    def ports(
        self, bus_line: BusLine
    ) -> tuple[list[ComplexArray], list[ComplexArray], list[ComplexArray | None]]:
        """Voltage and current at every port, and the decay of every element.

        Returns
        -------
        voltages, currents : list of complex [frequencies]
            At the head and behind each element. Each port's pair lacks the decay of all
            elements in front, and all share one more factor.
        decays : list of complex [frequencies] or None
            ``2 exp(-gamma l)`` of each section; None for what has no length.
        """
        voltage, current = bus_line.termination.voltage_and_current(self.s)
        voltages, currents = [voltage], [current]
        decays: list[ComplexArray | None] = []
        for element in reversed(bus_line.elements):
            voltage, current = voltage.copy(), current.copy()
            if isinstance(element, CableSection):
                decay = self._decay_of(element, 1.0, np.empty_like(self.s))
                self._enter(element, current)
                self._through(voltage, current, np.square(decay, out=self._decay))
                self._leave(element, current)
                decay *= 2
                decays.append(decay)
            else:
                self._past(element, voltage, current)
                decays.append(None)
            voltages.append(voltage)
            currents.append(current)
        return voltages[::-1], currents[::-1], decays[::-1]

    def wave(self, cable: Cable) -> WaveConstants:
        """Propagation constant and impedances of a kind of cable."""
        if cable not in self._waves:
            self._waves[cable] = cable.wave_constants(self.s)
        return self._waves[cable]

    def stub_admittance(self, stub: Stub) -> ComplexArray:
        """Admittance that a stub puts across the line [S]."""
        if stub not in self._stubs:
            voltage, current = self.head(_stub_line(stub))
            self._stubs[stub] = current / voltage
        return self._stubs[stub]

    def stub_transfer(self, stub: Stub) -> ComplexArray:
        """Voltage at the load of a stub over that where it is tapped."""
        voltages, _, decays = self.ports(_stub_line(stub))
        decay = decays[0]
        return np.asarray(voltages[1] / voltages[0] * (1.0 if decay is None else decay))

    def _through_run(
        self,
        cable: Cable,
        sections: Sequence[Any],
        voltage: ComplexArray,
        current: ComplexArray,
    ) -> None:
        """Carry voltage and current over sections of one cable, the last first, in place."""
        wave = self.wave(cable)
        factors = [section.impedance_factor for section in sections]
        lengths = np.array([section.length_m * section.delay_factor for section in sections])
        ratios = np.array(factors) / np.array([1.0, *factors[:-1]])
        current *= wave.impedance
        through_sections(
            voltage.view(np.float64),
            current.view(np.float64),
            wave.attenuation,
            wave.phase,
            lengths,
            ratios,
        )
        current *= wave.admittance
        if factors[-1] != 1:
            current.view(np.float64)[...] /= factors[-1]

    def _enter(self, section: CableSection, current: ComplexArray) -> None:
        """Make the current ``Z0 I`` of a section, in place."""
        current *= self.wave(section.cable).impedance
        if section.impedance_factor != 1:
            current.view(np.float64)[...] *= section.impedance_factor

    def _leave(self, section: CableSection, current: ComplexArray) -> None:
        """Make it the current again, in place."""
        current *= self.wave(section.cable).admittance
        if section.impedance_factor != 1:
            current.view(np.float64)[...] /= section.impedance_factor

    def _through(self, voltage: ComplexArray, drop: ComplexArray, decay: ComplexArray) -> None:
        """Carry voltage and ``Z0 I`` over a section, in place; both come out twice as large."""
        v, d = voltage.view(np.float64), drop.view(np.float64)
        backward = self._backward
        w = backward.view(np.float64)
        np.subtract(v, d, out=w)
        v += d
        backward *= decay
        np.subtract(v, w, out=d)
        v += w

    def _past(self, element: Element, voltage: ComplexArray, current: ComplexArray) -> None:
        """Carry voltage and current over an element without length, in place."""
        if isinstance(element, SeriesElement):
            voltage += element.impedance(self.s) * current
        elif isinstance(element, ShuntElement):
            current += element.admittance(self.s) * voltage
        elif isinstance(element, Coupler):
            if element.capacitance_f:
                current += (element.capacitance_f * self.s) * voltage
            voltage += (element.resistance_ohm + element.inductance_h * self.s) * current
        elif isinstance(element, Stub):
            current += self.stub_admittance(element) * voltage
        else:
            raise TypeError(f"not an element of a line: {element!r}")

    def _decay_of(self, section: CableSection, times: float, out: ComplexArray) -> ComplexArray:
        """``exp(-times gamma l)`` of a section."""
        wave = self.wave(section.cable)
        length = times * section.length_m * section.delay_factor
        return wave_exponential(wave.attenuation, wave.phase, length, out)


def wave_exponential(
    attenuation: FloatArray, phase: FloatArray, length_m: float, out: ComplexArray
) -> ComplexArray:
    """``exp(-(alpha + j beta) l)``, written to `out`: complex [frequencies].

    With ``t = tan(beta l / 2)`` it is ``exp(-alpha l) (1 - j t)^2 / (1 + t^2)``. NumPy has
    vector instructions for the real exponential and the tangent, but none for the sine, the
    cosine or the complex exponential: this is three to four times as fast, and as exact.
    """
    tangent: FloatArray = phase * (length_m / 2)
    np.tan(tangent, out=tangent)
    size: FloatArray = attenuation * -length_m
    np.exp(size, out=size)
    fraction: FloatArray = tangent * tangent
    fraction += 1
    np.divide(size, fraction, out=fraction)
    fraction *= 2
    np.subtract(fraction, size, out=out.real)
    fraction *= tangent
    np.negative(fraction, out=out.imag)
    return out


def _cable_of(element: Element) -> Cable | None:
    return element.cable if isinstance(element, CableSection) else None


def _stub_line(stub: Stub) -> BusLine:
    return BusLine((stub.section, ShuntElement(0.0, stub.capacitance_f)), stub.load)


def _positive(name: str, value: float) -> float:
    if not (math.isfinite(value) and value > 0):
        raise ValueError(f"{name} must be finite and above 0, got {value!r}")
    return float(value)
