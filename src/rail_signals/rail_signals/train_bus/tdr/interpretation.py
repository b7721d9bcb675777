"""From the reflectogram of a train to what is wrong with it.

A healthy train is fitted from the head on (`rail_signals.train_bus.tdr.sequential_fit`). If it
explains the trace and a scan of all places finds nothing above the threshold, the train is healthy.
Otherwise faults of all kinds are fitted (`rail_signals.train_bus.tdr.search`), and the most
probable is reported.

The threshold (`alarm_threshold` in `rail_signals.train_bus.tdr.fault_scan`) holds the rate of false
alarms.

Between kinds decides the evidence (`rail_signals.train_bus.tdr.fit`), and two things beside the
trace: a shield that floats lets the noise rise, and a loose connector is told from a steady splice
by what changes between traces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.consist import Consist, Deviations

from .fault_scan import alarm_threshold
from .fit import Fit, evidence, fault_std
from .hypotheses import PLACED, VALUES, place_m
from .parts import FaultGuess
from .reflectometer import Reflectogram, Reflectometer
from .residual_scan import ResidualScan, scan_residual
from .search import FaultCandidate, candidates
from .sequential_fit import SequentialFit, Windows, fit_sequentially
from .traces import TraceSummary, summarise

FALSE_ALARM_RATE = 2e-3
"""Fraction of healthy trains that may be flagged."""

_RATIO_STD = 0.05
_RATIO_LEAST = 1.15
_RATIO_MOST = 5.0
_RATIO_ODD = 0.01
_ODD_CHANGE = 1e-3
_LEAST_NOISE = 0.5
_SAME_M = 0.5
_UNEXPLAINED = 6.0
_MOST_COUPLERS = 3


@dataclass(frozen=True)
class Finding:
    """A fault.

    Parameters
    ----------
    kind
        One of `bus_faults.KINDS`.
    car
        Number of the car, from 0; of a loose connector that in front of it.
    place_m, place_std_m
        Where it begins [m of cable from the head], and the standard error that noise leaves.
    values
        What was fitted, by name.
    probability
        Of this kind and place among all that were considered.
    """

    kind: str
    car: int
    place_m: float
    place_std_m: float
    values: dict[str, float]
    probability: float


@dataclass(frozen=True)
class Interpretation:
    """What a reflectogram says.

    Parameters
    ----------
    finding
        The most probable fault; None if the train is healthy.
    alternatives
        Kinds and probabilities of the next ones.
    statistic, threshold
        Largest likelihood ratio of the scan, and what healthy trains stay below; infinite if
        a window could not be fitted at all.
    noise_rms, noise_ratio
        Noise of a sample of one trace, and over that of the instrument.
    is_changing
        Whether the traces differ by more than noise.
    is_explained
        Whether what is reported explains the trace to within the noise.
    fit
        The fit behind it.
    deviations
        Of the train, as far as the trace tells.
    """

    finding: Finding | None
    alternatives: tuple[tuple[str, float], ...]
    statistic: float
    threshold: float
    noise_rms: float
    noise_ratio: float
    is_changing: bool
    is_explained: bool
    fit: Fit
    deviations: Deviations


def interpret(
    reflectogram: Reflectogram,
    consist: Consist,
    instrument: Reflectometer,
    false_alarm_rate: float = FALSE_ALARM_RATE,
) -> Interpretation:
    """Interpret the reflectogram of a train whose drawing is known.

    Parameters
    ----------
    reflectogram
        One trace or several; with one alone nothing can be seen to change.
    consist
        Drawing of the train.
    instrument
        The reflectometer; its sample period must be that of the record.
    false_alarm_rate
        Fraction of healthy trains that may be flagged.

    Raises
    ------
    ValueError
        If the record does not fit the instrument.
    """
    period = instrument.sample_period_s
    if abs(reflectogram.sample_period_s - period) > 1e-3 * period:
        raise ValueError(
            f"reflectogram must be sampled every {period:g} s,"
            f" got {reflectogram.sample_period_s:g} s"
        )
    summary = summarise(reflectogram)
    # Traces smoother than any instrument are not trusted further than the instrument.
    least = _LEAST_NOISE * instrument.noise_rms
    summary = replace(summary, noise_rms=max(summary.noise_rms, least))
    start = float(reflectogram.time_s[0])
    windows = Windows(consist, instrument, len(summary.mean), start)
    threshold = alarm_threshold(consist, instrument.rise_time_s, false_alarm_rate)
    if summary.change is not None:
        trace, sigma = summary.highest, summary.noise_rms
    else:
        trace, sigma = summary.mean, summary.noise_rms / math.sqrt(summary.traces)
    sequential = fit_sequentially(windows, trace, sigma)
    residual_scan = scan_residual(windows, trace, sigma, sequential)
    if (
        sequential.healthy is not None
        and sequential.failed is None
        and residual_scan.fault_scan.largest > threshold
    ):
        # Once more with what this train scatters back, not one a few per cent off.
        windows.forget(windows.cars)
        again = windows.fit(trace, sigma, windows.cars, sequential.healthy.deviations)
        sequential = replace(sequential, healthy=again)
        residual_scan = scan_residual(windows, trace, sigma, sequential)
    statistic = math.inf if sequential.failed is not None else residual_scan.fault_scan.largest
    ranked: list[FaultCandidate] = []
    if summary.change is not None:
        ranked = _loose(windows, trace, sigma, residual_scan, summary.change)
    elif statistic > threshold:
        ranked = candidates(windows, trace, sigma, residual_scan)
        if ranked[0].fit.excess > _UNEXPLAINED:
            ranked = candidates(windows, trace, sigma, residual_scan, thorough=True)
        if sequential.healthy is None:
            # A fault in the first run was looked for before the batch was known: now it is.
            about = scan_residual(windows, trace, sigma, sequential, ranked[0].fit.deviations)
            ranked = _distinct(ranked + candidates(windows, trace, sigma, about))
    return _report(windows, summary, sequential, ranked, statistic, threshold)


def _loose(
    windows: Windows,
    trace: FloatArray,
    sigma: float,
    residual_scan: ResidualScan,
    change: FloatArray,
) -> list[FaultCandidate]:
    """The loose connector whose contact makes the change between traces.

    In the change nothing is left of the tolerances: at the right coupler it is all that a
    resistance and an inductance there could do.
    """
    model, fields = residual_scan.model, residual_scan.fields
    couplers, rows = [], []
    for port, part in enumerate(fields.chain.parts):
        number = getattr(part, "coupler", None)
        if number is not None:
            couplers.append(int(number))
            rows.append(np.square(fields.current[port]))
    if not couplers:
        return candidates(windows, trace, sigma, residual_scan)
    squares = np.stack(rows)
    columns = np.stack(
        [model.grid.to_time(squares), model.grid.to_time(squares * (model.s * 1e-9))], axis=1
    )
    seen = change[: model.grid.samples]
    order = np.argsort([_unexplained(pair, seen) for pair in columns])
    ranked = []
    for k in order[:_MOST_COUPLERS]:
        guess = FaultGuess("loose_connector", couplers[k], np.array([5.0, 50.0]))
        runs = max(residual_scan.runs, couplers[k] + 1)
        fit = windows.fit(trace, sigma, runs, residual_scan.base.deviations, guess, steps=10)
        for longer in windows.strides(runs):
            fit = windows.fit(trace, sigma, longer, fit.deviations, fit.fault, steps=4)
        score = evidence(windows.model(windows.cars), fit)
        ranked.append(
            FaultCandidate(fit, score + _unexplained(fit.prediction.fault_jacobian, change))
        )
    return sorted(ranked, key=lambda candidate: candidate.score)


def _distinct(ranked: list[FaultCandidate]) -> list[FaultCandidate]:
    """Candidates without those that another one, as good or better, repeats; the best first."""
    kept: list[FaultCandidate] = []
    for one in sorted(ranked, key=lambda candidate: candidate.score):
        if not any(_is_same(one.fault, other.fault) for other in kept):
            kept.append(one)
    return kept


def _is_same(one: FaultGuess, other: FaultGuess) -> bool:
    """Whether two faults are one that was found twice."""
    if (one.kind, one.index) != (other.kind, other.index):
        return False
    if one.kind in PLACED:
        return abs(float(one.values[0] - other.values[0])) < _SAME_M
    return bool(np.allclose(one.values, other.values, atol=0.1))


def _unexplained(columns: FloatArray, change: FloatArray) -> float:
    """Power of a change that no sum of the columns explains."""
    basis, _ = np.linalg.qr(columns.T)
    return float(change @ change - np.sum((basis.T @ change) ** 2))


def _report(
    windows: Windows,
    summary: TraceSummary,
    sequential: SequentialFit,
    ranked: list[FaultCandidate],
    statistic: float,
    threshold: float,
) -> Interpretation:
    """Choose, and put together what is told."""
    consist = windows.consist
    ratio = summary.noise_rms / windows.instrument.noise_rms
    scores = []
    for candidate in ranked:
        odds = _log_noise_odds(candidate.fault.kind, ratio, summary.noise_std)
        if candidate.fault.kind == "loose_connector" and summary.change is None:
            # A contact that is loose seldom stays the same from trace to trace.
            odds += math.log(_ODD_CHANGE) if summary.traces > 1 else 0.0
        scores.append(candidate.score - 2 * odds)
    order = np.argsort(scores)
    finding, alternatives = None, []
    if len(order):
        weights = np.exp(-0.5 * (np.array(scores)[order] - scores[order[0]]))
        weights /= weights.sum()
        best = ranked[order[0]]
        finding = _finding(consist, best, float(weights[0]))
        alternatives = [
            (ranked[k].fault.kind, float(weight))
            for k, weight in zip(order[1:], weights[1:], strict=True)
        ]
        fit = best.fit
    else:
        fit = sequential.failed if sequential.failed is not None else sequential.healthy
        assert fit is not None
    return Interpretation(
        finding,
        tuple(alternatives),
        statistic,
        threshold,
        summary.noise_rms,
        ratio,
        summary.change is not None,
        fit.excess < _UNEXPLAINED,
        fit,
        Deviations.from_vector(fit.deviations, windows.cars),
    )


def _finding(consist: Consist, candidate: FaultCandidate, probability: float) -> Finding:
    fault = candidate.fault
    errors = fault_std(candidate.fit)
    placed = fault.kind in PLACED
    names = [value.name for value in VALUES[fault.kind]]
    return Finding(
        fault.kind,
        fault.index,
        place_m(consist, fault),
        float(errors[0]) if placed else 0.0,
        {n: float(v) for n, v in zip(names, fault.values, strict=True)},
        probability,
    )


def _log_noise_odds(kind: str, ratio: float, error: float) -> float:
    """Logarithm of the probability density of the noise over that of the instrument."""
    std = math.hypot(_RATIO_STD, error)
    usual = math.exp(-0.5 * ((ratio - 1) / std) ** 2) / (std * math.sqrt(2 * math.pi))
    inside = _RATIO_LEAST - 2 * std < ratio < 2 * _RATIO_MOST
    odd = 1 / (max(ratio, 0.1) * math.log(_RATIO_MOST / _RATIO_LEAST)) if inside else 0.0
    density = odd if kind == "missing_shield_ground" else usual + _RATIO_ODD * odd
    return math.log(max(density, 1e-12))
