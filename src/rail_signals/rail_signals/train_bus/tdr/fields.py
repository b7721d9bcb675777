"""Voltage and current all along a train's line, on the frequency axis of a trace.

The recursion is that of `rail_signals.train_bus.cascade`, over the parts of a supposed line
(`rail_signals.train_bus.tdr.chain`), keeping what it passes. The fields are scaled so that products
of two of them transform to traces: for an incident wave of 1 V against R0, times the root of ``R0 /
2`` and of the incident spectrum.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import ComplexArray
from rail_signals.train_bus.bus_line import BusLine, ShuntElement, Stub, Termination
from rail_signals.train_bus.cascade import CascadePass, wave_exponential

from .parts import Chain, Piece, Series

Solution = tuple[ComplexArray, ComplexArray, list[ComplexArray | None]]


@dataclass(frozen=True)
class Fields:
    """Voltage and current along a line, scaled so that their squares transform to traces.

    Parameters
    ----------
    chain
        The parts.
    voltage, current : complex [parts + 1, frequencies]
        At the head and behind each part, times the root of ``R0 / 2`` and of the spectrum of
        the incident wave.
    response : complex [frequencies]
        Spectrum of the reflected wave.
    """

    chain: Chain
    voltage: ComplexArray
    current: ComplexArray
    response: ComplexArray


class NodeModel:
    """Admittance of a node whose capacitance is off, exactly, from two solutions of its stub.

    ``Y(dC) = Y + s dC T^2 / (1 + s dC Z)`` with the transfer T of the stub and the impedance Z
    at its end while its tap is shorted.
    """

    def __init__(self, node: Stub, run: CascadePass) -> None:
        self._admittance = run.stub_admittance(node)
        self._square = run.stub_transfer(node) ** 2 * run.s
        conductance = 0.0 if math.isinf(node.load.resistance_ohm) else 1 / node.load.resistance_ohm
        inward = (ShuntElement(conductance, node.capacitance_f), node.section)
        voltage, current = run.head(BusLine(inward, Termination(0.0)))
        self._inner = run.s * voltage / current

    def admittance(self, extra_f: float) -> tuple[ComplexArray, ComplexArray]:
        """Admittance and its derivative by capacitance: each complex [frequencies]."""
        if extra_f == 0:
            return self._admittance, self._square
        fraction = 1 / (1 + extra_f * self._inner)
        slope = self._square * fraction
        return self._admittance + extra_f * slope, slope * fraction


def solve(chain: Chain, s: ComplexArray) -> Solution:
    """Voltage and current at every boundary of a chain, as `CascadePass.ports` has them.

    Returns
    -------
    voltage, current : complex [parts + 1, frequencies]
        Each row lacks the decay of all parts in front; all share one more factor.
    decays : list of complex [frequencies] or None
        ``2 exp(-gamma l)`` of each piece of cable.
    """
    parts = chain.parts
    voltage = np.empty((len(parts) + 1, len(s)), dtype=np.complex128)
    current = np.empty_like(voltage)
    decays: list[ComplexArray | None] = [None] * len(parts)
    voltage[-1], current[-1] = chain.end(s)
    backward = np.empty_like(s)
    for port in range(len(parts) - 1, -1, -1):
        part, v, i = parts[port], voltage[port], current[port]
        if isinstance(part, Piece):
            wave, factor = part.wave, part.impedance_factor
            decay = np.empty_like(s)
            wave_exponential(wave.attenuation, wave.phase, part.length_m, decay)
            np.multiply(current[port + 1], wave.impedance, out=i)
            if factor != 1:
                i *= factor
            np.subtract(voltage[port + 1], i, out=backward)
            np.add(voltage[port + 1], i, out=v)
            backward *= decay
            backward *= decay
            np.subtract(v, backward, out=i)
            v += backward
            i *= wave.admittance
            if factor != 1:
                i *= 1 / factor
            decay *= 2
            decays[port] = decay
        elif isinstance(part, Series):
            i[...] = current[port + 1]
            np.multiply(i, part.impedance(s), out=v)
            v += voltage[port + 1]
        else:
            v[...] = voltage[port + 1]
            np.multiply(v, part.admittance, out=i)
            i += current[port + 1]
    return voltage, current, decays
