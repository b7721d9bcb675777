"""The impedance of real cable along its length: a stationary process.

A cable whose mean impedance is right still is rough: its logarithm wanders about the mean with
a standard deviation s and the correlation ``exp(-|x| / l)``. It is drawn metre by metre, as an
autoregression.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from rail_signals.arrays import FloatArray

from .bus_line import BusLine, CableSection, Element
from .consist import Consist

STEP_M = 1.0
"""Length over which the impedance counts as constant [m]."""


def draw_roughness(consist: Consist, rng: np.random.Generator) -> FloatArray:
    """Logarithm of the impedance over its mean for every metre of a train: [metres]."""
    count = math.ceil(consist.length_m / STEP_M) + 1
    t = consist.tolerances
    keep = math.exp(-STEP_M / t.roughness_length_m)
    drive = math.sqrt(1 - keep**2) * rng.standard_normal(count)
    drive[0] /= math.sqrt(1 - keep**2)
    return np.asarray(t.roughness * lfilter([1.0], [1.0, -keep], drive))


def roughened(bus_line: BusLine, rough: FloatArray) -> BusLine:
    """A line whose sections follow a drawn roughness.

    Parameters
    ----------
    bus_line
        The line.
    rough : float64 [metres]
        Logarithm of the impedance over its mean, from the head on; the last goes on.
    """
    if not rough.any():
        return bus_line
    elements: list[Element] = []
    start = 0.0
    for element in bus_line.elements:
        if not isinstance(element, CableSection):
            elements.append(element)
            continue
        end = start + element.length_m
        place = start
        while place < end - 1e-9:
            metre = math.floor(place / STEP_M + 1e-9)
            stop = min((metre + 1) * STEP_M, end)
            factor = math.exp(float(rough[min(metre, len(rough) - 1)]))
            elements.append(
                replace(
                    element,
                    length_m=stop - place,
                    impedance_factor=element.impedance_factor * factor,
                )
            )
            place = stop
        start = end
    return BusLine(tuple(elements), bus_line.termination)
