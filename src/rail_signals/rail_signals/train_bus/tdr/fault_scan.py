"""Where along a line a trace asks for something more: a matched filter for every place.

At each place of a grid a small resistance and a small inductance are put in series, or a
stretch of cable from there on is given more capacitance. What they would add to the trace
(`rail_signals.train_bus.tdr.model`) is correlated with what the fit has left, the deviations taken
out of both (`rail_signals.train_bus.tdr.projection`): the statistic of the generalised likelihood
ratio.

Lumped faults are nearly of this form even if they are large: by the compensation theorem an
impedance Z put in series acts as ``Z / (1 + Z / Z_loop)`` with ``Z_loop`` about twice the
characteristic impedance. An open tends to 2 Z0, a short to -2 Z0, and a change of impedance that
reflects rho to 2 Z0 rho.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import ComplexArray, FloatArray
from rail_signals.train_bus.cascade import wave_exponential
from rail_signals.train_bus.consist import COMMON, Consist

from .backscatter import resolution_m
from .fields import Fields
from .fit import Fit
from .model import TraceModel
from .parts import NANO, Piece
from .projection import Projection
from .response import RISE_PER_SIGMA

_LEAST_STEP_M = 1.0
_STEPS = 0.25

WET_LENGTHS_M = (2.0, 4.0, 7.0, 11.0, 16.0)
"""Lengths of wet stretches that are looked for [m]."""


@dataclass(frozen=True)
class FaultScan:
    """Statistics along the line.

    Parameters
    ----------
    place_m : float64 [places]
        Places [m from the head].
    statistic : float64 [places]
        Likelihood ratio of a resistance and an inductance there.
    resistance_ohm, inductance_h : float64 [places]
        Most likely values there, both signs allowed.
    run_statistic : float64 [runs]
        Likelihood ratio of another impedance and delay of a whole run.
    """

    place_m: FloatArray
    statistic: FloatArray
    resistance_ohm: FloatArray
    inductance_h: FloatArray
    run_statistic: FloatArray

    @property
    def largest(self) -> float:
        """Largest statistic of all."""
        runs = np.max(self.run_statistic, initial=0.0)
        return float(max(np.max(self.statistic, initial=0.0), runs))

    def peaks(self, count: int, apart_m: float, low_m: float = 0.0) -> list[int]:
        """Numbers of the places of the largest statistics that are not neighbours.

        Parameters
        ----------
        count
            At most so many.
        apart_m
            Least distance between two [m].
        low_m
            Only places from here on [m].
        """
        left = np.where(self.place_m >= low_m, self.statistic, -1.0)
        peaks: list[int] = []
        while len(peaks) < count and left.size and left.max() > 0:
            best = int(np.argmax(left))
            peaks.append(best)
            left[np.abs(self.place_m - self.place_m[best]) < apart_m] = -1.0
        return peaks


def alarm_threshold(consist: Consist, rise_time_s: float, false_alarm_rate: float) -> float:
    """Statistic that the scan of a healthy train exceeds at a given rate.

    At one place the statistic is chi-square of two degrees of freedom, above T with the
    probability ``exp(-T / 2)``. Along the line it crosses T upwards ``sqrt(T / 2 pi) w`` times
    as often in a metre (Davies, Biometrika 74:33, 1987), with w the root of the curvature of the
    correlation between neighbouring places: an edge of standard deviation d leaves a Gaussian of
    a resistance and its derivative of an inductance, ``1 / (d sqrt(2))`` and sqrt(3) times that,
    here their mean.

    Parameters
    ----------
    consist
        The train.
    rise_time_s
        Rise time of the incident edge [s].
    false_alarm_rate
        Fraction of healthy trains that may be flagged.

    Examples
    --------
    >>> from rail_signals.train_bus.train import train_consist
    >>> round(alarm_threshold(train_consist(("CM2",) * 4), 20e-9, 2e-3), 1)
    23.9
    """
    rate = (1 + math.sqrt(3)) / 2 / math.sqrt(2)
    places = sum(
        rate * run.length_m * RISE_PER_SIGMA / resolution_m(run.cable, float(middle), rise_time_s)
        for run, middle in zip(
            consist.runs, (consist.starts_m[:-1] + consist.starts_m[1:]) / 2, strict=True
        )
    )
    threshold = 20.0
    for _ in range(8):
        often = 1 + places * math.sqrt(threshold / (2 * math.pi))
        threshold = 2 * math.log(often / false_alarm_rate)
    return threshold


def scan_faults(
    model: TraceModel,
    at: Fit,
    fields: Fields,
    projection: Projection,
    high_m: float = np.inf,
) -> FaultScan:
    """Scan a line for lumped faults, and all its runs for other cable.

    Parameters
    ----------
    model, at
        The model, and its fit without fault.
    fields, projection
        Of this fit.
    high_m
        How far to scan [m from the head].
    """
    unit = (1 + model.consist.tolerances.gain * at.deviations[4]) / at.sigma
    places, squares, _ = place_squares(model, fields, 0.0, high_m)
    resistive = model.grid.to_time(squares) * unit
    inductive = model.grid.to_time(squares * (model.s * NANO)) * unit
    statistic, values = projection.likelihood_ratio(resistive, inductive)
    runs = _run_statistics(model, at, projection)
    return FaultScan(places, statistic, values[:, 0], values[:, 1] * NANO, runs)


def scan_water(
    model: TraceModel,
    at: Fit,
    fields: Fields,
    projection: Projection,
    low_m: float,
    high_m: float,
) -> list[tuple[float, float, float, float]]:
    """Most likely wet stretch of each length: statistic, place [m], length [m] and rise of C."""
    unit = (1 + model.consist.tolerances.gain * at.deviations[4]) / at.sigma
    cable = model.consist.runs[0].cable
    step_m = _step_m(model, low_m)
    places, _, squares = place_squares(model, fields, low_m, high_m, step_m)
    weight = -model.s * (cable.capacitance_f_per_m * step_m)
    rows = model.grid.to_time(squares * weight) * unit
    total = np.concatenate([np.zeros((1, rows.shape[1])), np.cumsum(rows, axis=0)])
    run = np.searchsorted(model.consist.starts_m, places, "right")
    peaks = []
    for length in WET_LENGTHS_M:
        count = round(length / step_m)
        if not 0 < count < len(places):
            continue
        inside = run[count - 1 :] == run[: len(run) - count + 1]
        columns = (total[count:] - total[:-count])[inside]
        if not len(columns):
            continue
        statistic, values = projection.likelihood_ratio(columns)
        statistic[values[:, 0] <= 0] = 0.0
        best = int(np.argmax(statistic))
        place = float(places[: len(inside)][inside][best]) - step_m / 2
        peaks.append((float(statistic[best]), place, length, float(values[best, 0])))
    return peaks


def _run_statistics(model: TraceModel, at: Fit, projection: Projection) -> FloatArray:
    """Likelihood ratio of a free impedance and delay for each run that the trace reaches."""
    rows, cars = at.prediction.rows.tolist(), len(model.consist.runs)
    first = rows.index(COMMON)
    second = rows.index(COMMON + cars)
    reached = second - first
    jacobian = at.prediction.jacobian / at.sigma
    columns = (jacobian[first:second], jacobian[second : second + reached])
    return projection.likelihood_ratio(*columns)[0]


def _step_m(model: TraceModel, place_m: float) -> float:
    cable = model.consist.runs[0].cable
    resolution = resolution_m(cable, place_m, model.instrument.rise_time_s)
    return max(_LEAST_STEP_M, _STEPS * resolution)


def place_squares(
    model: TraceModel,
    fields: Fields,
    low_m: float,
    high_m: float,
    step_m: float | None = None,
) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Squares of current and voltage along a stretch.

    Returns
    -------
    place_m : float64 [places]
        Middles of steps that divide each run: of about `step_m`, or of a quarter of what the
        reflectometer can tell apart at that distance.
    current, voltage : complex [places, frequencies]
        Squares there, scaled as `Fields` are.
    """
    starts = model.consist.starts_m
    places: list[float] = []
    currents: list[ComplexArray] = []
    voltages: list[ComplexArray] = []
    scratch = np.empty_like(model.s)
    for port, part in enumerate(fields.chain.parts):
        if not isinstance(part, Piece):
            continue
        start, length = float(starts[part.run]), model.consist.runs[part.run].length_m
        if start + length < low_m or start > high_m:
            continue
        step = _step_m(model, start) if step_m is None else step_m
        count = max(2, round(length / step))
        inside = start + (np.arange(count) + 0.5) * (length / count)
        wanted = np.flatnonzero((inside >= low_m) & (inside <= high_m))
        wave, factor = part.wave, part.impedance_factor
        drop = fields.current[port] * wave.impedance * factor
        forward = (fields.voltage[port] + drop) / 2
        cross = forward * (fields.voltage[port] - drop) / 2
        drop = fields.current[port + 1] * wave.impedance * factor
        behind = np.square((fields.voltage[port + 1] - drop) / 2)
        half = wave_exponential(wave.attenuation, wave.phase, part.length_m / count, scratch)
        full = np.square(half)
        # The forward wave falls from the front, the backward one from the rear.
        total = np.empty((count, len(model.s)), dtype=np.complex128)
        ahead = np.square(forward) * half
        behind *= half
        for k in range(count):
            total[k] = ahead
            ahead *= full
        for k in range(count - 1, -1, -1):
            total[k] += behind
            behind *= full
        total = total[wanted]
        places += inside[wanted].tolist()
        currents.append((total - 2 * cross) * np.square(wave.admittance / factor))
        voltages.append(total + 2 * cross)
    return np.array(places), np.concatenate(currents), np.concatenate(voltages)
