"""The trace of a train that is off its drawing, with a fault or none, and how it depends on both.

The derivative of the trace with respect to anything in the line follows from one solution of
it. If at some place an impedance dZ comes in series and an admittance dY across, the
compensation theorem gives the reflection of the head, for an incident wave of 1 V against R0:

    d Gamma = (R0 / 2) (I^2 dZ - V^2 dY)

with the voltage V and current I at that place. Over a length of cable with propagation constant
gamma and impedance Z0 the integrals are closed,

    d Gamma / d ln Z0 = (R0 / 2) (V I at its start - V I at its end)
    d Gamma / d ln l  = (R0 / 2) gamma l (Z0 I^2 - V^2 / Z0)          (the same all along it)

and a change of its series impedance alone, or of its admittance alone, is half the sum, or half
the difference, of the two. So every column of the Jacobian costs a few products of spectra and
a row of one inverse transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cascade import CascadePass
from rail_signals.train_bus.consist import COMMON, Consist

from .backscatter import backscatter_rows
from .chain import build_chain
from .fields import Fields, NodeModel, solve
from .parts import MICRO, NANO, Chain, FaultGuess, Piece, Series, Shunt, Waves
from .reflectometer import Reflectometer
from .response import incident_spectrum

_COLUMNS = 16
"""Columns beside four for each car: the trace, what is common, and the fault's."""


@dataclass(frozen=True)
class TracePrediction:
    """A trace and its derivatives.

    Parameters
    ----------
    trace : float64 [samples]
        The reflectogram.
    rows : int [parameters]
        Which deviations the rows of `jacobian` belong to; the others do not matter.
    jacobian : float64 [parameters, samples]
        Derivatives by deviations, per standard deviation.
    fault_jacobian : float64 [fault values, samples]
        Derivatives by the values of the fault.
    """

    trace: FloatArray
    rows: FloatArray
    jacobian: FloatArray
    fault_jacobian: FloatArray


