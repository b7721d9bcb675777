"""Random trains with one fault anywhere, and what an interpretation makes of them.

The ranges below are what is asked of the interpretation. The smallest faults of each kind are
chosen so that they matter in service, not so that they are easy: 2 ohm in a splice is a hundred
times a good contact, and takes 0.07 dB.

=======================  =======================================================
train                    2 to 18 cars of 47 m or 27 m of cable (5 % either way),
                         at most 860 m, one of four kinds of cable, a node with
                         a stub of 0.1 to 1 m in every car
open                     anywhere, half a metre from the ends of its run
short                    0 to 5 ohm
water ingress            2 to 15 m (at most half the run), capacitance 15 to
                         60 % up, 0 to 5 uS/m
bad splice               2 to 30 ohm, 20 to 200 nH
wrong cable              of ten kinds, more than 7 % off in impedance or 5 % in
                         velocity
missing shield ground    impedance 6 to 30 % and resistance 10 to 50 % up, noise
                         1.3 to 4 times as strong
loose connector          2 to 50 ohm in the middle, another one in each trace
                         (by a factor of exp(0.3) to exp(1), one standard
                         deviation), 10 to 100 nH
=======================  =======================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.train_bus.bus_line import CableSection, Coupler, Stub, Termination
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import CarRun, Consist, Deviations, Tolerances
from rail_signals.train_bus.faults import (
    KINDS,
    BadSplice,
    BusFault,
    LooseConnector,
    MissingShieldGround,
    OpenCircuit,
    ShortCircuit,
    WaterIngress,
    WrongCable,
    place_of,
)
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.tdr.interpretation import Interpretation, interpret
from rail_signals.train_bus.tdr.reflectometer import Reflectometer, measure_consist

HEALTHY = "healthy"
"""Name of the trains without a fault."""

TRACES = 4
"""Traces taken of every train."""

LONGEST_M = 860.0
"""Longest bus [m]."""

_PROFILES = ("wtb", "example", "polyethylene", "cm2")
_EDGE_M = 0.5

#: Impedance [ohm], velocity factor, loop resistance [ohm/m], skin factor.
_OTHER_CABLES = (
    (50.0, 0.66, 0.040, 2.2e-4),
    (75.0, 0.66, 0.040, 2.2e-4),
    (78.0, 0.66, 0.060, 2.5e-4),
    (100.0, 0.66, 0.180, 3.3e-4),
    (100.0, 0.72, 0.180, 3.3e-4),
    (110.0, 0.70, 0.100, 3.0e-4),
    (120.0, 0.428, 0.0534, 2.7e-4),
    (120.0, 0.66, 0.0534, 2.7e-4),
    (135.0, 0.72, 0.080, 2.8e-4),
    (150.0, 0.78, 0.080, 2.6e-4),
)


@dataclass(frozen=True)
class Case:
    """One train.

    Parameters
    ----------
    kind
        Kind of its fault, or `HEALTHY`.
    consist, deviations
        As drawn, and how far it is off.
    instrument
        The reflectometer.
    fault
        The fault; None if healthy.
    """

    kind: str
    consist: Consist
    deviations: Deviations
    instrument: Reflectometer
    fault: BusFault | None


@dataclass(frozen=True)
class CaseResult:
    """What the interpretation made of a case.

    Parameters
    ----------
    reported
        Kind reported, or `HEALTHY`.
    error_m
        Error of the place [m]; not a number where nothing was reported.
    is_located
        Whether that is within 0.5 m or 1 % of the length of the bus.
    interpretation
        The whole of it.
    """

    reported: str
    error_m: float
    is_located: bool
    interpretation: Interpretation


def draw_case(
    kind: str,
    rng: np.random.Generator,
    snr_db: float = 60.0,
    tolerances: Tolerances | None = None,
) -> Case:
    """Draw a train and a fault of a kind.

    Parameters
    ----------
    kind
        One of `bus_faults.KINDS`, or `HEALTHY`.
    rng
        Where it is drawn from.
    snr_db
        Signal-to-noise ratio of one trace [dB].
    tolerances
        Of the train; by default those of `Tolerances`.
    """
    consist = draw_consist(rng, tolerances)
    fault = None if kind == HEALTHY else draw_fault(kind, consist, rng)
    deviations = Deviations.draw(len(consist.runs), rng)
    instrument = Reflectometer.with_snr(snr_db, consist.termination.resistance_ohm)
    return Case(kind, consist, deviations, instrument, fault)


def draw_consist(rng: np.random.Generator, tolerances: Tolerances | None = None) -> Consist:
    """Draw a train."""
    cable = load_bus_profile(_PROFILES[rng.integers(len(_PROFILES))]).cable
    cars = int(rng.integers(2, 19))
    runs: list[CarRun] = []
    for _ in range(cars):
        length = float((47.0, 27.0)[rng.integers(2)] * rng.uniform(0.95, 1.05))
        if sum(run.length_m for run in runs) + length <= LONGEST_M:
            runs.append(CarRun(cable, length))
    node = Stub(CableSection(cable, float(rng.uniform(0.1, 1.0))), Termination(10e3), 30e-12)
    coupler = Coupler(0.02, 80e-9, 10e-12)
    load = Termination(cable.impedance_ohm)
    return Consist(tuple(runs), node, coupler, load, tolerances or Tolerances())


def draw_fault(kind: str, consist: Consist, rng: np.random.Generator) -> BusFault:
    """Draw a fault of a kind, anywhere in a train."""
    cars = len(consist.runs)
    car = int(rng.integers(cars))
    start, length = float(consist.starts_m[car]), consist.runs[car].length_m
    place = start + float(rng.uniform(_EDGE_M, length - _EDGE_M))
    if kind == "open":
        return OpenCircuit(place)
    if kind == "short":
        return ShortCircuit(place, float(rng.uniform(0.0, 5.0)))
    if kind == "water_ingress":
        wet = float(rng.uniform(2.0, min(15.0, length / 2)))
        place = start + float(rng.uniform(_EDGE_M, length - _EDGE_M - wet))
        rise, leak = float(rng.uniform(0.15, 0.6)), float(rng.uniform(0.0, 5e-6))
        return WaterIngress(place, wet, rise, leak)
    if kind == "bad_splice":
        return BadSplice(place, _log_uniform(rng, 2.0, 30.0), float(rng.uniform(20e-9, 200e-9)))
    if kind == "wrong_cable":
        return WrongCable(car, _draw_other(consist.runs[car].cable, rng))
    if kind == "missing_shield_ground":
        rise, loss, noise = rng.uniform([0.06, 0.1, 1.3], [0.3, 0.5, 4.0]).tolist()
        return MissingShieldGround(car, rise, loss, noise)
    if kind == "loose_connector":
        resistance = _log_uniform(rng, 2.0, 50.0)
        inductance, spread = rng.uniform([10e-9, 0.3], [100e-9, 1.0]).tolist()
        return LooseConnector(int(rng.integers(cars - 1)), resistance, inductance, spread)
    raise ValueError(f"kind must be one of {KINDS}, got {kind!r}")


def examine(case: Case, rng: np.random.Generator, traces: int = TRACES) -> CaseResult:
    """Take the traces of a case and interpret them."""
    reflectogram = measure_consist(
        case.consist, case.deviations, case.instrument, rng, traces, case.fault
    )
    interpretation = interpret(reflectogram, case.consist, case.instrument)
    if interpretation.finding is None:
        return CaseResult(HEALTHY, math.nan, False, interpretation)
    error = math.nan
    if case.fault is not None:
        error = interpretation.finding.place_m - place_of(case.fault, case.consist.bus_line())
    allowed = max(0.5, 0.01 * case.consist.length_m)
    return CaseResult(interpretation.finding.kind, error, abs(error) <= allowed, interpretation)


def _draw_other(cable: Cable, rng: np.random.Generator) -> Cable:
    """Another kind of cable than the one that belongs there."""
    others = []
    for impedance, velocity, resistance, skin in _OTHER_CABLES:
        other = Cable.from_impedance(impedance, velocity, resistance, 0.0, skin)
        off = abs(other.impedance_ohm / cable.impedance_ohm - 1)
        faster = abs(other.velocity_m_per_s / cable.velocity_m_per_s - 1)
        if off > 0.07 or faster > 0.05:
            others.append(other)
    return others[rng.integers(len(others))]


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(float(rng.uniform(math.log(low), math.log(high))))
