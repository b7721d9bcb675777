"""Reflectograms as files: what is read, and the one line that wrong ones get."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rail_corridor.errors import InputError
from rail_corridor.workshop.trace_file import MeasuredTrace, read_measurement

COUNT = 40


def rows(header: str = "time_ns,reflection", separator: str = ",") -> list[str]:
    lines = [header]
    lines += [separator.join((f"{5 * k - 40}", f"{0.01 * k:.4f}")) for k in range(COUNT)]
    return lines


def written(folder: Path, lines: list[str] | str, name: str = "trace.csv") -> Path:
    path = folder / name
    path.write_text(lines if isinstance(lines, str) else "\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(("unit", "scale"), [("time_s", 1.0), ("time_us", 1e-6), ("time_ns", 1e-9)])
def test_times_in_every_unit(tmp_path: Path, unit: str, scale: float) -> None:
    found = read_measurement(written(tmp_path, rows(f"{unit},reflection")))
    assert isinstance(found, MeasuredTrace)
    assert found.time_s == pytest.approx((5.0 * np.arange(COUNT) - 40.0) * scale)
    assert found.values.shape == (1, COUNT)
    assert found.values[0] == pytest.approx(0.01 * np.arange(COUNT))


@pytest.mark.parametrize("quantity", ["reflection", "ohms", "volts"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_quantities_separators_comments_and_blank_lines(
    tmp_path: Path, quantity: str, separator: str
) -> None:
    lines = rows(separator.join(("Time_ns", quantity.upper())), separator)
    lines = ["# instrument 7", "", *lines[:5], "  # a pause", *lines[5:], ""]
    found = read_measurement(written(tmp_path, lines))
    assert isinstance(found, MeasuredTrace)
    assert found.quantity == quantity
    assert found.values.shape == (1, COUNT)


def test_several_traces(tmp_path: Path) -> None:
    lines = ["time_ns,reflection,reflection_2,reflection_3"]
    lines += [f"{5 * k},{0.1},{0.2},{0.3}" for k in range(COUNT)]
    found = read_measurement(written(tmp_path, lines))
    assert isinstance(found, MeasuredTrace)
    assert found.values[:, 0].tolist() == [0.1, 0.2, 0.3]


def changed(line: int, text: str) -> list[str]:
    """Good lines with one changed; 1 is the header."""
    lines = rows()
    lines[line - 1] = text
    return lines


BAD = {
    "empty": ("", "is empty"),
    "only comments": ("# nothing\n\n", "is empty"),
    "no header": (
        rows()[1:],
        "line 1: '-40,0.0000': must be time_s, time_us or time_ns, then reflection, ohms or volts",
    ),
    "unknown unit": (rows("time_ms,reflection"), "line 1: 'time_ms,reflection': must be time_s"),
    "unknown quantity": (rows("time_ns,rho"), "line 1: 'time_ns,rho': must be time_s"),
    "two quantities": (
        ["time_ns,reflection,ohms", *(f"{k},0.1,100" for k in range(COUNT))],
        "line 1: 'time_ns,reflection,ohms': must be",
    ),
    "word": (changed(9, "-5,open"), "line 9, reflection: 'open': must be a number"),
    "NaN": (changed(9, "-5,nan"), "line 9, reflection: 'nan': must be a finite number"),
    "infinite": (changed(9, "inf,0.1"), "line 9, time_ns: 'inf': must be a finite number"),
    "gap": (changed(9, "-5,"), "line 9, reflection: '': must be a number"),
    "too many cells": (changed(9, "-5,0.1,0.2"), "line 9: '-5,0.1,0.2': 2 numbers are wanted"),
    "too few cells": (changed(9, "-5"), "line 9: '-5': 2 numbers are wanted"),
    "decimal comma": (changed(9, "-5,0,1"), "line 9: '-5,0,1': 2 numbers are wanted"),
    "time stands": (changed(9, "-10,0.1"), "line 9, time_ns: -10.0: the time must rise evenly"),
    "time falls": (
        [rows()[0], *reversed(rows()[1:])],
        "line 3, time_ns: 150.0: the time must rise evenly",
    ),
    "sample missing": ([*rows()[:8], *rows()[9:]], "time_ns: 0.0: the time must rise evenly"),
    "short": (rows()[:12], "has 11 samples, 16 or more are needed"),
    "null byte": ("time_ns,reflection\0\n", "has a null byte"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_wrong_is_one_line_that_names_file_place_and_value(
    tmp_path: Path, kind: str
) -> None:
    lines, complaint = BAD[kind]
    path = written(tmp_path, lines)
    with pytest.raises(InputError) as caught:
        read_measurement(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert complaint in message
    assert message.isprintable()


def test_files_that_are_none(tmp_path: Path) -> None:
    for name in ("none.csv", "none.s1p"):
        with pytest.raises(InputError, match=f"{name}: there is no such file"):
            read_measurement(tmp_path / name)
    with pytest.raises(InputError, match="is a directory"):
        read_measurement(tmp_path)
    (tmp_path / "bytes.csv").write_bytes(b"\xff\xfe\x00\x80" * 50)
    with pytest.raises(InputError, match=r"bytes\.csv: is not UTF-8 text"):
        read_measurement(tmp_path / "bytes.csv")
