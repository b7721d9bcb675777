"""Faults that could explain a trace: starts from matched filters, fits, and the best of each kind.

From every peak of the scan (`rail_signals.train_bus.tdr.fault_scan`) each kind of fault that could
look like it starts a fit. What a resistance in series would have to be there tells open and short
from the rest: they reflect nearly everything.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rail_signals.arrays import FloatArray

from .cable_substitution import likely_substitutions
from .fault_scan import WET_LENGTHS_M, scan_water
from .fit import Fit, evidence
from .hypotheses import VALUES
from .parts import NANO, FaultGuess
from .residual_scan import AHEAD_M, ResidualScan, blur_m
from .sequential_fit import Windows

_PEAKS = 2
_APART_M = 5.0
_NEAR_COUPLER_M = 8.0
_GROSS = 0.25
_NEAR_END_M = 2.5
_BEYOND_M = 1.0
_BEHIND = 400.0
_APART_FAR_M = 20.0
_BEHIND_M = 12.0
_SHORT_STEPS = 2
_FIRST_STEPS = 5
_LONG_STEPS = 10
_MOST_STARTS = 20
_MOST_FITS = 6
_MOST_FINAL = 4


@dataclass(frozen=True)
class FaultCandidate:
    """A fault that was fitted, and minus twice the logarithm of its evidence."""

    fit: Fit
    score: float

    @property
    def fault(self) -> FaultGuess:
        """The fault."""
        assert self.fit.fault is not None
        return self.fit.fault


def candidates(
    windows: Windows,
    trace: FloatArray,
    sigma: float,
    residual_scan: ResidualScan,
    thorough: bool = False,
) -> list[FaultCandidate]:
    """Faults of different kinds that explain the whole trace best, the best first.

    Parameters
    ----------
    windows, trace, sigma, residual_scan
        The trace, its noise, and where to look.
    thorough
        Try every start there is.
    """
    base, runs = residual_scan.base, residual_scan.runs
    guesses = list(_starts(windows, residual_scan, thorough))
    if not thorough:
        guesses = _best_starts(residual_scan, guesses)
    # Before the batch is known, costs are less sure; but windows are short.
    steps, most = (
        (_SHORT_STEPS, _MOST_FITS) if residual_scan.is_started else (_FIRST_STEPS, _MOST_STARTS)
    )
    fits = [
        windows.fit(trace, sigma, runs, base.deviations, guess, steps=steps) for guess in guesses
    ]
    fits = [
        windows.fit(trace, sigma, runs, ranked.deviations, ranked.fault, steps=_LONG_STEPS)
        for ranked in _leaders(fits, 2.0, most)
    ]
    fits = _leaders(fits, 1.0, _MOST_FINAL)
    for longer in windows.strides(runs):
        fits = [
            windows.fit(trace, sigma, longer, ranked.deviations, ranked.fault, steps=4)
            for ranked in fits
        ]
        fits = _leaders(fits, 1.0, _MOST_FINAL)
    whole = windows.model(windows.cars)
    ranked = [FaultCandidate(fit, evidence(whole, fit)) for fit in fits]
    return sorted(ranked, key=lambda candidate: candidate.score)


def _leaders(fits: list[Fit], factor: float, most: int) -> list[Fit]:
    """The best fit of each kind in each place that is not far behind the best of all."""
    ordered = sorted(fits, key=lambda fit: fit.cost)
    best: dict[tuple[str, int, int], Fit] = {}
    for fit in ordered:
        assert fit.fault is not None
        if fit.cost <= factor * ordered[0].cost + _BEHIND:
            best.setdefault(_look(fit.fault), fit)
    return list(best.values())[:most]


def _look(fault: FaultGuess) -> tuple[str, int, int]:
    """Kind and place of a fault, and of another cable its delay: the end may not be seen yet."""
    delay = round(fault.values[1] / 0.15) if fault.kind == "wrong_cable" else 0
    return fault.kind, fault.index, delay


def _best_starts(residual_scan: ResidualScan, guesses: list[FaultGuess]) -> list[FaultGuess]:
    """The best starts, judged without a fit, few of a kind in one place."""
    base = residual_scan.base
    traces = [residual_scan.model.trace(base.deviations, guess) for guess in guesses]
    changes = (np.stack(traces) - base.prediction.trace) / base.sigma
    costs = residual_scan.projection.costs(changes)
    limit = np.inf
    if residual_scan.is_explained:
        limit = np.min(costs) + _BEHIND / 4
    elif residual_scan.is_started:
        limit = 3 * np.min(costs) + 1000.0
    counts: dict[tuple[str, int], int] = {}
    kinds: set[str] = set()
    chosen: list[FaultGuess] = []
    for k in np.argsort(costs):
        guess = guesses[k]
        key = (guess.kind, guess.index)
        likely = costs[k] <= limit and len(chosen) < _MOST_STARTS
        if (likely and counts.get(key, 0) < 3) or (
            guess.kind not in kinds and not residual_scan.is_explained
        ):
            counts[key] = counts.get(key, 0) + 1
            kinds.add(guess.kind)
            chosen.append(guess)
    return chosen


def _starts(windows: Windows, residual_scan: ResidualScan, thorough: bool) -> Iterator[FaultGuess]:
    """Faults that could have left what the scan found."""
    yield from _lumped_starts(windows, residual_scan, thorough)
    if thorough:
        yield from _wet_starts(windows, residual_scan)
    for low, high in _stretches(windows, residual_scan):
        found = scan_water(
            residual_scan.model,
            residual_scan.base,
            residual_scan.fields,
            residual_scan.projection,
            low,
            high,
        )
        for _, place, length, rise in sorted(found, reverse=True)[:3]:
            run = windows.run_at(place)
            inside = place - float(windows.consist.starts_m[run])
            wet = np.array([inside, length, min(max(rise, 0.05), 0.8), 1.0])
            yield FaultGuess("water_ingress", run, wet)
    for run in _runs(windows, residual_scan):
        swaps = likely_substitutions(
            residual_scan.model,
            residual_scan.base,
            residual_scan.fields,
            residual_scan.projection,
            run,
        )
        delays: list[float] = []
        for _, impedance, delay in swaps:
            if len(delays) < 3 and all(abs(delay - other) > 0.1 for other in delays):
                delays.append(delay)
                yield FaultGuess("wrong_cable", run, np.array([impedance, delay, 0.0, 0.0]))
        impedance = next((z for _, z, delay in swaps if delay == 0 and z > 0), 0.06)
        mean = VALUES["missing_shield_ground"][1].mean
        yield FaultGuess("missing_shield_ground", run, np.array([impedance, mean]))


def _lumped_starts(
    windows: Windows, residual_scan: ResidualScan, thorough: bool
) -> Iterator[FaultGuess]:
    """Faults in one place, at the peaks of the scan."""
    scanned, consist = residual_scan.fault_scan, windows.consist
    couplers: dict[int, tuple[float, float]] = {}
    for peak in _peaks(residual_scan, 2 * _PEAKS if thorough else _PEAKS, _APART_M):
        place = float(scanned.place_m[peak])
        run = windows.run_at(place)
        loop = 2 * consist.runs[run].cable.impedance_ohm
        rho = float(scanned.resistance_ohm[peak]) / loop
        resistance = min(loop * rho / (1 - rho), 200.0) if 0 < rho < 0.9 else 1.0
        inductance = float(np.clip(scanned.inductance_h[peak] / NANO, 10.0, 300.0))
        for number, inside in _either_side(windows, run, place - float(consist.starts_m[run])):
            if rho > _GROSS or thorough:
                yield FaultGuess("open", number, np.array([inside]))
            if rho < -_GROSS or thorough:
                yield FaultGuess("short", number, np.array([inside, 1.0]))
            splice = np.array([inside, resistance, inductance])
            yield FaultGuess("bad_splice", number, splice)
        near = np.abs(consist.starts_m[1:-1] - place) < _NEAR_COUPLER_M
        for coupler in np.flatnonzero(near).tolist():
            couplers.setdefault(coupler, (resistance, inductance))
    for coupler, values in couplers.items():
        if coupler < residual_scan.runs:
            yield FaultGuess("loose_connector", coupler, np.array(values))


def _wet_starts(windows: Windows, residual_scan: ResidualScan) -> Iterator[FaultGuess]:
    """Wet stretches of all lengths, as wet as the step at their front tells: not linear."""
    scanned, consist = residual_scan.fault_scan, windows.consist
    for peak in _peaks(residual_scan, 2 * _PEAKS, _APART_M):
        place = float(scanned.place_m[peak])
        run = windows.run_at(place)
        rho = float(scanned.resistance_ohm[peak]) / (2 * consist.runs[run].cable.impedance_ohm)
        if -0.5 < rho < 0:
            rise = ((1 - rho) / (1 + rho)) ** 2 - 1
            inside = place - float(consist.starts_m[run])
            for length in WET_LENGTHS_M:
                yield FaultGuess("water_ingress", run, np.array([inside, length, rise, 1.0]))


def _either_side(windows: Windows, run: int, inside_m: float) -> Iterator[tuple[int, float]]:
    """Run and place within it, and the place beyond a coupler that is near."""
    yield run, inside_m
    length = windows.consist.runs[run].length_m
    if inside_m < _NEAR_END_M and run > 0:
        yield run - 1, windows.consist.runs[run - 1].length_m - _BEYOND_M
    if inside_m > length - _NEAR_END_M and run < windows.cars - 1:
        yield run + 1, _BEYOND_M


def _peaks(residual_scan: ResidualScan, count: int, apart_m: float) -> list[int]:
    """Largest peaks of all, and the largest of the part that a healthy train leaves open."""
    peaks = residual_scan.fault_scan.peaks(count, apart_m)
    if residual_scan.last_m > 0:
        late = residual_scan.fault_scan.peaks(1, apart_m, residual_scan.last_m)
        peaks += [peak for peak in late if peak not in peaks]
    return peaks


def _stretches(windows: Windows, residual_scan: ResidualScan) -> list[tuple[float, float]]:
    """Stretches around the two largest peaks, wider where the line blurs them."""
    stretches = []
    for peak in _peaks(residual_scan, _PEAKS, _APART_FAR_M):
        place = float(residual_scan.fault_scan.place_m[peak])
        blur = blur_m(windows, place)
        stretches.append((max(0.0, place - AHEAD_M - blur), place + _BEHIND_M + 0.3 * blur))
    return stretches


def _runs(windows: Windows, residual_scan: ResidualScan) -> list[int]:
    """Runs that could be of another cable: around the largest peak, and the most suspicious."""
    reached = min(windows.cars, residual_scan.runs + 1)
    if not residual_scan.is_started:
        return list(range(reached))
    runs = {int(k) for k in np.argsort(residual_scan.fault_scan.run_statistic)[::-1][:2]}
    for low, high in _stretches(windows, residual_scan)[:1]:
        runs |= set(range(windows.run_at(low + 6.0), windows.run_at(high - 8.0) + 1))
    if residual_scan.last_m > 0:
        runs |= set(range(windows.run_at(residual_scan.last_m + AHEAD_M - 1.0), reached))
    return sorted(run for run in runs if run < reached)
