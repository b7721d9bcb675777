"""One run of cable by itself: how long it is, what it ends in, and what is wrong with it.

This is the measurement of Choi, Lee and Lim (S2, section 3.2): a reflectometer on the cable of
one car, of which no more is known than its profile. Its end is looked for as an open or a short
in a cable without end; what lies before it is then judged as a train of one car without nodes,
whose impedance and loss may be far from the profile. A matched end reflects next to nothing:
where no other end is seen, the run is taken to be terminated near the length of the profile, and
its length is told only if the trace holds it to a metre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rail_signals.arrays import FloatArray
from rail_signals.train_bus.bus_line import Coupler, Termination
from rail_signals.train_bus.consist import COMMON, CarRun, Consist, Tolerances
from rail_signals.train_bus.profile import BusProfile

from .fit import Fit
from .interpretation import Finding, Interpretation, interpret
from .parts import FaultGuess
from .projection import Projection
from .reflectometer import Reflectogram, Reflectometer
from .residual_scan import scan_residual
from .sequential_fit import SequentialFit, Windows
from .traces import summarise
from .verdict import RunMeasurement, RunVerdict, judge, measure_runs

ENDS = ("open", "short", "matched")
"""What a run may end in."""

_TOLERANCES = Tolerances(
    impedance_batch=0.15,
    delay_batch=1e-3,
    impedance=1e-3,
    delay=0.02,
    loss=0.5,
    termination=0.02,
)
_LENGTHS = np.linspace(0.7, 1.3, 61)
_KNOWN_M = 1.0
_END_REFLECTS = 0.3
_PEAKS = 4
_LEAST_GAIN = 100.0
_FAULT_COST = 30.0
_FAR_OFF = 2e-3


@dataclass(frozen=True)
class CableReading:
    """What a reflectogram of one run says.

    Parameters
    ----------
    end
        One of `ENDS`.
    interpretation
        What lies before the end.
    verdict
        Against the profile.
    consist
        The run as found, which the interpretation belongs to.
    """

    end: str
    interpretation: Interpretation
    verdict: RunVerdict
    consist: Consist


def read_single_cable(
    reflectogram: Reflectogram, profile: BusProfile, instrument: Reflectometer
) -> CableReading:
    """Read the reflectogram of one run of cable.

    Parameters
    ----------
    reflectogram
        The traces; they must reach beyond the end of the run.
    profile
        What the cable should be.
    instrument
        The reflectometer.
    """
    summary = summarise(reflectogram)
    sigma = summary.noise_rms / math.sqrt(summary.traces)
    start = float(reflectogram.time_s[0])
    length = _matched_length(summary.mean, sigma, start, profile, instrument)
    ends = [("matched", length, profile.termination_ohm)]
    fault = _find_end(summary.mean, sigma, start, profile, instrument)
    if fault is not None:
        load = math.inf if fault.kind == "open" else float(fault.values[1])
        ends.insert(0, (fault.kind, float(fault.values[0]), load))
    readings = []
    for end, length, load in ends:
        consist = _one_run(profile, length, Termination(load))
        interpretation = interpret(reflectogram, consist, instrument)
        stretch = math.exp(_TOLERANCES.delay * float(interpretation.deviations.delay[0]))
        if end == "matched" and abs(stretch - 1) > _FAR_OFF:
            # Places are told along a run of the length that was found, not of the first guess.
            length *= stretch
            consist = _one_run(profile, length, Termination(load))
            interpretation = interpret(reflectogram, consist, instrument)
        readings.append((end, length, consist, interpretation))
    # What explains the trace, and of two that do, that which needs no fault beside.
    end, length, consist, interpretation = min(readings, key=lambda reading: _cost(reading[3]))
    measured = measure_runs(interpretation, consist, [profile.attenuation_frequency_hz])[0]
    if end == "matched" and _length_std_m(interpretation.fit, length) > _KNOWN_M:
        measured = RunMeasurement(None, measured.impedance_ohm, None)
    verdict = judge(measured, profile)
    if interpretation.finding is not None:
        verdict = _with_finding(verdict, interpretation.finding)
    return CableReading(end, interpretation, verdict, consist)


def _cost(reading: Interpretation) -> float:
    return reading.fit.cost + (0.0 if reading.finding is None else _FAULT_COST)


def _find_end(
    trace: FloatArray, sigma: float, start_s: float, profile: BusProfile, instrument: Reflectometer
) -> FaultGuess | None:
    """The open or short that a cable without end would need to explain the trace."""
    observable_m = _observable_length_m(len(trace), start_s, profile, instrument)
    consist = _one_run(profile, observable_m, Termination(profile.termination_ohm))
    windows = Windows(consist, instrument, len(trace), start_s)
    drawn = np.zeros(COMMON + 3)
    healthy = windows.fit(trace, sigma, 1, drawn, steps=8)
    unfitted = windows.fit(trace, sigma, 1, drawn, steps=0)
    residual_scan = scan_residual(windows, trace, sigma, SequentialFit(unfitted, 0, None, 1))
    loop = 2 * profile.cable.impedance_ohm
    interpretation: list[Fit] = []
    for peak in residual_scan.fault_scan.peaks(_PEAKS, 3.0):
        rho = float(residual_scan.fault_scan.resistance_ohm[peak]) / loop
        if abs(rho) < _END_REFLECTS:
            continue
        place = float(residual_scan.fault_scan.place_m[peak])
        values = [place] if rho > 0 else [place, 1.0]
        guess = FaultGuess("open" if rho > 0 else "short", 0, np.array(values))
        interpretation.append(windows.fit(trace, sigma, 1, drawn, guess, steps=15))
    if not interpretation:
        return None
    best = min(interpretation, key=lambda fit: fit.cost)
    return best.fault if best.cost < healthy.cost - _LEAST_GAIN else None


def _matched_length(
    trace: FloatArray, sigma: float, start_s: float, profile: BusProfile, instrument: Reflectometer
) -> float:
    """The length near that of the profile at which a terminator explains the trace best [m]."""
    consist = _one_run(profile, profile.length_m, Termination(profile.termination_ohm))
    windows = Windows(consist, instrument, len(trace), start_s)
    drawn = np.zeros(COMMON + 3)
    at = windows.fit(trace, sigma, 1, drawn, steps=0)
    guesses = np.tile(drawn, (len(_LENGTHS), 1))
    guesses[:, COMMON + 1] = np.log(_LENGTHS) / consist.tolerances.delay
    model = windows.model(1)
    traces = np.stack([model.trace(guess) for guess in guesses])
    costs = Projection(at).costs((traces - at.prediction.trace) / sigma)
    return float(profile.length_m * _LENGTHS[int(np.argmin(costs))])


def _length_std_m(fit: Fit, length_m: float) -> float:
    """Standard error of the length that a fit of one run leaves [m]."""
    rows = fit.prediction.jacobian / fit.sigma
    explained = fit.metric.explained(rows)
    matrix = rows @ rows.T - explained.T @ explained + np.eye(len(rows))
    where = fit.prediction.rows.tolist().index(COMMON + 1)
    return length_m * _TOLERANCES.delay * math.sqrt(float(np.linalg.inv(matrix)[where, where]))


def _one_run(profile: BusProfile, length_m: float, load: Termination) -> Consist:
    run = CarRun(profile.cable, length_m)
    return Consist((run,), None, Coupler(), load, _TOLERANCES)


def _observable_length_m(
    samples: int, start_s: float, profile: BusProfile, instrument: Reflectometer
) -> float:
    """A length whose end the record does not reach any more [m]."""
    end = start_s + samples * instrument.sample_period_s
    return 0.5 * end * profile.cable.velocity_m_per_s + 1.0


def _with_finding(verdict: RunVerdict, finding: Finding) -> RunVerdict:
    reason = f"{finding.kind} at {finding.place_m:.1f} m"
    return replace(verdict, status="fail", reasons=(reason, *verdict.reasons))
