"""One-port Touchstone files: what is read, against scikit-rf, and what wrong ones get."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rail_corridor.errors import InputError
from rail_corridor.workshop.touchstone_file import MeasuredSpectrum
from rail_corridor.workshop.trace_file import read_measurement

TOUCHSTONE = ["! an analyser", "# MHz S RI R 100", *(f"{k} 0.{k:03d} -0.1" for k in range(1, 51))]


def written(folder: Path, lines: list[str], name: str = "cable.s1p") -> Path:
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def read(path: Path) -> MeasuredSpectrum:
    found = read_measurement(path)
    assert isinstance(found, MeasuredSpectrum)
    return found


@pytest.mark.parametrize("options", ["# MHz S RI R 100", "# R 100 ri s mhz"])
def test_a_file(tmp_path: Path, options: str) -> None:
    lines = [TOUCHSTONE[0], options, *TOUCHSTONE[2:], "# GHz S MA R 50"]
    found = read(written(tmp_path, lines, "cable.S1P"))
    assert found.frequency_hz == pytest.approx(1e6 * np.arange(1, 51))
    assert found.reflection[6] == pytest.approx(0.007 - 0.1j)
    assert found.reference_ohm == 100.0


@pytest.mark.parametrize(
    "options",
    [
        "# Hz S RI R 50",
        "# kHz S MA R 75",
        "# MHz S DB R 105",
        "# ghz s ri r 120.5",
        "#",
    ],
)
def test_every_option_line_as_scikit_rf_reads_it(tmp_path: Path, options: str) -> None:
    rf = pytest.importorskip("skrf", reason="scikit-rf, of the extra 'dev', is not installed")
    rng = np.random.default_rng(1)
    first, second = rng.uniform(-0.7, 0.7, (2, 40))
    rows = [
        f"{k + 1} {a:.6f} {b:.6f} ! {k}" for k, (a, b) in enumerate(zip(first, second, strict=True))
    ]
    path = written(tmp_path, ["! comment", options, "", *rows])
    ours, theirs = read(path), rf.Network(str(path))
    np.testing.assert_allclose(ours.frequency_hz, theirs.f, rtol=1e-15)
    np.testing.assert_allclose(ours.reflection, theirs.s[:, 0, 0], rtol=1e-14)
    assert ours.reference_ohm == theirs.z0[0, 0]


@pytest.mark.parametrize(
    ("lines", "name", "complaint"),
    [
        ([], "a.s1p", "has 0 frequencies, 16 or more are needed"),
        (TOUCHSTONE[:10], "a.s1p", "has 8 frequencies, 16 or more are needed"),
        ([*TOUCHSTONE, "51 what -0.1"], "a.s1p", "line 53: 'what': must be a number"),
        ([*TOUCHSTONE, "51 nan -0.1"], "a.s1p", "line 53: 'nan': must be a number"),
        ([*TOUCHSTONE, "51 -0.1"], "a.s1p", "line 53: '51 -0.1': a frequency and two numbers"),
        ([*TOUCHSTONE, "50 0.1 0.1"], "a.s1p", "line 53, frequency: '50': frequencies must rise"),
        ([*TOUCHSTONE, "51 9 0.1"], "a.s1p", "line 53: '51 9 0.1': no cable reflects more"),
        (["# MHz S DB", "1 1e9 0"], "a.s1p", "line 2: '1 1e9 0': no cable reflects more"),
        (["# MHz Z RI R 50"], "a.s1p", "line 1: '# MHz Z RI R 50': must be '# [Hz"),
        (["# MHz S RI R"], "a.s1p", "line 1: '': must be a number"),
        (["# MHz S RI R 0"], "a.s1p", "line 1, R: 0.0: must be above 0"),
        (["[Version] 2.0"], "a.s1p", "line 1: '[Version] 2.0': only version 1 is read"),
        (["time_ns,reflection", "1,2"], "a.s1p", "line 1: 'time_ns,reflection': a frequency"),
        (TOUCHSTONE, "a.s2p", "one port is wanted, .s1p"),
    ],
)
def test_what_is_wrong_is_one_line(
    tmp_path: Path, lines: list[str], name: str, complaint: str
) -> None:
    path = written(tmp_path, lines, name)
    with pytest.raises(InputError) as caught:
        read_measurement(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert complaint in message
    assert message.isprintable()
