"""What each kind of fault may look like: the values of a supposed fault, their limits and priors.

A fit needs limits, so that no step leaves the line, and the choice between kinds needs the
ranges in which the values were expected beforehand: a kind with more values to choose explains
more, and has to explain better (`evidence` in `rail_signals.train_bus.tdr.fit`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import Consist
from rail_signals.train_bus.faults import (
    BadSplice,
    BusFault,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
)

from .parts import MICRO, NANO, FaultGuess

_EDGE_M = 0.01
_PLACE = "place_m"


@dataclass(frozen=True)
class Value:
    """One value of a fault.

    Parameters
    ----------
    name
        Its name and unit.
    low, high
        Limits of a fit.
    expected
        Width of the range in which it was expected beforehand.
    mean, sigma
        Normal prior for what a trace tells badly; infinite sigma is none.
    """

    name: str
    low: float
    high: float
    expected: float
    mean: float = 0.0
    sigma: float = math.inf


_RESISTANCE = Value("resistance_ohm", 0.0, 1e4, 60.0)
_INDUCTANCE = Value("inductance_nh", 0.0, 3000.0, 150.0, 50.0, 150.0)

VALUES: dict[str, tuple[Value, ...]] = {
    "open": (Value(_PLACE, 0.0, math.inf, 0.0),),
    "short": (
        Value(_PLACE, 0.0, math.inf, 0.0),
        Value("resistance_ohm", 0.02, 60.0, 10.0, 0.0, 10.0),
    ),
    "water_ingress": (
        Value(_PLACE, 0.0, math.inf, 0.0),
        Value("length_m", 0.2, math.inf, 15.0),
        Value("capacitance_rise", 0.0, 3.0, 0.6, 0.3, 0.5),
        Value("conductance_us_per_m", 0.0, 100.0, 10.0, 0.0, 10.0),
    ),
    "bad_splice": (
        Value(_PLACE, 0.0, math.inf, 0.0),
        Value("resistance_ohm", 0.0, 300.0, 60.0),
        _INDUCTANCE,
    ),
    "wrong_cable": (
        Value("log_impedance", -1.4, 0.9, 1.2),
        Value("log_delay", -0.8, 0.9, 1.0),
        Value("log_resistance", -2.0, 2.5, 2.0, 0.0, 0.8),
        Value("log_skin", -1.5, 1.5, 1.0, 0.0, 0.4),
    ),
    "missing_shield_ground": (
        Value("log_impedance", 0.0, 0.5, 0.35),
        Value("log_losses", -0.6, 1.0, 0.6, 0.2, 0.3),
    ),
    "loose_connector": (_RESISTANCE, _INDUCTANCE),
}
"""Values of each kind, in the order of `FaultGuess.values`."""

PLACED = ("open", "short", "water_ingress", "bad_splice")
"""Kinds that may lie anywhere within a run, their first value being the place."""


def clipped(consist: Consist, fault: FaultGuess) -> FaultGuess:
    """The fault with its values within their limits, and its place within its run."""
    entries = VALUES[fault.kind]
    values = np.clip(fault.values, [v.low for v in entries], [v.high for v in entries])
    if fault.kind in PLACED:
        room = consist.runs[fault.index].length_m - _EDGE_M
        if fault.kind == "water_ingress":
            values[1] = min(values[1], room - 2 * _EDGE_M)
            room -= values[1]
        values[0] = min(max(values[0], _EDGE_M), room)
    return FaultGuess(fault.kind, fault.index, values)


def prior_cost(fault: FaultGuess | None) -> float:
    """Squared distance of the values from their priors, in standard deviations."""
    if fault is None:
        return 0.0
    pairs = zip(VALUES[fault.kind], fault.values, strict=True)
    return sum(((float(x) - v.mean) / v.sigma) ** 2 for v, x in pairs)


def prior_gradient(fault: FaultGuess) -> tuple[FloatArray, FloatArray]:
    """Precision of the priors and their pull on the values: each [values]."""
    entries = VALUES[fault.kind]
    precision = np.array([1 / v.sigma**2 for v in entries])
    return precision, precision * (np.array([v.mean for v in entries]) - fault.values)


def log_expected_range(consist: Consist, kind: str) -> float:
    """Logarithm of the volume in which the values of a kind were expected, all places."""
    total = sum(math.log(v.expected) for v in VALUES[kind] if v.name != _PLACE)
    if kind in PLACED:
        return total + math.log(consist.length_m)
    if kind == "loose_connector":
        return total + math.log(max(1, len(consist.runs) - 1))
    return total + math.log(len(consist.runs))


def as_fault(
    consist: Consist, guess: FaultGuess, loss_factor: float = 1.0, noise_factor: float = 1.0
) -> BusFault:
    """The supposed fault as one that can be put into the line of the train.

    Parameters
    ----------
    consist
        Drawing of the train.
    guess
        The supposed fault.
    loss_factor
        Resistance of all cables of the train over that of the drawing.
    noise_factor
        Noise over that of the instrument, for a shield that floats.
    """
    v = [float(value) for value in guess.values]
    place = place_m(consist, guess)
    if guess.kind == "open":
        return OpenCircuit(place)
    if guess.kind == "short":
        return ShortCircuit(place, v[1])
    if guess.kind == "water_ingress":
        return WaterIngress(place, v[1], v[2], v[3] * MICRO)
    if guess.kind == "bad_splice":
        return BadSplice(place, v[1], v[2] * NANO)
    if guess.kind == "loose_connector":
        return LooseConnector(guess.index, v[0], v[1] * NANO)
    if guess.kind == "missing_shield_ground":
        rise, loss = math.exp(v[0]) - 1, math.exp(v[0] + v[1]) - 1
        return MissingShieldGround(guess.index, rise, loss, noise_factor)
    cable = consist.runs[guess.index].cable
    series, shunt = math.exp(v[0] + v[1]), math.exp(v[1] - v[0])
    other = Cable(
        cable.inductance_h_per_m * series,
        cable.capacitance_f_per_m * shunt,
        cable.resistance_ohm_per_m * loss_factor * series * math.exp(v[2]),
        cable.conductance_s_per_m * shunt,
        cable.skin_ohm_per_m_sqrt_hz * loss_factor * series * math.exp(v[3]),
    )
    return WrongCable(guess.index, other)


def place_m(consist: Consist, fault: FaultGuess) -> float:
    """Where a fault begins [m of cable from the head]."""
    starts = consist.starts_m
    if fault.kind in PLACED:
        return float(starts[fault.index] + fault.values[0])
    return float(starts[fault.index + 1 if fault.kind == "loose_connector" else fault.index])
