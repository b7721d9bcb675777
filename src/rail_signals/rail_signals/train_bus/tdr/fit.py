"""Most probable deviations of a train, and values of a supposed fault, given a trace.

Minimised is ``|x - m(theta, phi)|^2 + |theta|^2 + prior(phi)`` for a trace x, in the metric of
its noise and of the backscatter of rough cable (`rail_signals.train_bus.tdr.backscatter`),
deviations theta in standard deviations and values phi of a fault, by Gauss-Newton steps, damped
until they lead downhill. As long as the residual is larger than the noise it is taken for the
noise: deviations then keep near their priors instead of imitating what the supposed fault does not
yet explain. Of a healthy train the least cost is distributed as chi-square with as many degrees of
freedom as there are samples, whatever the number of deviations: each of them brings its own prior.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular

from rail_signals.arrays import FloatArray

from .backscatter import Metric
from .hypotheses import VALUES, clipped, log_expected_range, prior_cost, prior_gradient
from .model import TraceModel, TracePrediction
from .parts import FaultGuess

_TRIES = 6
_SETTLED = 0.2


@dataclass(frozen=True)
class Fit:
    """A minimum.

    Parameters
    ----------
    cost
        What was minimised.
    deviations : float64 [7 + 4 cars - 1]
        Vector of `Deviations`.
    fault
        The fault, or none.
    prediction
        Trace and derivatives there.
    residual : float64 [samples]
        What the trace has left, over the white noise.
    metric
        Metric of the noise.
    """

    cost: float
    deviations: FloatArray
    fault: FaultGuess | None
    prediction: TracePrediction
    residual: FloatArray
    metric: Metric

    @property
    def sigma(self) -> float:
        """White noise of the trace."""
        return self.metric.sigma

    @property
    def samples(self) -> int:
        """Samples that were fitted."""
        return len(self.residual)

    @property
    def tension(self) -> float:
        """Power of the residual over that of the noise, 1 at the least."""
        return max(1.0, self.power / self.samples)

    @cached_property
    def power(self) -> float:
        """Squared residual in the metric of the noise."""
        return self.metric.square(self.residual)

    @property
    def excess(self) -> float:
        """Cost above that of a right model, in standard deviations of chi-square."""
        return (self.cost - self.samples) / math.sqrt(2 * self.samples)


def fit(
    model: TraceModel,
    trace: FloatArray,
    metric: Metric,
    deviations: FloatArray,
    fault: FaultGuess | None = None,
    steps: int = 6,
) -> Fit:
    """Gauss-Newton from a start.

    Parameters
    ----------
    model
        Predicts as many samples as are fitted: the first of `trace`.
    trace : float64 [samples or more]
        The reflectogram.
    metric
        Metric of its noise.
    deviations, fault
        Where to start.
    steps
        At most so many steps.
    """
    seen = trace[: model.grid.samples]
    if fault is not None:
        fault = clipped(model.consist, fault)
    best = _evaluate(model, seen, metric, deviations, fault)
    damping = 0.0
    for _ in range(steps):
        fitted, damping = _step(model, seen, best, damping)
        if fitted is None:
            break
        gained = _tempered(best, best.tension) - _tempered(fitted, best.tension)
        best = fitted
        if gained < _SETTLED:
            break
    return best


def evidence(model: TraceModel, fitted: Fit) -> float:
    """Minus twice the logarithm of the evidence of a fit's kind of fault (Laplace's method).

    The cost, and for each value of the fault the logarithm of how much of the range expected
    beforehand the trace still allows. Differences to other kinds, and to no fault at all, have
    meaning.
    """
    if fitted.fault is None:
        return fitted.cost
    matrix, _ = _normal_equations(fitted, 1.0)
    size = len(fitted.prediction.rows)
    factor = cholesky(matrix[:size, :size], lower=True)
    cross = solve_triangular(factor, matrix[:size, size:], lower=True)
    rest = matrix[size:, size:] - cross.T @ cross
    _, log_det = np.linalg.slogdet(rest)
    count = len(fitted.fault.values)
    ranges = log_expected_range(model.consist, fitted.fault.kind)
    return float(fitted.cost + log_det - count * math.log(2 * math.pi) + 2 * ranges)


def fault_std(fitted: Fit) -> FloatArray:
    """Standard deviations of the values of the fault, from the curvature: [values]."""
    assert fitted.fault is not None
    matrix, _ = _normal_equations(fitted, 1.0)
    size = len(fitted.prediction.rows)
    unit = np.eye(len(matrix))[:, size:]
    return np.sqrt(np.diag(cho_solve(cho_factor(matrix), unit)[size:]))


def _evaluate(
    model: TraceModel,
    seen: FloatArray,
    metric: Metric,
    deviations: FloatArray,
    fault: FaultGuess | None,
) -> Fit:
    prediction = model.predict(deviations, fault)
    residual = (seen - prediction.trace) / metric.sigma
    priors = float(deviations @ deviations) + prior_cost(fault)
    return Fit(priors + metric.square(residual), deviations, fault, prediction, residual, metric)


def _tempered(at: Fit, tension: float) -> float:
    """Cost with the noise larger by the root of the tension."""
    return at.power / tension + at.cost - at.power


def _normal_equations(at: Fit, tension: float) -> tuple[FloatArray, FloatArray]:
    """Half the Hessian and half the downhill gradient of the tempered cost: [p, p] and [p]."""
    p = at.prediction
    rows = np.concatenate([p.jacobian, p.fault_jacobian]) / at.sigma
    explained = at.metric.explained(np.concatenate([rows, at.residual[None]]))
    own, rest = explained[:, :-1], explained[:, -1]
    matrix = (rows @ rows.T - own.T @ own) / tension
    gradient = (rows @ at.residual - own.T @ rest) / tension
    size = len(p.rows)
    diagonal = np.zeros(len(matrix))
    diagonal[:size] = 1
    gradient[:size] -= at.deviations[p.rows]
    if at.fault is not None and len(matrix) > size:
        precision, pull = prior_gradient(at.fault)
        diagonal[size:] = precision
        gradient[size:] += pull
        # Of a value without effect here, such as the inductance of an open, nothing is known.
        diagonal[size:] += 1e-12 * np.diag(matrix)[size:] + 1e-12
    matrix[np.diag_indices_from(matrix)] += diagonal
    return matrix, gradient


def _step(model: TraceModel, seen: FloatArray, at: Fit, damping: float) -> tuple[Fit | None, float]:
    """One step downhill, or None where no damping leads there."""
    tension = at.tension
    before = _tempered(at, tension)
    matrix, gradient = _normal_equations(at, tension)
    size = len(at.prediction.rows)
    held = _held(at, gradient[size:])
    # What the window does not show yet, such as the delay of a run whose end lies beyond it, is
    # not thrown about: as if it were known to its expected range, on the way but not at the end.
    floor = np.zeros(len(matrix))
    if at.fault is not None and len(matrix) > size:
        widths = [entry.expected for entry in VALUES[at.fault.kind]]
        floor[size:] = [1 / width**2 if width else 0.0 for width in widths]
    for _ in range(_TRIES):
        damped = matrix.copy()
        damped[np.diag_indices_from(damped)] *= 1 + damping
        damped[np.diag_indices_from(damped)] += floor
        for value in held:
            damped[size + value, :] = 0
            damped[:, size + value] = 0
            damped[size + value, size + value] = 1
        pulls = gradient.copy()
        pulls[[size + v for v in held]] = 0
        step = cho_solve(cho_factor(damped, overwrite_a=True), pulls)
        moved = at.deviations.copy()
        moved[at.prediction.rows] += step[:size]
        fault = at.fault
        if fault is not None:
            values = fault.values + step[size:]
            fault = clipped(model.consist, FaultGuess(fault.kind, fault.index, values))
        fitted = _evaluate(model, seen, at.metric, moved, fault)
        if _tempered(fitted, tension) <= before:
            return fitted, damping * 0.2
        damping = max(10 * damping, 1e-2)
    return None, damping


def _held(at: Fit, pull: FloatArray) -> list[int]:
    """Values that lie at a limit and are pulled beyond it."""
    if at.fault is None:
        return []
    entries = VALUES[at.fault.kind]
    return [
        k
        for k, (entry, value) in enumerate(zip(entries, at.fault.values, strict=True))
        if (value <= entry.low and pull[k] < 0) or (value >= entry.high and pull[k] > 0)
    ]
