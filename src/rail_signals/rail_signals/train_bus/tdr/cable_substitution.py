"""What a trace would be with another cable in one run, without solving the line again.

By the compensation theorem a part whose input impedance becomes Z' instead of Z changes the
reflection of the head by

    d Gamma = (R0 / 2) I^2 (Z' - Z) (Z_f + Z) / (Z_f + Z')

with the current I that flew into it and the impedance Z_f that it sees towards the head: exact,
however large the change.
"""

from __future__ import annotations

import math

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cascade import wave_exponential

from .backscatter import spread_s
from .fields import Fields
from .fit import Fit
from .model import TraceModel
from .parts import Chain, Piece
from .projection import Projection

_IMPEDANCES = (-1.0, -0.7, -0.45, -0.3, -0.2, -0.12, -0.06, 0.0, 0.06, 0.12, 0.2, 0.3, 0.45)
_FARTHEST = 0.66


class CableSubstitution:
    """Other cables in one run of a fitted train.

    Parameters
    ----------
    model, at
        The model, and its fit without fault.
    fields
        Of this fit.
    run
        Number of the run.
    """

    def __init__(self, model: TraceModel, at: Fit, fields: Fields, run: int) -> None:
        self._model = model
        self._unit = (1 + model.consist.tolerances.gain * at.deviations[4]) / at.sigma
        parts = fields.chain.parts
        port = next(k for k, p in enumerate(parts) if isinstance(p, Piece) and p.run == run)
        part = parts[port]
        assert isinstance(part, Piece)
        self._part = part
        self._impedance = part.wave.impedance * part.impedance_factor
        # As reflections: the load may be open.
        voltage, current = fields.voltage[port + 1], fields.current[port + 1]
        self._load_voltage, self._load_current = voltage, current
        self._own = fields.voltage[port] / fields.current[port]
        inward = Chain(parts=parts[:port][::-1], load_ohm=model.instrument.reference_ohm)
        self._front = model.impedance_of(inward)
        self._scale = np.square(fields.current[port]) * (self._front + self._own)
        self._decay = np.empty_like(model.s)

    def change(self, log_impedance: float, log_delay: float) -> FloatArray:
        """What another cable adds to the trace, over the noise: float64 [samples]."""
        return np.asarray(
            self._model.grid.to_time(self._spectrum(log_impedance, log_delay)) * self._unit
        )

    def changes(self, pairs: list[tuple[float, float]]) -> FloatArray:
        """The same of several pairs of logarithms: float64 [pairs, samples]."""
        spectra = np.stack([self._spectrum(*pair) for pair in pairs])
        return np.asarray(self._model.grid.to_time(spectra) * self._unit)

    def _spectrum(self, log_impedance: float, log_delay: float) -> ComplexArray:
        part = self._part
        length = 2 * part.length_m * math.exp(log_delay)
        decay = wave_exponential(part.wave.attenuation, part.wave.phase, length, self._decay)
        impedance = self._impedance * math.exp(log_impedance)
        drop = impedance * self._load_current
        echo = (self._load_voltage - drop) / (self._load_voltage + drop) * decay
        other = impedance * (1 + echo) / (1 - echo)
        return np.asarray(self._scale * (other - self._own) / (self._front + other))


def likely_substitutions(
    model: TraceModel, at: Fit, fields: Fields, projection: Projection, run: int
) -> list[tuple[float, float, float]]:
    """Cost, log impedance and log delay of other cables in a run, the best first.

    The impedance is sought in what comes back before the end of the run can, however fast the
    other cable is, then the delay with the two best.
    """
    swap = CableSubstitution(model, at, fields, run)
    consist = model.consist
    cable, length = consist.runs[run].cable, consist.runs[run].length_m
    soonest_m = float(consist.starts_m[run]) + length * math.exp(-_FARTHEST)
    end = 2 * soonest_m / cable.velocity_m_per_s
    instrument = model.instrument
    before = int((end - instrument.start_s) / instrument.sample_period_s)
    level = Projection(at, max(32, before))
    changes = swap.changes([(z, 0.0) for z in _IMPEDANCES])
    costs = level.costs(changes[:, : level.samples])
    best = [_IMPEDANCES[k] for k in np.argsort(costs)[:2]]
    if 0.0 not in best:
        best.append(0.0)
    # An echo that the line has spread needs no finer delays than half its own length.
    spread = spread_s(cable, float(consist.starts_m[run]), instrument.rise_time_s)
    step = max(0.02, spread * cable.velocity_m_per_s / (4 * length))
    delays = np.linspace(-_FARTHEST, _FARTHEST, 2 * math.ceil(_FARTHEST / step) + 1)
    pairs = [(z, float(d)) for z in best for d in delays]
    ranked = projection.costs(swap.changes(pairs))
    order = np.argsort(ranked)
    return [(float(ranked[k]), *pairs[k]) for k in order]
