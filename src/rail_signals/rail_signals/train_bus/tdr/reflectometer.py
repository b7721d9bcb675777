"""The reflectometer: sends a step or a pulse into a line and samples what comes back.

Choi, Lee and Lim (S2, section 3.2). A reflectogram is the reflected wave over the size of the
incident one: +1 far behind an open end, -1 behind a short, 0 where the line is matched. Its time
is 0 when the middle of the incident edge enters the line, so that a reflection from a distance d
has its middle at ``2 d / v``.

The window is as long as a wave needs to the far end and back, 15 % more for echoes between
faults and for tolerances, and 1 us for the tail of a last edge. Nothing folds into it: see
`rail_signals.train_bus.tdr.response`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.bus_line import BusLine
from rail_signals.train_bus.consist import Consist, Deviations
from rail_signals.train_bus.faults import BusFault, LooseConnector, MissingShieldGround
from rail_signals.train_bus.roughness import draw_roughness, roughened

from .response import SAMPLES_PER_RISE, Excitation, TimeGrid, lead_in_s, reflected_wave

_WINDOW_FRACTION = 1.15
_WINDOW_TAIL_S = 1e-6


@dataclass(frozen=True)
class Reflectometer:
    """An instrument.

    Parameters
    ----------
    reference_ohm
        Impedance of its output, against which reflections are told [ohm].
    rise_time_s
        Rise time of its edge, 10 to 90 % [s].
    sample_period_s
        Time between samples [s]; at most a quarter of the rise time.
    excitation
        ``step`` or ``pulse``.
    noise_rms
        Standard deviation of the noise of one sample of one trace, as a reflection
        coefficient. `snr_db` tells it as a ratio.
    """

    reference_ohm: float = 120.0
    rise_time_s: float = 20e-9
    sample_period_s: float = 5e-9
    excitation: Excitation = "step"
    noise_rms: float = 1e-3

    def __post_init__(self) -> None:
        """Validate."""
        for name in ("reference_ohm", "rise_time_s", "sample_period_s", "noise_rms"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and above 0, got {value!r}")
        if self.sample_period_s > self.rise_time_s / SAMPLES_PER_RISE * (1 + 1e-9):
            raise ValueError(
                f"sample_period_s must be at most a quarter of rise_time_s,"
                f" got {self.sample_period_s!r}"
            )

    @property
    def snr_db(self) -> float:
        """Incident step over the noise of one sample [dB]."""
        return -20 * math.log10(self.noise_rms)

    @classmethod
    def with_snr(cls, snr_db: float, reference_ohm: float = 120.0) -> Reflectometer:
        """An instrument of a given signal-to-noise ratio [dB], else as by default."""
        return cls(reference_ohm=reference_ohm, noise_rms=10 ** (-snr_db / 20))

    @property
    def start_s(self) -> float:
        """Time of the first sample [s]."""
        return -lead_in_s(self.rise_time_s)

    def samples_for(self, delay_s: float) -> int:
        """Samples of the window of a line through which a wave takes a given time."""
        window = 2 * delay_s * _WINDOW_FRACTION + _WINDOW_TAIL_S - self.start_s
        return math.ceil(window / self.sample_period_s)

    def grid(self, samples: int, start_s: float | None = None) -> TimeGrid:
        """The grid of a trace, which may start at another time [s] than the instrument's."""
        start = self.start_s if start_s is None else start_s
        return TimeGrid(samples, self.sample_period_s, start)


@dataclass(frozen=True)
class Reflectogram:
    """What a reflectometer shows.

    Parameters
    ----------
    time_s : float64 [samples]
        Time, evenly spaced [s].
    reflection : float64 [traces, samples]
        Reflected over incident wave, of traces taken one after the other.
    """

    time_s: FloatArray
    reflection: FloatArray

    def __post_init__(self) -> None:
        """Coerce to arrays, one trace to a row, and validate."""
        time = np.asarray(self.time_s, dtype=np.float64)
        rows = np.atleast_2d(np.asarray(self.reflection, dtype=np.float64))
        if time.ndim != 1 or rows.ndim != 2 or rows.shape[1] != len(time) or len(time) < 16:
            raise ValueError(
                f"reflection must be [traces, samples] of 16 samples or more beside time_s,"
                f" got {rows.shape} and {time.shape}"
            )
        if not (np.isfinite(time).all() and np.isfinite(rows).all()):
            raise ValueError("time_s and reflection must be finite")
        steps = np.diff(time)
        if steps[0] <= 0 or np.abs(steps - steps.mean()).max() > 1e-3 * steps.mean():
            raise ValueError("time_s must rise evenly")
        object.__setattr__(self, "time_s", time)
        object.__setattr__(self, "reflection", rows)

    @property
    def sample_period_s(self) -> float:
        """Time between samples [s]."""
        return float((self.time_s[-1] - self.time_s[0]) / (len(self.time_s) - 1))


