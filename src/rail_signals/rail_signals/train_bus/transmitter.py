"""A bus transmitter on the loads of its type test, without any cable.

Choi, Lee and Lim (S2, section 3.1 and Fig 4), after IEC 61375: the transmitter is measured open,
where only its own terminator Rt loads it; with a resistor beside the terminator, so that both
are 0.42 Rt; on the idle circuit, 27 ohm and 1.3 nF in series in place of 860 m of cable; and
shorted through a current meter. The transmitter is a source of Manchester pulses behind a
resistance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal import lfilter

from rail_signals.arrays import FloatArray

from .bus_line import Termination

BIT_RATE_HZ = 1e6
"""Bits per second of the bus."""

LOADS = ("open", "resistive", "idle", "short")
"""The tests of Fig 4."""


@dataclass(frozen=True)
class TestLoads:
    """Loads of Fig 4 as the transmitter sees them, its own terminator included.

    Parameters
    ----------
    terminator_ohm
        Terminator Rt [ohm].
    resistive_fraction
        Terminator and resistor together, over Rt.
    idle_ohm, idle_f
        Resistor [ohm] and capacitor [F] in series, in place of the terminator.
    idle_ohm_tolerance, idle_f_tolerance
        What these may be off, relative.
    """

    __test__ = False  # not a class of tests

    terminator_ohm: float = 120.0
    resistive_fraction: float = 0.42
    idle_ohm: float = 27.0
    idle_f: float = 1.3e-9
    idle_ohm_tolerance: float = 0.01
    idle_f_tolerance: float = 0.10

    def __post_init__(self) -> None:
        """Validate."""
        for name in ("terminator_ohm", "idle_ohm", "idle_f"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be above 0, got {value!r}")
        if not 0 < self.resistive_fraction < 1:
            raise ValueError(f"resistive_share must be below 1, got {self.resistive_fraction!r}")

    @property
    def external_ohm(self) -> float:
        """Resistor that beside the terminator makes the resistive load [ohm]."""
        return self.terminator_ohm * self.resistive_fraction / (1 - self.resistive_fraction)

    @property
    def idle_time_constant_s(self) -> float:
        """Time constant of the idle circuit by itself [s]."""
        return self.idle_ohm * self.idle_f

    def load(self, test: str) -> Termination:
        """Load of a test, one of `LOADS`.

        Examples
        --------
        >>> round(TestLoads().load("resistive").resistance_ohm, 1)
        50.4
        """
        if test == "open":
            return Termination(self.terminator_ohm)
        if test == "resistive":
            return Termination(self.terminator_ohm * self.resistive_fraction)
        if test == "idle":
            return Termination(self.idle_ohm, self.idle_f)
        if test == "short":
            return Termination(0.0)
        raise ValueError(f"test must be one of {LOADS}, got {test!r}")


@dataclass(frozen=True)
class Transmitter:
    """A source of Manchester pulses behind a resistance.

    Parameters
    ----------
    voltage_v
        Source voltage of either sign [V].
    source_ohm
        Source resistance [ohm].
    edge_s
        Time in which the source swings from one sign to the other [s].
    bit_rate_hz
        Bit rate [1/s].
    """

    voltage_v: float = 5.5
    source_ohm: float = 30.0
    edge_s: float = 60e-9
    bit_rate_hz: float = BIT_RATE_HZ
    loads: TestLoads = field(default_factory=TestLoads)

    def __post_init__(self) -> None:
        """Validate."""
        for name in ("voltage_v", "source_ohm", "edge_s", "bit_rate_hz"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be above 0, got {value!r}")
        if self.edge_s >= 0.5 / self.bit_rate_hz:
            raise ValueError(f"edge_s must be shorter than half a bit, got {self.edge_s!r}")

    def source_wave(self, bits: ArrayLike, sample_rate_hz: float) -> tuple[FloatArray, FloatArray]:
        """Time [s] and source voltage [V] of a frame.

        Parameters
        ----------
        bits : bool [bits]
            The frame; a one falls in the middle of its bit, a zero rises there.
        sample_rate_hz
            Sample rate [Hz].

        Returns
        -------
        time_s, voltage_v : float64 [samples]
        """
        frame = np.asarray(bits, dtype=np.bool_)
        if frame.ndim != 1 or not len(frame):
            raise ValueError(f"bits must be one row of bits, got shape {frame.shape}")
        halves = np.where(frame, 1.0, -1.0)[:, None] * np.array([1.0, -1.0])
        levels = np.concatenate([[0.0], halves.ravel(), [0.0]])
        half_s = 0.5 / self.bit_rate_hz
        time = np.arange(round((len(levels) * half_s) * sample_rate_hz)) / sample_rate_hz
        # Each boundary k is a ramp around its time: its middle is where the bit clock says.
        bounds = half_s * np.arange(1, len(levels))
        knots = np.stack([bounds - self.edge_s / 2, bounds + self.edge_s / 2], axis=1).ravel()
        values = np.stack([levels[:-1], levels[1:]], axis=1).ravel()
        return time, self.voltage_v * np.interp(time, knots, values)

    def output_wave(
        self, bits: ArrayLike, test: str, sample_rate_hz: float = 200e6
    ) -> tuple[FloatArray, FloatArray]:
        """Time [s] and output voltage [V] on a load of `LOADS`.

        On the idle circuit the capacitor charges through both resistances; between samples the
        source is a straight line, for which the recursion is exact.
        """
        time, source = self.source_wave(bits, sample_rate_hz)
        load = self.loads.load(test)
        total = load.resistance_ohm + self.source_ohm
        if math.isinf(load.capacitance_f):
            return time, source * (load.resistance_ohm / total)
        step = 1 / (sample_rate_hz * total * load.capacitance_f)
        keep = math.exp(-step)
        new = 1 - (1 - keep) / step
        old = (1 - keep) / step - keep
        held = lfilter([new, old], [1.0, -keep], source)
        return time, (source * load.resistance_ohm + held * self.source_ohm) / total

    @property
    def short_circuit_a(self) -> float:
        """Current into a short [A]."""
        return self.voltage_v / self.source_ohm


def manchester_bits(voltage_v: ArrayLike, samples_per_bit: float, first: float) -> FloatArray:
    """Bits of a wave by the sign of its first halves less that of its second: bool [bits].

    Parameters
    ----------
    voltage_v : [samples]
        The wave.
    samples_per_bit
        Length of a bit in samples.
    first
        Sample at which the first bit begins.
    """
    wave = np.asarray(voltage_v, dtype=np.float64)
    count = int((len(wave) - first) / samples_per_bit + 0.25)
    quarter = first + samples_per_bit * (np.arange(count) + 0.25)
    early = np.interp(quarter, np.arange(len(wave)), wave)
    late = np.interp(quarter + samples_per_bit / 2, np.arange(len(wave)), wave)
    return np.asarray(early > late)
