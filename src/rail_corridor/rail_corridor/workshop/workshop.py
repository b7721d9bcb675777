"""``rail tdr``: a reflectogram from the workshop to length, impedance, attenuation and faults.

No ROS runs for it. What the instrument wrote is brought to the form that the monitor on board
reads as well, and interpreted by the same functions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from rich.console import Console
from rich.table import Table

from rail_corridor.errors import InputError
from rail_signals.arrays import FloatArray
from rail_signals.train_bus.bus_line import Termination
from rail_signals.train_bus.consist import Consist
from rail_signals.train_bus.fault_words import fault_words, size_of
from rail_signals.train_bus.profile import bus_profile_names
from rail_signals.train_bus.tdr.interpretation import Interpretation, interpret
from rail_signals.train_bus.tdr.measured_trace import from_ohms, step_answer, step_edge
from rail_signals.train_bus.tdr.reflectometer import Reflectogram, Reflectometer
from rail_signals.train_bus.tdr.response import SAMPLES_PER_RISE, lead_in_s
from rail_signals.train_bus.tdr.single_cable import CableReading, read_single_cable
from rail_signals.train_bus.tdr.traces import noise_level
from rail_signals.train_bus.tdr.verdict import RunVerdict, judge, judge_train
from rail_signals.train_bus.train import cable_consist, train_consist, train_profiles

from .touchstone_file import MeasuredSpectrum
from .trace_file import MeasuredTrace, read_measurement

End = Literal["terminated", "open", "short"]

#: What is at the far end, and as what it is read.
_ENDS: Final = {"terminated": "matched", "open": "open", "short": "short"}
#: Beyond the delay as drawn, and the edge at the far end.
_WINDOW_FRACTION: Final = 1.1
_EDGES: Final = 3.0
#: No passive line reflects more than it gets, but instruments overshoot.
_LARGEST_REFLECTION: Final = 1.5
#: Noise of an instrument that writes none [as a reflection].
_LEAST_NOISE: Final = 5e-5


@dataclass(frozen=True)
class Workshop:
    """How a trace was taken.

    Parameters
    ----------
    profiles
        Profile of the cable in each car, from where the instrument is connected. One alone is
        a cable by itself, several are a train with its nodes and couplers.
    end
        What is at the other end.
    rise_time_s
        Rise time of the instrument's edge, 10 to 90 % [s].
    incident_v
        Size of its edge [V], for traces in volts.
    has_node
        Whether one cable by itself ends at a node, as it does in its car.
    """

    profiles: tuple[str, ...]
    end: End = "terminated"
    rise_time_s: float = 20e-9
    incident_v: float | None = None
    has_node: bool = False


@dataclass(frozen=True)
class Diagnosis:
    """What a trace says.

    Parameters
    ----------
    reflectogram, reading
        The trace as interpreted, and the interpretation.
    consist
        Drawing it was held against.
    verdicts
        Of each car.
    remark
        What is wrong with the end of a cable by itself; empty if nothing is.
    """

    reflectogram: Reflectogram
    reading: Interpretation
    consist: Consist
    verdicts: tuple[RunVerdict, ...]
    remark: str = ""

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        is_right = self.reading.finding is None and not self.remark
        return is_right and all(verdict.status == "pass" for verdict in self.verdicts)


def diagnose(path: Path, workshop: Workshop) -> Diagnosis:
    """Read and interpret a trace.

    Raises
    ------
    InputError
        If the file or the profile cannot be used; one line.
    """
    consist = drawing(workshop)
    profiles = train_profiles(workshop.profiles)
    instrument = Reflectometer(
        reference_ohm=profiles[0].termination_ohm,
        rise_time_s=workshop.rise_time_s,
        sample_period_s=workshop.rise_time_s / SAMPLES_PER_RISE,
    )
    measured = read_measurement(path)
    try:
        if isinstance(measured, MeasuredSpectrum):
            time_s, rows = _from_spectrum(measured, instrument)
        else:
            time_s, rows = _from_trace(measured, workshop, instrument)
        time_s, rows = _window(time_s, rows, consist, instrument)
    except InputError as error:
        raise error.located(str(path)) from None
    noise = max(noise_level(rows), _LEAST_NOISE)
    traces = Reflectogram(time_s, rows)
    # Times are printed with few digits: never coarser than the edge allows.
    period_s = min(traces.sample_period_s, instrument.sample_period_s)
    instrument = replace(instrument, sample_period_s=period_s, noise_rms=noise)
    if _is_bare(workshop):
        # Of a cable by itself no more is known than its profile: it may have any length.
        run = read_single_cable(traces, profiles[0], instrument)
        remark = "" if run.end == _ENDS[workshop.end] else _remark(run, workshop.end)
        return Diagnosis(traces, run.interpretation, run.consist, (run.verdict,), remark)
    reading = interpret(traces, consist, instrument)
    verdicts = tuple(judge_train(reading, consist, list(profiles)))
    return Diagnosis(traces, reading, consist, verdicts)


def _is_bare(workshop: Workshop) -> bool:
    return len(workshop.profiles) == 1 and not workshop.has_node


def _remark(run: CableReading, end: End) -> str:
    length = run.verdict.measurement.length_m
    where = "" if length is None else f" at {length:.1f} m"
    return f"the cable is {run.end}{where}, not {end}"


def drawing(workshop: Workshop) -> Consist:
    """What the trace is held against.

    Raises
    ------
    InputError
        If there is no such profile.
    """
    known = bus_profile_names()
    for name in workshop.profiles:
        if name.lower() not in known:
            raise InputError(f"must be one of {', '.join(known)}", field="--profile", value=name)
    names = workshop.profiles
    consist = cable_consist(names[0]) if _is_bare(workshop) else train_consist(names)
    if workshop.end == "terminated":
        return consist
    # As good as open and short, and a model can still be fitted to it.
    return replace(consist, termination=Termination(1e6 if workshop.end == "open" else 1e-3))


def _from_trace(
    measured: MeasuredTrace, workshop: Workshop, instrument: Reflectometer
) -> tuple[FloatArray, FloatArray]:
    """Times and reflections of what an instrument drew."""
    time_s, values, name = measured.time_s, measured.values, measured.quantity
    if name == "ohms":
        if values.min() < 0.0:
            raise InputError("must be 0 or more", field=name, value=float(values.min()))
        values = from_ohms(values, instrument.reference_ohm)
    elif name == "volts":
        if workshop.incident_v is None:
            raise InputError("traces in volts need the size of the edge, --incident-v", field=name)
        # The instrument sees its own edge beside what comes back.
        values = values / workshop.incident_v - step_edge(time_s, workshop.rise_time_s)
    worst = float(values.flat[int(np.abs(values).argmax())])
    if abs(worst) > _LARGEST_REFLECTION:
        raise InputError(
            f"a reflection lies within -{_LARGEST_REFLECTION:g} and {_LARGEST_REFLECTION:g};"
            " is the unit right?",
            field=name,
            value=worst,
        )
    # As even as the printed digits allow: made quite even.
    time_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    step_s = float(time_s[1] - time_s[0])
    coarsest_s = instrument.rise_time_s / SAMPLES_PER_RISE
    if step_s > coarsest_s * (1.0 + 1e-6):
        raise InputError(
            f"samples must be {coarsest_s:.3g} s apart or closer for a rise time of"
            f" {instrument.rise_time_s:g} s; is the unit of the time right?",
            field="time",
            value=step_s,
        )
    # What is sampled finer than any edge needs is averaged.
    group = max(1, int(coarsest_s / step_s * (1.0 + 1e-6)))
    kept = len(time_s) // group * group
    time_s = time_s[:kept].reshape(-1, group).mean(axis=1)
    return time_s, values[:, :kept].reshape(len(values), -1, group).mean(axis=2)


def _from_spectrum(
    measured: MeasuredSpectrum, instrument: Reflectometer
) -> tuple[FloatArray, FloatArray]:
    """Times and reflections of what an analyser measured."""
    z = (1.0 + measured.reflection) / np.where(
        measured.reflection == 1.0, 1e-12, 1.0 - measured.reflection
    )
    ratio = measured.reference_ohm / instrument.reference_ohm
    rho = (z * ratio - 1.0) / (z * ratio + 1.0)
    try:
        time_s, answer = step_answer(
            measured.frequency_hz, rho, instrument.rise_time_s, instrument.sample_period_s
        )
    except ValueError as error:
        field, _, reason = str(error).partition(" ")
        raise InputError(reason, field=field, value=float(measured.frequency_hz[0])) from None
    return time_s, answer[None]


def _window(
    time_s: FloatArray, rows: FloatArray, consist: Consist, instrument: Reflectometer
) -> tuple[FloatArray, FloatArray]:
    """The part of a trace that is looked at."""
    first_s = -0.5 * lead_in_s(instrument.rise_time_s)
    if time_s[0] > first_s:
        raise InputError(
            f"the trace must begin before its edge, at {first_s * 1e9:.0f} ns or earlier",
            field="time",
            value=float(time_s[0]),
        )
    echo_s = 2.0 * consist.bus_line().delay_s
    last_s = _WINDOW_FRACTION * echo_s + _EDGES * instrument.rise_time_s
    if time_s[-1] < last_s:
        raise InputError(
            f"the trace is too short: the echo of the far end comes at {echo_s * 1e9:.0f} ns,"
            f" {last_s * 1e9:.0f} ns are needed",
            field="time",
            value=float(time_s[-1]),
        )
    samples = instrument.samples_for(consist.bus_line().delay_s)
    start = int(np.searchsorted(time_s, -lead_in_s(instrument.rise_time_s)))
    end = start + max(samples, 16)
    return time_s[start:end], rows[:, start:end]


def print_diagnosis(diagnosis: Diagnosis, workshop: Workshop, console: Console) -> None:
    """Show the values of each car, the faults and the verdict."""
    table = Table(title="bus cable, car by car", title_justify="left", title_style="bold")
    for heading in ("car", "profile", "length m", "impedance ohm", "attenuation dB", "verdict"):
        side: Any = "right" if heading[-1] in "mB" else "left"
        table.add_column(heading, justify=side, no_wrap=True)
    for number, (name, verdict) in enumerate(
        zip(workshop.profiles, diagnosis.verdicts, strict=True), start=1
    ):
        table.add_row(
            str(number),
            name,
            _shown(verdict.measurement.length_m, 2),
            _shown(verdict.measurement.impedance_ohm, 1),
            _shown(verdict.measurement.attenuation_db, 2),
            verdict.status,
        )
    console.print(table)
    profiles = train_profiles(workshop.profiles)
    for number, (verdict, profile) in enumerate(
        zip(diagnosis.verdicts, profiles, strict=True), start=1
    ):
        for reason in judge(verdict.measurement, profile).reasons:
            console.print(f"car {number}: {reason}", soft_wrap=True, highlight=False)
    reading = diagnosis.reading
    if diagnosis.remark:
        console.print(f"fault: {diagnosis.remark}", soft_wrap=True, highlight=False)
    if reading.finding is None:
        if not diagnosis.remark:
            console.print("no fault found")
    else:
        doubt = "" if reading.is_explained else " (it does not explain all of the trace)"
        finding = reading.finding
        words = fault_words(finding.kind, finding.car, finding.place_m, size_of(finding))
        console.print(f"fault: {words}{doubt}", soft_wrap=True, highlight=False)
        for kind, probability in reading.alternatives[:3]:
            if probability >= 0.01:
                console.print(f"  or {kind.replace('_', ' ')}, {100.0 * probability:.0f} %")
    console.print("verdict: " + ("[green]pass[/green]" if diagnosis.passed else "[red]fail[/red]"))


def _shown(value: float | None, digits: int) -> str:
    if value is None:
        return "-"
    return f"{value:.{digits}f}" if math.isfinite(value) else "all"
