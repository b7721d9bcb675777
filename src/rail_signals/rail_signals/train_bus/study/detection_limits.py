"""How small a fault can be and still be found: the limits of detection, by theory.

A fault of size q whose column is c has the statistic of `rail_signals.train_bus.tdr.fault_scan`
distributed as chi-square of two degrees of freedom and the noncentrality ``q^2 c' M c``, the
deviations and the backscatter taken out: found is what exceeds the threshold of a healthy train.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq
from scipy.stats import ncx2

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.consist import COMMON
from rail_signals.train_bus.faults import (
    BadSplice,
    BusFault,
    LooseConnector,
    WaterIngress,
    WrongCable,
)
from rail_signals.train_bus.tdr.fault_scan import alarm_threshold
from rail_signals.train_bus.tdr.interpretation import FALSE_ALARM_RATE
from rail_signals.train_bus.tdr.parts import FaultGuess
from rail_signals.train_bus.tdr.projection import Projection
from rail_signals.train_bus.tdr.sequential_fit import Windows

from .campaign import TRACES, Case

WET_M = 5.0
"""Length of the wet stretch whose capacitance is told [m]."""

_SIZES = {"bad_splice": 1, "water_ingress": 2, "wrong_cable": 0, "loose_connector": 0}


def detectable_size(
    case: Case,
    rng: np.random.Generator,
    fraction: float,
    false_alarm_rate: float = FALSE_ALARM_RATE,
) -> float:
    """Size of a fault that is found in a fraction of trains like this one, somewhere in it.

    Parameters
    ----------
    case
        The train; of its fault only the kind counts.
    rng
        Draws the place.
    fraction
        Probability of being found.
    false_alarm_rate
        Of the interpretation.

    Returns
    -------
    float
        Resistance [ohm] of a splice or a coupler, rise of the capacitance of 5 m, or share by
        which the impedance of a run is off.
    """
    threshold = alarm_threshold(case.consist, case.instrument.rise_time_s, false_alarm_rate)
    needed = float(brentq(lambda x: ncx2.sf(threshold, 2, x) - fraction, 1e-3, 500.0))
    column = _column(case, rng)
    return math.sqrt(needed / column)


def fault_of_size(case: Case, size: float, rng: np.random.Generator) -> BusFault:
    """A fault of the size that :func:`detectable_size` tells, somewhere in a train."""
    guess = _place(case, rng)
    place = float(case.consist.starts_m[guess.index])
    if case.kind == "bad_splice":
        return BadSplice(place + float(guess.values[0]), size)
    if case.kind == "water_ingress":
        return WaterIngress(place + float(guess.values[0]), WET_M, size)
    if case.kind == "loose_connector":
        return LooseConnector(guess.index, size)
    cable = case.consist.runs[guess.index].cable
    other = Cable(
        cable.inductance_h_per_m * (1 + size),
        cable.capacitance_f_per_m / (1 + size),
        cable.resistance_ohm_per_m,
        cable.conductance_s_per_m,
        cable.skin_ohm_per_m_sqrt_hz,
    )
    return WrongCable(guess.index, other)


def _column(case: Case, rng: np.random.Generator) -> float:
    """Squared length of what a fault of unit size adds, deviations taken out."""
    windows = Windows(
        case.consist,
        case.instrument,
        case.instrument.samples_for(case.consist.bus_line().delay_s),
    )
    cars = len(case.consist.runs)
    model = windows.model(cars)
    drawn = np.zeros(COMMON + 4 * cars - 1)
    guess = _place(case, rng)
    fault = model.predict(drawn, guess)
    sigma = case.instrument.noise_rms / math.sqrt(TRACES)
    at = windows.fit(model.trace(drawn), sigma, cars, drawn, steps=0)
    row: FloatArray = fault.fault_jacobian[_SIZES[case.kind]][None] / sigma
    matrix, _ = Projection(at).normal(row)
    return float(matrix[0, 0, 0])


def _place(case: Case, rng: np.random.Generator) -> FaultGuess:
    """A fault of no size in a place that is drawn."""
    consist = case.consist
    car = int(rng.integers(len(consist.runs)))
    inside = float(rng.uniform(0.5, consist.runs[car].length_m - 0.5 - WET_M))
    if case.kind == "bad_splice":
        return FaultGuess(case.kind, car, np.array([inside, 0.0, 0.0]))
    if case.kind == "water_ingress":
        return FaultGuess(case.kind, car, np.array([inside, WET_M, 0.0, 0.0]))
    if case.kind == "loose_connector":
        return FaultGuess(case.kind, min(car, len(consist.runs) - 2), np.zeros(2))
    if case.kind == "wrong_cable":
        return FaultGuess(case.kind, car, np.zeros(4))
    raise ValueError(f"kind must be one of {tuple(_SIZES)}, got {case.kind!r}")