class TraceModel:
    """Predicts the first samples of a train's trace.

    Parameters
    ----------
    consist
        Drawing of the train; the load of its nodes must be a resistor or open.
    instrument
        The reflectometer.
    samples
        Length of the trace.
    start_s
        Time of its first sample [s]; by default that of the instrument.
    runs
        Runs of cable that it reaches, the last of them never ending; all of them, with the
        terminator, by default.
    """

    def __init__(
        self,
        consist: Consist,
        instrument: Reflectometer,
        samples: int,
        start_s: float | None = None,
        runs: int | None = None,
    ) -> None:
        self.consist = consist
        self.runs = runs
        self.instrument = instrument
        self.grid = instrument.grid(samples, start_s)
        self.s = self.grid.laplace_axis()
        self._waves = Waves(self.s)
        self._incident = incident_spectrum(self.grid, instrument.rise_time_s, instrument.excitation)
        self._root = np.sqrt(self._incident * (instrument.reference_ohm / 2))
        most = 4 * len(consist.runs) + _COLUMNS
        self._work = np.empty((most, len(self.s)), dtype=np.complex128)
        self._scratch = np.empty((most, self.grid.transform_length))
        node = consist.node
        self._node = None if node is None else NodeModel(node, CascadePass(self.s))

    def backscatter(self, deviations: FloatArray) -> FloatArray:
        """What the roughness of a train scatters back: see `.backscatter`."""
        rise = self.instrument.rise_time_s
        return backscatter_rows(self.consist, rise, self.grid, self.s, self.fields(deviations))

    def trace(self, deviations: FloatArray, fault: FaultGuess | None = None) -> FloatArray:
        """The trace alone: float64 [samples]. Parameters as of :meth:`predict`."""
        chain = self._chain(deviations, fault)
        voltage, current, _ = solve(chain, self.s)
        reflection = self._reflection(voltage[0], current[0])
        return self._shown(self.grid.to_time(self._shifted(reflection, deviations)), deviations)

    def fields(self, deviations: FloatArray, fault: FaultGuess | None = None) -> Fields:
        """Voltage and current at every boundary of the line. Parameters as of `predict`."""
        chain = self._chain(deviations, fault)
        voltage, current, decays = solve(chain, self.s)
        response = self._shifted(self._reflection(voltage[0], current[0]), deviations)
        scale = self._root * (2 / (voltage[0] + self.instrument.reference_ohm * current[0]))
        trigger = self.consist.tolerances.trigger_s * deviations[6]
        if trigger:
            scale *= np.exp(self.s * (trigger / 2))
        for port, decay in enumerate(decays):
            voltage[port] *= scale
            current[port] *= scale
            if decay is not None:
                scale *= decay
        voltage[-1] *= scale
        current[-1] *= scale
        return Fields(chain, voltage, current, response)

    def predict(self, deviations: FloatArray, fault: FaultGuess | None = None) -> TracePrediction:
        """The trace and its derivatives.

        Parameters
        ----------
        deviations : float64 [7 + 4 cars - 1]
            Vector of `Deviations`.
        fault
            A fault, or none.
        """
        fields = self.fields(deviations, fault)
        chain = fields.chain
        cars, t = len(self.consist.runs), self.consist.tolerances
        reached, work = chain.reached, self._work
        work[0] = fields.response
        np.multiply(fields.response, self.s, out=work[1])
        by_impedance, by_length, density = self._piece_columns(fields)
        count = 2
        for parts in (by_impedance, by_length):
            count = self._sum_by_run(chain.pieces, parts, count)
        work[count] = self._loss_column(chain, by_impedance, by_length)
        rows = [*range(COMMON, COMMON + reached), *range(COMMON + cars, COMMON + cars + reached), 2]
        scales = [t.impedance] * reached + [t.delay] * reached + [t.loss]
        count += 1
        for row, scale, column in self._lumped_columns(fields):
            rows.append(row)
            scales.append(scale)
            work[count] = column
            count += 1
        for column in self._fault_columns(fields, fault, by_impedance, by_length, density):
            work[count] = column
            count += 1
        return self._assemble(deviations, rows, scales, count, reached)

    def _sum_by_run(self, pieces: list[Piece], parts: list[ComplexArray], count: int) -> int:
        """Write the sums of columns of the same run, return the number of columns written."""
        last = -1
        for piece, column in zip(pieces, parts, strict=True):
            if piece.run == last:
                self._work[count - 1] += column
            else:
                self._work[count] = column
                count += 1
                last = piece.run
        return count

    def impedance_of(self, chain: Chain) -> ComplexArray:
        """Impedance that a chain shows at its head [ohm]: [frequencies]."""
        voltage, current, _ = solve(chain, self.s)
        return np.asarray(voltage[0] / current[0])

    def _assemble(
        self,
        deviations: FloatArray,
        rows: list[int],
        scales: list[float],
        count: int,
        reached: int,
    ) -> TracePrediction:
        """Transform all columns at once, and add those that need no transform of their own."""
        t = self.consist.tolerances
        waves = self.grid.to_time(self._work[:count], self._scratch[:count])
        shown = self._shown(waves[0], deviations)
        gain = 1 + t.gain * deviations[4]
        own = slice(2, 2 + len(rows))
        common = np.empty((5, len(shown)))
        np.sum(waves[2 : 2 + reached], axis=0, out=common[0])
        np.sum(waves[2 + reached : 2 + 2 * reached], axis=0, out=common[1])
        common[:2] *= gain * np.array([[t.impedance_batch], [t.delay_batch]])
        np.multiply(waves[0], t.gain, out=common[2])
        common[3] = t.offset
        np.multiply(waves[1], gain * t.trigger_s, out=common[4])
        waves[own] *= gain * np.array(scales)[:, None]
        waves[2 + len(rows) :] *= gain
        index = np.array([*rows, 0, 1, 4, 5, 6])
        jacobian = np.concatenate([waves[own], common])
        return TracePrediction(shown, index, jacobian, waves[2 + len(rows) :])

    def _piece_columns(
        self, fields: Fields
    ) -> tuple[list[ComplexArray], list[ComplexArray], list[ComplexArray]]:
        """Of each piece: derivative by ln Z0, by ln length, and by length [1/m]."""
        impedances, lengths, densities = [], [], []
        voltage, current = fields.voltage, fields.current
        for port, part in enumerate(fields.chain.parts):
            if not isinstance(part, Piece):
                continue
            wave, factor = part.wave, part.impedance_factor
            difference = voltage[port] * current[port]
            difference -= voltage[port + 1] * current[port + 1]
            density = np.square(current[port])
            density *= wave.impedance
            across = np.square(voltage[port])
            across *= wave.admittance
            if factor != 1:
                density *= factor
                across *= 1 / factor
            density -= across
            density *= wave.propagation
            impedances.append(difference)
            densities.append(density)
            lengths.append(density * part.length_m)
        return impedances, lengths, densities

    def _loss_column(
        self, chain: Chain, by_impedance: list[ComplexArray], by_length: list[ComplexArray]
    ) -> ComplexArray:
        """Derivative by the logarithm of the resistance of all cables."""
        sums: dict[int, ComplexArray] = {}
        for piece, z, d in zip(chain.pieces, by_impedance, by_length, strict=True):
            total = sums.setdefault(id(piece.wave), np.zeros_like(self.s))
            total += z
            total += d
        waves = {id(piece.wave): piece.wave for piece in chain.pieces}
        column = np.zeros_like(self.s)
        for key, total in sums.items():
            column += total * (0.5 * (waves[key].resistive_fraction + waves[key].skin_fraction))
        return column

    def _lumped_columns(self, fields: Fields) -> list[tuple[int, float, ComplexArray]]:
        """Row, scale and column of nodes, couplers and the terminator."""
        cars, t = len(self.consist.runs), self.consist.tolerances
        voltage, current = fields.voltage, fields.current
        columns = []
        for port, part in enumerate(fields.chain.parts):
            if isinstance(part, Shunt) and part.slope is not None and self.consist.node:
                scale = -t.node_capacitance * self.consist.node.capacitance_f
                column = np.square(voltage[port]) * part.slope
                columns.append((COMMON + 2 * cars + part.run, scale, column))
            elif isinstance(part, Series) and part.coupler is not None:
                scale = t.coupler_inductance * self.consist.coupler.inductance_h
                if scale:
                    column = np.square(current[port]) * self.s
                    columns.append((COMMON + 3 * cars + part.coupler, scale, column))
        load = fields.chain.load_ohm
        if fields.chain.is_terminated and load is not None and math.isfinite(load):
            columns.append((3, t.termination * load, np.square(current[-1])))
        return columns

    def _fault_columns(
        self,
        fields: Fields,
        fault: FaultGuess | None,
        by_impedance: list[ComplexArray],
        by_length: list[ComplexArray],
        density: list[ComplexArray],
    ) -> list[ComplexArray]:
        """Derivatives by the values of the fault, in their order."""
        chain = fields.chain
        if fault is None or chain.fault_part is None:
            return []
        port, s = chain.fault_part, self.s
        piece = chain.pieces_before(port)
        stretch = chain.stretch_factor
        if fault.kind == "open":
            return [stretch * density[piece - 1]]
        if fault.kind in ("short", "bad_splice"):
            place = stretch * (density[piece - 1] - density[piece])
            if fault.kind == "short":
                return [place, np.square(fields.voltage[port]) / fault.values[1] ** 2]
            square = np.square(fields.current[port])
            return [place, square, square * s * NANO]
        if fault.kind == "loose_connector":
            square = np.square(fields.current[port])
            return [square, square * s * NANO]
        part = chain.parts[port]
        assert isinstance(part, Piece)
        z, d = by_impedance[piece], by_length[piece]
        if fault.kind == "water_ingress":
            fraction = (0.5 * (d - z)) / part.wave.shunt
            wet = s * self.consist.runs[part.run].cable.capacitance_f_per_m
            place = stretch * (density[piece - 1] - density[piece + 1])
            length = stretch * (density[piece] - density[piece + 1])
            return [place, length, fraction * wet, fraction * MICRO]
        half = 0.5 * (z + d)
        resistance, skin = half * part.wave.resistive_fraction, half * part.wave.skin_fraction
        if fault.kind == "wrong_cable":
            return [z, d, resistance, skin]
        return [z, resistance + skin]

    def _chain(self, deviations: FloatArray, fault: FaultGuess | None) -> Chain:
        return build_chain(self.consist, self._waves, self._node, deviations, fault, self.runs)

    def _reflection(self, voltage: ComplexArray, current: ComplexArray) -> ComplexArray:
        drop = self.instrument.reference_ohm * current
        return np.asarray((voltage - drop) / (voltage + drop))

    def _shifted(self, reflection: ComplexArray, deviations: FloatArray) -> ComplexArray:
        """Times the incident spectrum, and off in time by the trigger."""
        response = reflection * self._incident
        trigger = self.consist.tolerances.trigger_s * deviations[6]
        if trigger:
            response *= np.exp(self.s * trigger)
        return response

    def _shown(self, wave: FloatArray, deviations: FloatArray) -> FloatArray:
        """What an instrument with an error of gain and offset makes of it."""
        t = self.consist.tolerances
        return np.asarray((1 + t.gain * deviations[4]) * wave + t.offset * deviations[5])
