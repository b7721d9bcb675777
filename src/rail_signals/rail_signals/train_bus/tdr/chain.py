"""The parts of a train's line on one frequency axis, for given deviations and a supposed fault.

The same line as `Consist.bus_line` and the faults of `rail_signals.train_bus.faults` make it, but
with the spectra of each part at hand and with the fault's values free to be changed by a fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import COMMON, Consist

from .parts import MICRO, NANO, Chain, FaultGuess, Part, Piece, Series, Shunt, Waves


class _Node(Protocol):
    def admittance(self, extra_f: float) -> tuple[ComplexArray, ComplexArray]: ...


def build_chain(
    consist: Consist,
    waves: Waves,
    node: _Node | None,
    deviations: FloatArray,
    fault: FaultGuess | None,
    runs: int | None,
) -> Chain:
    """Parts of a train.

    Parameters
    ----------
    consist
        Its drawing.
    waves
        Spectra of cables.
    node
        Gives a node's admittance and its derivative, for a capacitance that is off.
    deviations : float64 [7 + 4 cars - 1]
        Vector of `Deviations`.
    fault
        A fault, or none; it must lie within the runs.
    runs
        Runs of cable, the last of which never ends; all, with the terminator, if None.
    """
    cars, t = len(consist.runs), consist.tolerances
    reached = cars if runs is None else min(runs, cars)
    loss = math.exp(t.loss * deviations[2])
    by_car = np.split(deviations[COMMON:], [cars, 2 * cars, 3 * cars])
    chain = Chain(reached=reached)
    for run in range(reached):
        cable, length_m = consist.runs[run].cable, consist.runs[run].length_m
        impedance = math.exp(t.impedance_batch * deviations[0] + t.impedance * by_car[0][run])
        delay = math.exp(t.delay_batch * deviations[1] + t.delay * by_car[1][run])
        here = fault if fault is not None and fault.index == run else None
        plain = Piece(waves.of(cable, loss, loss), impedance, length_m * delay, run)
        if here is None or here.kind == "loose_connector":
            chain.parts.append(plain)
        else:
            chain.stretch_factor = delay
            _FAULTY[here.kind](chain, plain, here.values, waves, cable, loss)
            if here.kind == "open":
                chain.load_ohm, chain.reached = math.inf, run + 1
                return chain
        if run == reached - 1 and runs is not None and runs < cars:
            return chain
        if node is not None and consist.node is not None:
            extra = consist.node.capacitance_f * t.node_capacitance * by_car[2][run]
            chain.parts.append(Shunt(*_swap(node.admittance(extra), run)))
        if run < cars - 1:
            _couple(chain, consist, waves, float(by_car[3][run]), run, here)
    chain.is_terminated = True
    resistance = consist.termination.resistance_ohm
    chain.load_ohm = resistance * math.exp(t.termination * deviations[3])
    return chain


def _swap(
    pair: tuple[ComplexArray, ComplexArray], run: int
) -> tuple[ComplexArray, int, ComplexArray]:
    return pair[0], run, pair[1]


def _couple(
    chain: Chain,
    consist: Consist,
    waves: Waves,
    deviation: float,
    number: int,
    fault: FaultGuess | None,
) -> None:
    """Append a coupler."""
    coupler, t = consist.coupler, consist.tolerances
    resistance = coupler.resistance_ohm
    inductance = coupler.inductance_h * (1 + t.coupler_inductance * deviation)
    if fault is not None and fault.kind == "loose_connector":
        resistance += float(fault.values[0])
        inductance += float(fault.values[1]) * NANO
        chain.fault_part = len(chain.parts)
    chain.parts.append(Series(resistance, inductance, number))
    if coupler.capacitance_f:
        chain.parts.append(Shunt(waves.s * coupler.capacitance_f, number))


def _open(chain: Chain, plain: Piece, values: FloatArray, *_: object) -> None:
    chain.parts.append(_part(plain, values[0] * chain.stretch_factor))
    chain.fault_part = len(chain.parts)


def _lumped(chain: Chain, plain: Piece, values: FloatArray, lump: Part) -> None:
    front = values[0] * chain.stretch_factor
    chain.fault_part = len(chain.parts) + 1
    chain.parts += [_part(plain, front), lump, _part(plain, plain.length_m - front)]


def _short(chain: Chain, plain: Piece, values: FloatArray, waves: Waves, *_: object) -> None:
    across = np.full_like(waves.s, 1 / float(values[1]))
    _lumped(chain, plain, values, Shunt(across, plain.run))


def _splice(chain: Chain, plain: Piece, values: FloatArray, *_: object) -> None:
    _lumped(chain, plain, values, Series(float(values[1]), float(values[2]) * NANO))


def _water(
    chain: Chain, plain: Piece, values: FloatArray, waves: Waves, cable: Cable, loss: float
) -> None:
    front, length = (float(v) * chain.stretch_factor for v in values[:2])
    wet = waves.make(cable, loss, loss, float(values[2]), float(values[3]) * MICRO)
    chain.fault_part = len(chain.parts) + 1
    chain.parts += [
        _part(plain, front),
        Piece(wet, plain.impedance_factor, length, plain.run),
        _part(plain, plain.length_m - front - length),
    ]


def _wrong(
    chain: Chain, plain: Piece, values: FloatArray, waves: Waves, cable: Cable, loss: float
) -> None:
    impedance, delay, resistance, skin = (math.exp(v) for v in values)
    chain.fault_part = len(chain.parts)
    wave = waves.of(cable, loss * resistance, loss * skin)
    factor = plain.impedance_factor * impedance
    chain.parts.append(Piece(wave, factor, plain.length_m * delay, plain.run))


def _floating(
    chain: Chain, plain: Piece, values: FloatArray, waves: Waves, cable: Cable, loss: float
) -> None:
    _wrong(chain, plain, np.array([values[0], 0.0, values[1], values[1]]), waves, cable, loss)


def _part(plain: Piece, length_m: float) -> Piece:
    return Piece(plain.wave, plain.impedance_factor, float(length_m), plain.run)


_FAULTY: dict[str, Callable[..., None]] = {
    "open": _open,
    "short": _short,
    "bad_splice": _splice,
    "water_ingress": _water,
    "wrong_cable": _wrong,
    "missing_shield_ground": _floating,
}
