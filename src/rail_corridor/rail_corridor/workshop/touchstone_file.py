"""One-port Touchstone files (``.s1p``, version 1): what a network analyser has written.

An option line, ``# MHz S RI R 50``, tells the unit of the frequency, the parameter, the format
and the reference; then each line has a frequency and two numbers; ``!`` begins a comment. That is
all there is to a file of one port, and less than a library for it would bring along: scikit-rf,
against which the tests hold this reader, comes with pandas.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rail_corridor.errors import InputError

_UNITS: Final = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6, "GHZ": 1e9}
_FORMATS: Final[dict[str, Callable[[float, float], complex]]] = {
    "RI": complex,
    "MA": lambda size, degrees: size * _turn(degrees),
    "DB": lambda decibel, degrees: 10 ** min(decibel / 20, 300.0) * _turn(degrees),
}
_WANTED: Final = "must be '# [Hz|kHz|MHz|GHz] S [RI|MA|DB] R ohm'"
_LEAST_POINTS: Final = 16
_MOST: Final = 1.5
_LARGEST: Final = 1e15
"""No number of a one-port, whatever its unit, is larger."""


@dataclass(frozen=True)
class MeasuredSpectrum:
    """Reflection of the head over frequency.

    Parameters
    ----------
    frequency_hz : float64 [frequencies]
    reflection : complex [frequencies]
    reference_ohm
        Impedance it is told against.
    """

    frequency_hz: NDArray[np.float64]
    reflection: NDArray[np.complex128]
    reference_ohm: float


def parse_touchstone(text: str) -> MeasuredSpectrum:
    r"""Read the text of a one-port file.

    Raises
    ------
    InputError
        One line that names the line, the field and the value.

    Examples
    --------
    >>> rows = "".join(f"{f} 1.0 -90.0\n" for f in range(1, 20))
    >>> read = parse_touchstone("! open, quarter wave\n# MHz S MA R 50\n" + rows)
    >>> float(read.frequency_hz[0]), complex(read.reflection[0].round(9)), read.reference_ohm
    (1000000.0, -1j, 50.0)
    """
    unit, number_of, reference = 1e9, _FORMATS["MA"], 50.0  # as the format has it
    options = False
    frequencies: list[float] = []
    values: list[complex] = []
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.split("!")[0].strip()
        if line.startswith("["):
            raise InputError("only version 1 is read", field=f"line {number}", value=line)
        if line.startswith("#"):
            if not options:  # the format ignores any further one
                unit, number_of, reference = _options(line, number)
            options = True
        elif line:
            cells = line.split()
            if len(cells) != 3:
                raise InputError(
                    "a frequency and two numbers are wanted", field=f"line {number}", value=line
                )
            f, a, b = (_number(cell, number) for cell in cells)
            if frequencies and f * unit <= frequencies[-1]:
                raise InputError(
                    "frequencies must rise", field=f"line {number}, frequency", value=cells[0]
                )
            value = number_of(a, b)
            if abs(value) > _MOST:
                raise InputError(
                    f"no cable reflects more than {_MOST:g}; is this S11, in the format it says",
                    field=f"line {number}",
                    value=line,
                )
            frequencies.append(f * unit)
            values.append(value)
    if len(values) < _LEAST_POINTS:
        raise InputError(f"has {len(values)} frequencies, {_LEAST_POINTS} or more are needed")
    return MeasuredSpectrum(np.array(frequencies), np.array(values), reference)


def _options(line: str, number: int) -> tuple[float, Callable[[float, float], complex], float]:
    """Unit, format and reference of an option line, in any order and any case."""
    unit, number_of, reference = 1e9, _FORMATS["MA"], 50.0
    words = iter(line[1:].upper().split())
    for word in words:
        if word in _UNITS:
            unit = _UNITS[word]
        elif word in _FORMATS:
            number_of = _FORMATS[word]
        elif word == "R":
            reference = _number(next(words, ""), number)
            if reference <= 0.0:
                raise InputError("must be above 0", field=f"line {number}, R", value=reference)
        elif word != "S":
            raise InputError(_WANTED, field=f"line {number}", value=line)
    return unit, number_of, reference


def _number(cell: str, line: int) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST:
        raise InputError("must be a number", field=f"line {line}", value=cell)
    return value


def _turn(degrees: float) -> complex:
    angle = math.radians(degrees)
    return complex(math.cos(angle), math.sin(angle))
