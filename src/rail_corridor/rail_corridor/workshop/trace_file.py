"""Reflectograms as files: what an instrument in the workshop has written.

CSV: a header, then numbers; ``#`` begins a comment; commas, semicolons or tabs between the
columns. The first column is ``time_s``, ``time_us`` or ``time_ns``, evenly spaced, 0 being when
the middle of the edge enters the cable. The others are all of one quantity, one column for each
trace, named ``reflection`` (reflected over incident wave), ``ohms`` (impedance as the instrument
shows it) or ``volts`` (at its output, incident and reflected wave together); ``reflection_2`` and
so on for more.

A file whose name ends in ``.s1p`` is read as Touchstone: see `touchstone_file`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from rail_corridor.errors import InputError
from rail_corridor.yaml_file import read_text_file
from rail_signals.arrays import FloatArray

from .touchstone_file import MeasuredSpectrum, parse_touchstone

Quantity = Literal["reflection", "ohms", "volts"]

_TIMES: Final = {"time_s": 1.0, "time_us": 1e-6, "time_ns": 1e-9}
_QUANTITIES: Final = ("reflection", "ohms", "volts")
_HEADER: Final = "must be time_s, time_us or time_ns, then reflection, ohms or volts"
_LEAST_SAMPLES: Final = 16
#: Steps of the time may differ by so much, as printed with few digits.
_UNEVEN: Final = 0.02


@dataclass(frozen=True)
class MeasuredTrace:
    """Traces over time.

    Parameters
    ----------
    time_s : float64 [samples]
    values : float64 [traces, samples]
    quantity
        What the values are.
    """

    time_s: FloatArray
    values: FloatArray
    quantity: Quantity


def read_measurement(path: Path) -> MeasuredTrace | MeasuredSpectrum:
    """Read a CSV or, by its ending, a Touchstone file.

    Raises
    ------
    InputError
        One line that names the file, the field and the value.
    """
    if path.suffix.lower() in (".s2p", ".s3p", ".s4p"):
        raise InputError("one port is wanted, .s1p", file=str(path))
    try:
        parse = parse_touchstone if path.suffix.lower() == ".s1p" else _parse
        return parse(read_text_file(path))
    except InputError as error:
        raise error.located(str(path)) from None


def _parse(text: str) -> MeasuredTrace:
    lines = [(n, line.split("#")[0].strip()) for n, line in enumerate(text.splitlines(), 1)]
    lines = [(number, line) for number, line in lines if line]
    if not lines:
        raise InputError("is empty")
    first, header = lines[0]
    separator = next((mark for mark in ";\t" if mark in header), ",")
    names = [name.strip().strip('"').lower() for name in header.split(separator)]
    quantity = _quantity(names, first, header)
    if len(lines) - 1 < _LEAST_SAMPLES:
        raise InputError(f"has {len(lines) - 1} samples, {_LEAST_SAMPLES} or more are needed")
    table = np.empty((len(lines) - 1, len(names)))
    for row, (number, line) in zip(table, lines[1:], strict=True):
        cells = line.split(separator)
        if len(cells) != len(names):
            raise InputError(f"{len(names)} numbers are wanted", field=f"line {number}", value=line)
        for column, cell in enumerate(cells):
            row[column] = _number(cell, f"line {number}, {names[column]}")
    time_s = table[:, 0] * _TIMES[names[0]]
    _check_time(time_s, table[:, 0], names[0], [number for number, _ in lines[1:]])
    return MeasuredTrace(time_s, np.ascontiguousarray(table[:, 1:].T), quantity)


def _quantity(names: list[str], line: int, header: str) -> Quantity:
    bases = [name.rstrip("0123456789").rstrip("_") for name in names[1:]]
    known = names[0] in _TIMES and bool(bases)
    if not known or bases[0] not in _QUANTITIES or len(set(bases)) > 1:
        raise InputError(_HEADER, field=f"line {line}", value=header)
    return bases[0]  # type: ignore[return-value]


def _number(cell: str, field: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        raise InputError("must be a number", field=field, value=cell.strip()) from None
    if not math.isfinite(value):
        raise InputError("must be a finite number", field=field, value=cell.strip())
    return value


def _check_time(time_s: FloatArray, printed: FloatArray, name: str, lines: list[int]) -> None:
    """See that the time rises evenly."""
    steps = np.diff(time_s)
    step = float(np.median(steps))
    wrong = np.flatnonzero(~(np.abs(steps - step) <= _UNEVEN * abs(step)) | (steps <= 0.0))
    if wrong.size:
        at = int(wrong[0]) + 1
        raise InputError(
            "the time must rise evenly", field=f"line {lines[at]}, {name}", value=float(printed[at])
        )
