"""The bus cable of one train as a medium: frames from end to end, and what a reflectometer sees.

A frame is carried by the transfer function H of the line as built, with its fault as it is in
the tick (`rail_signals.train_bus.cascade`). Source and load are its terminators, so that the way
back has, by reciprocity,

    H_back = H Z_source / Z_load.

What the reflectometer sends, sampled, comes back times the reflection of the head. Numerical
Laplace transform: the samples are damped by ``exp(-c t)`` before the transform and the answer
is lifted after it, so that nothing folds back from beyond the window
(`rail_signals.train_bus.tdr.response`).

The cables are rough, their impedance differs a little from metre to metre. The reflectometer sees
that; frames, whose waves are some 50 m long and more, do not, and are spared the computation.

Frames and measurement share a tick, not a moment: the reflectometer sends between the frames
and takes some microseconds. White noise is added to all that arrives; a shield that floats lets
in more of it.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import fft
from scipy.special import erfc

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.bus_line import BusLine
from rail_signals.train_bus.cable import Cable
from rail_signals.train_bus.cascade import reflection_at, transfer
from rail_signals.train_bus.consist import Consist, Deviations
from rail_signals.train_bus.faults import BusFault, MissingShieldGround
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.roughness import draw_roughness, roughened
from rail_signals.train_bus.tdr.response import TimeGrid
from rail_signals.train_bus.train import train_consist
from rail_world.track_code.noise import RealNoiseSource

from .description import BusDescription, TrainBus
from .fault_growth import contact, fault_of, grown

#: Responses kept: those of the fault as it is, and of a contact that is not firm.
_MOST_KEPT: Final = 64
#: Stages of the noise; those of the rails are below.
_TO_TAIL, _TO_HEAD, _TRACES, _CONTACTS = 11, 12, 13, 14
#: Normal numbers for the contacts in a tick: one for the frames, one for each trace.
_MOST_TRACES: Final = 64
#: Fraction of the sample rate that the reflectometer's sampler lets through, and its slope.
_PASSED, _TAPER = 0.44, 0.02


@dataclass(frozen=True)
class Arrivals:
    """What a frame becomes: samples [V], and energy of a bit over the noise density."""

    samples: FloatArray
    ebn0: float


class BusMedium:
    """One train's bus.

    Parameters
    ----------
    bus
        What all trains share.
    train
        The train.
    consist
        Its drawing.
    seed, index
        Of the draws; the number of the train among those with a bus.
    cable
        What ``wrong_cable`` puts in.
    """

    def __init__(
        self,
        bus: BusDescription,
        train: TrainBus,
        consist: Consist,
        seed: int,
        index: int,
        cable: Cable | None = None,
    ) -> None:
        self._bus, self._fault, self._index, self._seed = bus, train.fault, index, seed
        self._cable = cable
        self._consist = consist
        bits = np.random.Philox(np.random.SeedSequence([seed, 6, index]))
        rng = np.random.Generator(bits)
        deviations = Deviations.draw(len(consist.runs), rng)
        self._rough = draw_roughness(consist, rng)
        self._line = consist.bus_line(deviations)
        tolerances = consist.tolerances
        self._gain = 1.0 + tolerances.gain * deviations.gain
        self._offset = tolerances.offset * deviations.offset
        self._trigger_s = tolerances.trigger_s * deviations.trigger
        load_ohm = self._line.termination.resistance_ohm
        self._return_factor = bus.source_ohm / load_ohm if math.isfinite(load_ohm) else 1.0
        self._kept: OrderedDict[Hashable, ComplexArray] = OrderedDict()
        self._noise: dict[int, RealNoiseSource] = {}
        self._contacts = RealNoiseSource(seed, 1 + _MOST_TRACES)

    @property
    def bus_line(self) -> BusLine:
        """The line as built, without its fault."""
        return self._line

    def grown(self, time_s: float) -> float:
        """Fraction of its size that the fault has, 0 where there is none."""
        return 0.0 if self._fault is None else grown(self._fault, time_s)

    def fault(self, time_s: float, normal: float = 0.0) -> BusFault | None:
        """The fault at a time; a contact as a standard normal number has it."""
        if self._fault is None:
            return None
        factor = contact(self._fault.spread, normal) if self._fault.spread else 1.0
        return fault_of(self._fault, self.grown(time_s), factor, self._cable)

    def carry(self, tick: int, time_s: float, sent: FloatArray, *, to_tail: bool) -> Arrivals:
        """A frame at the other end.

        Parameters
        ----------
        tick, time_s
            Number of the tick and its simulated time [s].
        sent : float64 [samples]
            Levels of the driver, 1 being its level.
        to_tail
            Whether the head has sent it.
        """
        bus = self._bus
        fault = self.fault(time_s, self._normals(tick)[0])
        count = len(sent) + bus.guard_samples
        length = int(fft.next_fast_len(count + bus.tail_samples, real=True))
        clean = fft.irfft(fft.rfft(sent, length) * self._transfer(fault, length), length)[:count]
        clean *= bus.level_v * (1.0 if to_tail else self._return_factor)
        sigma_v = bus.noise_v * _noise_factor(fault)
        stage = _TO_TAIL if to_tail else _TO_HEAD
        noise = self._source(count).blocks(stage, [self._index], tick)[0]
        energy = float(clean @ clean) * bus.samples_per_bit / max(len(sent), 1)
        ebn0 = energy / (2.0 * sigma_v**2) if sigma_v > 0.0 else math.inf
        return Arrivals(clean + sigma_v * noise, ebn0)

    def reflect(
        self, tick: int, time_s: float, sent: FloatArray, sample_rate_hz: float
    ) -> FloatArray:
        """What the reflectometer sees of what it sends, over the same size.

        Parameters
        ----------
        tick, time_s
            Number of the tick and its simulated time [s].
        sent : float64 [traces, samples]
            What it sends into the line, one trace after the other.
        sample_rate_hz
            Of these samples.

        Returns
        -------
        float64 [traces, samples]
        """
        bus = self._bus
        traces, samples = sent.shape
        if traces > _MOST_TRACES:
            raise ValueError(f"a tick has room for {_MOST_TRACES} traces, got {traces}")
        grid = TimeGrid(samples, 1.0 / sample_rate_hz)
        s = grid.laplace_axis()
        normals = self._normals(tick)[1:]
        seen = np.empty(sent.shape)
        faults = [self.fault(time_s, normal) for normal in normals[:traces]]
        # What is sent more than once is transformed once.
        last: tuple[FloatArray, ComplexArray] | None = None
        for row, fault in zip(range(traces), faults, strict=True):
            if last is None or not np.array_equal(last[0], sent[row]):
                last = (sent[row], self._incident(sent[row], grid, s))
            seen[row] = grid.to_time(last[1] * self._reflection(fault, grid, s))
        seen *= self._gain
        seen += self._offset
        noise = self._source(samples).blocks(
            _TRACES, [self._index * _MOST_TRACES + row for row in range(traces)], tick
        )
        factors = np.array([_noise_factor(fault) for fault in faults])
        seen += bus.reflectometer_noise * factors[:, None] * noise
        return seen

    def _incident(self, sent: FloatArray, grid: TimeGrid, s: ComplexArray) -> ComplexArray:
        """Transform of what enters the line; it goes on as it is at the end of the window."""
        length = grid.transform_length
        whole = np.pad(sent, (0, length - len(sent)), mode="edge")
        step = grid.damping_per_s * grid.sample_period_s
        whole *= np.exp(-step * np.arange(length)) * grid.sample_period_s
        # Its sampler lets nothing through near half its rate: what rings there would fold back.
        fraction = np.arange(length // 2 + 1) / length
        passed = 0.5 * erfc((fraction - _PASSED) / _TAPER)
        return np.asarray(fft.rfft(whole) * passed * np.exp(s * self._trigger_s))

    def _normals(self, tick: int) -> FloatArray:
        """Standard normal numbers of the contacts in a tick."""
        if self._fault is None or not self._fault.spread:
            return np.zeros(1 + _MOST_TRACES)
        return np.asarray(self._contacts.blocks(_CONTACTS, [self._index], tick)[0], np.float64)

    def _source(self, samples: int) -> RealNoiseSource:
        if samples not in self._noise:
            self._noise[samples] = RealNoiseSource(self._seed, samples)
        return self._noise[samples]

    def _faulty(self, fault: BusFault | None) -> BusLine:
        return self._line if fault is None else fault.apply(self._line)

    def _transfer(self, fault: BusFault | None, length: int) -> ComplexArray:
        """Transfer function from end to end on the axis of a transform."""
        key = ("transfer", length, fault)
        if key not in self._kept:
            bus = self._bus
            frequency_hz = np.arange(length // 2 + 1) * (bus.sample_rate_hz / length)
            # A line without leakage has no answer at 0 Hz, and a frame has nothing there.
            frequency_hz[0] = 1e-3 * frequency_hz[1]
            if fault is not None and fault.kind == "open":
                return self._keep(key, np.zeros(len(frequency_hz), dtype=np.complex128))
            bus_line = self._faulty(fault)
            return self._keep(key, transfer(bus_line, frequency_hz, bus.source_ohm)[-1])
        self._kept.move_to_end(key)
        return self._kept[key]

    def _reflection(self, fault: BusFault | None, grid: TimeGrid, s: ComplexArray) -> ComplexArray:
        key = ("reflection", grid, fault)
        if key not in self._kept:
            bus_line = roughened(self._faulty(fault), self._rough)
            return self._keep(key, reflection_at(bus_line, s, self._bus.reference_ohm))
        self._kept.move_to_end(key)
        return self._kept[key]

    def _keep(self, key: Hashable, value: ComplexArray) -> ComplexArray:
        self._kept[key] = value
        while len(self._kept) > _MOST_KEPT:
            self._kept.popitem(last=False)
        return value


def _noise_factor(fault: BusFault | None) -> float:
    return fault.noise_factor if isinstance(fault, MissingShieldGround) else 1.0


def bus_media(bus: BusDescription, seed: int) -> dict[str, BusMedium]:
    """The media of all trains by name."""
    media = {}
    for index, train in enumerate(bus.trains):
        fault = train.fault
        other = fault.profile if fault is not None else ""
        cable = load_bus_profile(other).cable if other else None
        media[train.train] = BusMedium(bus, train, train_consist(train.cars), seed, index, cable)
    return media
