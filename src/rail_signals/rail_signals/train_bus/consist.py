"""A whole train as a line: the bus from car to car, and how far each may be off its drawing.

Every car has a run of cable with a node at its far end; couplers join the cars; a terminator
ends the last. What manufacture and temperature change is drawn from normal distributions, cut
at three standard deviations. `Deviations` are in units of these: the vector that an
interpretation has to find beside a fault.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields, replace

import numpy as np

from rail_signals.arrays import FloatArray

from .bus_line import BusLine, CableSection, Coupler, Element, Stub, Termination
from .cable import Cable

CUT = 3.0
"""Standard deviations beyond which no part is delivered."""


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations, relative unless the name tells a unit.

    Parameters
    ----------
    impedance_batch, delay_batch
        Of impedance and delay of all cables together (one batch, one temperature).
    impedance, delay
        Of each run beside that; the delay is length over velocity.
    loss
        Of the resistance of all cables together.
    node_capacitance, coupler_inductance
        Of each node and each coupler.
    termination
        Of the terminator.
    gain, offset, trigger_s
        Of the reflectometer: scale and zero of the reflection, and time [s].
    roughness, roughness_length_m
        Of the impedance along a cable, and the length [m] over which it is correlated; a
        roughness of 0 is a smooth cable.
    """

    impedance_batch: float = 0.02
    delay_batch: float = 0.01
    impedance: float = 0.01
    delay: float = 0.004
    loss: float = 0.05
    node_capacitance: float = 0.1
    coupler_inductance: float = 0.15
    termination: float = 0.01
    gain: float = 0.003
    offset: float = 0.001
    trigger_s: float = 0.3e-9
    roughness: float = 0.003
    roughness_length_m: float = 3.0

    def __post_init__(self) -> None:
        """Validate."""
        for entry in fields(self):
            value = getattr(self, entry.name)
            least = 0.0 if entry.name == "roughness" else math.ulp(0.0)
            if not (math.isfinite(value) and value >= least):
                raise ValueError(f"{entry.name} must be finite and above 0, got {value!r}")


@dataclass(frozen=True)
class CarRun:
    """The bus in one car: its cable and its length along the cable [m]."""

    cable: Cable
    length_m: float


@dataclass(frozen=True)
class Consist:
    """Drawing of a train's bus.

    Parameters
    ----------
    runs
        One for each car, from the head.
    node
        The node at the far end of every run; None where none is coupled.
    coupler
        The coupler between two cars, behind the node.
    termination
        What ends the last car.
    tolerances
        How far everything may be off.
    """

    runs: tuple[CarRun, ...]
    node: Stub | None
    coupler: Coupler
    termination: Termination
    tolerances: Tolerances = field(default_factory=Tolerances)

    def __post_init__(self) -> None:
        """Coerce to a tuple; at least one car."""
        object.__setattr__(self, "runs", tuple(self.runs))
        if not self.runs:
            raise ValueError("runs must hold one car or more, got none")

    @property
    def length_m(self) -> float:
        """Length of the bus [m]."""
        return sum(run.length_m for run in self.runs)

    @property
    def starts_m(self) -> FloatArray:
        """Where each run begins, and the end [m]: [cars + 1]."""
        return np.concatenate([[0.0], np.cumsum([run.length_m for run in self.runs])])

    def bus_line(self, deviations: Deviations | None = None) -> BusLine:
        """The train as built, without what the instrument adds."""
        d = Deviations.none(len(self.runs)) if deviations is None else deviations
        t = self.tolerances
        loss = math.exp(t.loss * d.loss)
        elements: list[Element] = []
        for car, run in enumerate(self.runs):
            cable = replace(
                run.cable,
                resistance_ohm_per_m=run.cable.resistance_ohm_per_m * loss,
                skin_ohm_per_m_sqrt_hz=run.cable.skin_ohm_per_m_sqrt_hz * loss,
            )
            impedance = math.exp(
                t.impedance_batch * d.impedance_batch + t.impedance * d.impedance[car]
            )
            delay = math.exp(t.delay_batch * d.delay_batch + t.delay * d.delay[car])
            elements.append(CableSection(cable, run.length_m, impedance, delay))
            if self.node is not None:
                capacitance = self.node.capacitance_f * (1 + t.node_capacitance * d.node[car])
                elements.append(replace(self.node, capacitance_f=capacitance))
            if car < len(self.runs) - 1:
                inductance = self.coupler.inductance_h * (1 + t.coupler_inductance * d.coupler[car])
                elements.append(replace(self.coupler, inductance_h=inductance))
        load = self.termination
        if math.isfinite(load.resistance_ohm):
            resistance = load.resistance_ohm * math.exp(t.termination * d.termination)
            load = replace(load, resistance_ohm=resistance)
        return BusLine(tuple(elements), load)


@dataclass(frozen=True)
class Deviations:
    """How far a train and its reflectometer are off, in standard deviations.

    ``impedance``, ``delay`` and ``node`` have one entry per car, ``coupler`` one less.
    """

    impedance_batch: float
    delay_batch: float
    loss: float
    termination: float
    gain: float
    offset: float
    trigger: float
    impedance: FloatArray
    delay: FloatArray
    node: FloatArray
    coupler: FloatArray

    @classmethod
    def none(cls, cars: int) -> Deviations:
        """A train exactly as drawn."""
        return cls.from_vector(np.zeros(COMMON + 4 * cars - 1), cars)

    @classmethod
    def draw(cls, cars: int, rng: np.random.Generator) -> Deviations:
        """A train of independent normal deviations, cut at three."""
        count = COMMON + 4 * cars - 1
        values = rng.standard_normal(count)
        while (outside := np.abs(values) > CUT).any():
            values[outside] = rng.standard_normal(int(outside.sum()))
        return cls.from_vector(values, cars)

    @classmethod
    def from_vector(cls, values: FloatArray, cars: int) -> Deviations:
        """Deviations from one vector: the common ones, then those of each kind by car."""
        if values.shape != (COMMON + 4 * cars - 1,):
            raise ValueError(
                f"values must have {COMMON + 4 * cars - 1} entries, got shape {values.shape}"
            )
        common = dict(zip(_COMMON_NAMES, values[:COMMON].tolist(), strict=True))
        impedance, delay, node, coupler = np.split(values[COMMON:], [cars, 2 * cars, 3 * cars])
        return cls(**common, impedance=impedance, delay=delay, node=node, coupler=coupler)

    def to_vector(self) -> FloatArray:
        """All deviations in one vector: [7 + 4 cars - 1]."""
        common = [getattr(self, name) for name in _COMMON_NAMES]
        parts = (self.impedance, self.delay, self.node, self.coupler)
        return np.concatenate([common, *parts])


_COMMON_NAMES = tuple(entry.name for entry in fields(Deviations)[:7])

COMMON = len(_COMMON_NAMES)
"""Deviations that a train has once."""
