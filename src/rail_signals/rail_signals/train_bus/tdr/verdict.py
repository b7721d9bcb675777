"""Does each car's cable pass? Length, impedance and attenuation against the limits of a profile.

The three values are what Choi, Lee and Lim (S2, Fig 6) read off a reflectometer for each car.
Here they follow from the fit of the whole train: the length is the delay of the run times the
velocity of its kind of cable, as an instrument set to that velocity would show it; the impedance
is that of the cable; the attenuation is what the run, with the fault in it, takes from a wave
that passes at one frequency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rail_signals.train_bus.bus_line import BusLine, CableSection, Coupler, Termination
from rail_signals.train_bus.cascade import transfer
from rail_signals.train_bus.consist import Consist
from rail_signals.train_bus.faults import BusFault, LooseConnector, MissingShieldGround, WrongCable
from rail_signals.train_bus.profile import BusProfile

from .hypotheses import as_fault
from .interpretation import Interpretation
from .parts import FaultGuess


@dataclass(frozen=True)
class RunMeasurement:
    """What was measured of one run of cable; None where a trace does not tell.

    Parameters
    ----------
    length_m
        Electrical length at the velocity of its kind of cable [m].
    impedance_ohm
        Characteristic impedance [ohm].
    attenuation_db
        Loss of a wave that passes, at the profile's frequency [dB]; infinite if none does.
    """

    length_m: float | None
    impedance_ohm: float | None
    attenuation_db: float | None


@dataclass(frozen=True)
class RunVerdict:
    """Verdict on one run.

    Parameters
    ----------
    status
        ``pass``, ``fail`` or ``not seen``.
    reasons
        Why it is not a pass.
    measurement
        What was measured.
    """

    status: str
    reasons: tuple[str, ...]
    measurement: RunMeasurement


def judge(measurement: RunMeasurement, profile: BusProfile) -> RunVerdict:
    """Judge one run by the limits of a profile.

    Limits of length and impedance belong to what passes. An attenuation of exactly
    `BusProfile.attenuation_limit_db` fails.

    Examples
    --------
    >>> from rail_signals.train_bus.profile import load_bus_profile
    >>> judge(RunMeasurement(47.0, 105.0, 15.0), load_bus_profile("CM2")).reasons
    ('attenuation 15 dB not below 15 dB',)
    """
    reasons: list[str] = []
    missing: list[str] = []
    length, impedance = measurement.length_m, measurement.impedance_ohm
    if length is None:
        missing.append("length not seen")
    elif profile.length_limits_m is not None:
        reasons += _outside("length", length, profile.length_limits_m, "m")
    if impedance is None:
        missing.append("impedance not seen")
    else:
        reasons += _outside("impedance", impedance, profile.impedance_limits_ohm, "ohm")
    attenuation = measurement.attenuation_db
    if attenuation is None:
        missing.append("attenuation not seen")
    elif profile.attenuation_limit_db is not None:
        if not attenuation < profile.attenuation_limit_db:
            limit = profile.attenuation_limit_db
            reasons.append(f"attenuation {attenuation:.4g} dB not below {limit:g} dB")
    elif profile.attenuation_limit_db_per_km is not None and length is not None:
        limit = profile.attenuation_limit_db_per_km * length / 1e3
        if attenuation > limit:
            reasons.append(f"attenuation {attenuation:.4g} dB above {limit:.4g} dB")
    status = "fail" if reasons else "not seen" if missing else "pass"
    return RunVerdict(status, tuple(reasons + missing), measurement)


def judge_train(
    interpretation: Interpretation, consist: Consist, profiles: list[BusProfile]
) -> list[RunVerdict]:
    """Judge every car of a train by its profile.

    Parameters
    ----------
    interpretation
        Of the train's reflectogram.
    consist
        Its drawing.
    profiles
        One for each car.
    """
    if len(profiles) != len(consist.runs):
        raise ValueError(f"profiles must be {len(consist.runs)}, got {len(profiles)}")
    measured = measure_runs(interpretation, consist, [p.attenuation_frequency_hz for p in profiles])
    verdicts = []
    finding = interpretation.finding
    for car, (measurement, profile) in enumerate(zip(measured, profiles, strict=True)):
        verdict = judge(measurement, profile)
        if finding is not None and finding.car == car:
            reason = f"{finding.kind} at {finding.place_m:.1f} m"
            verdict = RunVerdict("fail", (reason, *verdict.reasons), measurement)
        verdicts.append(verdict)
    return verdicts


def measure_runs(
    interpretation: Interpretation, consist: Consist, frequencies_hz: list[float]
) -> list[RunMeasurement]:
    """Length, impedance and attenuation of every run, from the fit of a train's trace."""
    deviations = interpretation.deviations
    sections = [e for e in consist.bus_line(deviations).elements if isinstance(e, CableSection)]
    loss_factor = math.exp(consist.tolerances.loss * deviations.loss)
    fault = interpretation.fit.fault
    measurements = []
    for car, (section, frequency) in enumerate(zip(sections, frequencies_hz, strict=True)):
        ends = fault is not None and fault.kind in ("open", "short")
        if fault is not None and ends and car > fault.index:
            measurements.append(RunMeasurement(None, None, None))
        else:
            here = fault if fault is not None and fault.index == car else None
            measurements.append(_measure(consist, section, here, loss_factor, frequency))
    return measurements


def _measure(
    consist: Consist,
    section: CableSection,
    fault: FaultGuess | None,
    loss_factor: float,
    frequency_hz: float,
) -> RunMeasurement:
    """One run, with the fault in it."""
    reference = section.cable.impedance_ohm
    stretch, impedance = section.delay_factor, section.impedance_ohm
    bus_line = BusLine((section,), Termination(reference))
    if fault is None:
        return RunMeasurement(
            section.length_m * stretch, impedance, _loss_db(bus_line, frequency_hz, reference)
        )
    if fault.kind in ("open", "short"):
        return RunMeasurement(float(fault.values[0]) * stretch, impedance, math.inf)
    if fault.kind == "wrong_cable":
        stretch *= math.exp(fault.values[1])
    if fault.kind in ("wrong_cable", "missing_shield_ground"):
        impedance *= math.exp(fault.values[0])
    if fault.kind == "loose_connector":
        bus_line = BusLine((section, Coupler()), Termination(reference))
    faulty = _in_one_run(as_fault(consist, fault, loss_factor), fault).apply(bus_line)
    return RunMeasurement(
        section.length_m * stretch, impedance, _loss_db(faulty, frequency_hz, reference)
    )


def _in_one_run(fault: BusFault, guess: FaultGuess) -> BusFault:
    """The fault as it lies in a line that is but its run."""
    if isinstance(fault, LooseConnector):
        return replace(fault, coupler=0)
    if isinstance(fault, WrongCable | MissingShieldGround):
        return replace(fault, section=0)
    return replace(fault, place_m=float(guess.values[0]))


def _loss_db(bus_line: BusLine, frequency_hz: float, reference_ohm: float) -> float:
    passed = abs(transfer(bus_line, [frequency_hz], reference_ohm)[-1, 0])
    return float(-20 * np.log10(passed)) if passed > 0 else math.inf


def _outside(name: str, value: float, limits: tuple[float, float], unit: str) -> list[str]:
    low, high = limits
    if low <= value <= high:
        return []
    return [f"{name} {value:.4g} {unit} outside {low:g} to {high:g} {unit}"]