def measure(
    bus_line: BusLine,
    instrument: Reflectometer,
    rng: np.random.Generator,
    traces: int = 1,
    fault: BusFault | None = None,
    samples: int | None = None,
) -> Reflectogram:
    """Reflectogram of a line, with or without a fault.

    A loose connector has another resistance in every trace, a missing shield ground raises
    the noise.

    Parameters
    ----------
    bus_line
        The line without the fault.
    instrument
        The reflectometer.
    rng
        Source of noise and of the resistances.
    traces
        How many to take.
    fault
        What is wrong with the line.
    samples
        Samples of each trace; by default the instrument's window for the line.
    """
    grid = instrument.grid(samples or instrument.samples_for(bus_line.delay_s))
    clean = np.stack([_wave(one, instrument, grid) for one in _lines(bus_line, fault, rng, traces)])
    factor = fault.noise_factor if isinstance(fault, MissingShieldGround) else 1.0
    noise = rng.standard_normal((traces, grid.samples))
    return Reflectogram(grid.time_s, clean + instrument.noise_rms * factor * noise)


def measure_consist(
    consist: Consist,
    deviations: Deviations,
    instrument: Reflectometer,
    rng: np.random.Generator,
    traces: int = 1,
    fault: BusFault | None = None,
) -> Reflectogram:
    """Reflectogram of a train as built, by an instrument that is off by its own deviations.

    The cables are rough: their impedance is drawn for every metre.
    """
    tolerances = consist.tolerances
    rough = draw_roughness(consist, rng)
    nominal = instrument.grid(instrument.samples_for(consist.bus_line().delay_s))
    # Twice the sample rate of the record: a transform of its own beside those of a fit.
    late = nominal.start_s + tolerances.trigger_s * deviations.trigger
    fine = TimeGrid(2 * nominal.samples, nominal.sample_period_s / 2, late)
    waves: dict[int, FloatArray] = {}
    lines = _lines(consist.bus_line(deviations), fault, rng, traces)
    for bus_line in lines:
        if id(bus_line) not in waves:
            waves[id(bus_line)] = _wave(roughened(bus_line, rough), instrument, fine)[::2]
    clean = np.stack([waves[id(bus_line)] for bus_line in lines])
    clean *= 1 + tolerances.gain * deviations.gain
    clean += tolerances.offset * deviations.offset
    factor = fault.noise_factor if isinstance(fault, MissingShieldGround) else 1.0
    noise = rng.standard_normal((traces, nominal.samples))
    return Reflectogram(nominal.time_s, clean + instrument.noise_rms * factor * noise)


def distance_m(time_s: ArrayLike, velocity_m_per_s: float) -> FloatArray:
    """Distance of what reflects at a time: half the way travelled [m]."""
    return np.asarray(np.asarray(time_s, dtype=np.float64) * velocity_m_per_s / 2)


def _lines(
    bus_line: BusLine, fault: BusFault | None, rng: np.random.Generator, traces: int
) -> list[BusLine]:
    """The line as each trace meets it."""
    if fault is None:
        return [bus_line] * traces
    if not isinstance(fault, LooseConnector) or fault.spread == 0:
        return [fault.apply(bus_line)] * traces
    factors = np.exp(fault.spread * rng.standard_normal(traces))
    return [
        replace(fault, resistance_ohm=fault.resistance_ohm * float(f)).apply(bus_line)
        for f in factors
    ]


def _wave(bus_line: BusLine, instrument: Reflectometer, grid: TimeGrid) -> FloatArray:
    return reflected_wave(
        bus_line, grid, instrument.reference_ohm, instrument.rise_time_s, instrument.excitation
    )
