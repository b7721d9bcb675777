"""The workshop command: from files to figures, verdict, picture and exit code."""

from __future__ import annotations

import math
import runpy
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.cli.main import main
from rail_corridor.errors import InputError
from rail_corridor.workshop.workshop import Workshop, diagnose
from rail_signals.train_bus.bus_line import Termination
from rail_signals.train_bus.cascade import input_reflection
from rail_signals.train_bus.consist import Consist, Deviations
from rail_signals.train_bus.fault_words import fault_words, size_of
from rail_signals.train_bus.faults import (
    BadSplice,
    BusFault,
    LooseConnector,
    OpenCircuit,
    WrongCable,
)
from rail_signals.train_bus.profile import load_bus_profile
from rail_signals.train_bus.tdr.measured_trace import step_edge
from rail_signals.train_bus.tdr.reflectometer import Reflectogram, Reflectometer, measure_consist
from rail_signals.train_bus.train import cable_consist, train_consist

RISE_S = 20e-9
CM2 = Workshop(("CM2",))
TRAIN = Workshop(("CM2", "CM3", "CM4"))
Convert = Callable[[Reflectogram], np.ndarray]


def taken(
    consist: Consist, fault: BusFault | None = None, seed: int = 4, **changes: Any
) -> Reflectogram:
    """Four traces of a cable as built, told against its terminator's nominal value."""
    rng = np.random.default_rng(seed)
    instrument = Reflectometer(105.0, **changes)
    deviations = Deviations.draw(len(consist.runs), rng)
    return measure_consist(consist, deviations, instrument, rng, 4, fault)


def as_ohms(seen: Reflectogram) -> np.ndarray:
    return 105.0 * (1.0 + seen.reflection) / (1.0 - seen.reflection)


def as_volts(seen: Reflectogram) -> np.ndarray:
    return 2.5 * (seen.reflection + step_edge(seen.time_s, RISE_S))


def written(
    folder: Path, seen: Reflectogram, name: str = "reflection", convert: Convert | None = None
) -> Path:
    rows = seen.reflection if convert is None else convert(seen)
    names = [name, *(f"{name}_{k + 2}" for k in range(len(rows) - 1))]
    path = folder / f"{name}.csv"
    header = ",".join(("time_ns", *names))
    table = np.column_stack((seen.time_s * 1e9, rows.T))
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.7g")
    return path


def test_a_good_cable_passes_with_its_figures(tmp_path: Path) -> None:
    found = diagnose(written(tmp_path, taken(cable_consist("CM2"))), CM2)
    assert found.passed
    (verdict,) = found.verdicts
    assert verdict.measurement.length_m == pytest.approx(47.0, rel=0.03)
    assert verdict.measurement.impedance_ohm == pytest.approx(105.0, rel=0.05)
    # FACTS: a healthy 47 m run loses about 0.47 dB at 1 MHz.
    assert verdict.measurement.attenuation_db == pytest.approx(0.5, abs=0.15)


@pytest.mark.parametrize(
    ("name", "convert", "volts"),
    [("reflection", None, None), ("ohms", as_ohms, None), ("volts", as_volts, 2.5)],
)
def test_a_splice_is_found_in_every_unit(
    tmp_path: Path, name: str, convert: Convert | None, volts: float | None
) -> None:
    seen = taken(cable_consist("CM2"), BadSplice(23.0, 20.0))
    path = written(tmp_path, seen, name, convert)
    found = diagnose(path, replace(CM2, incident_v=volts))
    assert not found.passed
    assert found.reading.finding is not None
    assert found.reading.finding.kind == "bad_splice"
    assert found.reading.finding.place_m == pytest.approx(23.0, abs=0.5)
    assert size_of(found.reading.finding) == pytest.approx(20.0, rel=0.1)


def test_a_finer_and_longer_record_says_the_same(tmp_path: Path) -> None:
    consist = cable_consist("CM2")
    fine = taken(consist, BadSplice(23.0, 20.0), sample_period_s=1.1e-9)
    beyond = fine.time_s[-1] + 1.1e-9 * np.arange(1, 2000)
    rows = np.pad(fine.reflection, ((0, 0), (0, len(beyond))), mode="edge")
    longer = Reflectogram(np.concatenate((fine.time_s, beyond)), rows)
    found = diagnose(written(tmp_path, longer), CM2)
    assert found.reflectogram.sample_period_s == pytest.approx(4.4e-9, rel=1e-3)
    assert found.reading.finding is not None
    assert found.reading.finding.place_m == pytest.approx(23.0, abs=0.5)


def test_a_train_with_a_loose_coupler(tmp_path: Path) -> None:
    seen = taken(train_consist(TRAIN.profiles), LooseConnector(1, 8.0, 0.0, 0.3))
    found = diagnose(written(tmp_path, seen), TRAIN)
    assert [verdict.status for verdict in found.verdicts] == ["pass", "fail", "pass"]
    assert found.reading.finding is not None
    assert found.reading.finding.kind == "loose_connector"
    assert found.reading.finding.place_m == 94.0


def test_a_cable_of_the_wrong_length_fails_by_its_criteria(tmp_path: Path) -> None:
    found = diagnose(written(tmp_path, taken(cable_consist("CM4"))), CM2)
    assert not found.passed
    assert found.verdicts[0].status == "fail"


@pytest.mark.parametrize("length_m", [44.0, 50.5])
def test_a_cable_by_itself_may_have_any_length_within_its_limits(
    tmp_path: Path, length_m: float
) -> None:
    drawn = cable_consist("CM2")
    consist = replace(drawn, runs=(replace(drawn.runs[0], length_m=length_m),))
    found = diagnose(written(tmp_path, taken(consist)), CM2)
    assert found.passed
    assert found.verdicts[0].measurement.length_m == pytest.approx(length_m, rel=0.03)


def test_an_end_that_is_not_what_it_should_be_is_said(tmp_path: Path) -> None:
    consist = replace(cable_consist("CM2"), termination=Termination(1e6))
    found = diagnose(written(tmp_path, taken(consist)), CM2)
    assert not found.passed
    assert found.reading.finding is None
    assert found.remark.startswith("the cable is open at 46.")
    assert found.remark.endswith("m, not terminated")


def test_a_cut_and_what_lies_behind_it(tmp_path: Path) -> None:
    seen = taken(train_consist(TRAIN.profiles), OpenCircuit(60.0))
    found = diagnose(written(tmp_path, seen), TRAIN)
    assert [verdict.status for verdict in found.verdicts] == ["pass", "fail", "not seen"]
    assert not found.passed
    assert found.verdicts[1].measurement.length_m == pytest.approx(13.0, abs=0.5)
    assert found.verdicts[1].measurement.attenuation_db == math.inf


@pytest.mark.parametrize("end", ["open", "short"])
def test_a_cable_whose_end_is_open_or_shorted_on_purpose(tmp_path: Path, end: str) -> None:
    consist = replace(cable_consist("CM2"), termination=Termination(1e6 if end == "open" else 0.01))
    path = written(tmp_path, taken(consist, seed=1))
    assert diagnose(path, replace(CM2, end=end)).passed  # type: ignore[arg-type]
    assert not diagnose(path, CM2).passed


def test_touchstone_says_the_same_as_a_reflectometer(tmp_path: Path) -> None:
    line = BadSplice(23.0, 20.0).apply(cable_consist("CM2").bus_line())
    frequency_hz = 1e5 * np.arange(1, 1200)
    rho = input_reflection(line, frequency_hz, 50.0)
    path = tmp_path / "cable.s1p"
    lines = ["# Hz S RI R 50"]
    lines += [f"{f:.0f} {r.real:.9f} {r.imag:.9f}" for f, r in zip(frequency_hz, rho, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    found = diagnose(path, CM2).reading.finding
    assert found is not None
    assert found.kind == "bad_splice"
    assert found.place_m == pytest.approx(23.0, abs=0.5)
    assert found.values["resistance_ohm"] == pytest.approx(20.0, rel=0.1)
    path.write_text("\n".join(lines[:400]) + "\n")
    with pytest.raises(InputError, match=r"cable.s1p: frequency_hz: 100000.0: must reach 7.58e"):
        diagnose(path, CM2)


GOOD = taken(cable_consist("CM2"))


def part(start: int, stop: int | None, step: int = 1) -> Reflectogram:
    return Reflectogram(GOOD.time_s[start:stop:step], GOOD.reflection[:, start:stop:step])


BAD: dict[str, tuple[Callable[[Path], Path], str]] = {
    "too short": (
        lambda folder: written(folder, part(0, 90)),
        r"time: 4.*e-07: the trace is too short: the echo of the far end comes at 475 ns",
    ),
    "begins after its edge": (
        lambda folder: written(folder, part(10, None)),
        r"time: 1.*e-08: the trace must begin before its edge, at -20 ns or earlier",
    ),
    "too coarse": (
        lambda folder: written(folder, part(0, None, 3)),
        r"time: 1.5.*e-08: samples must be 5e-09 s apart or closer.*is the unit of the time right",
    ),
    "volts as reflection": (
        lambda folder: written(folder, GOOD, "reflection", as_volts),
        r"reflection: 2\.\d+: a reflection lies within -1.5 and 1.5; is the unit right",
    ),
    "negative ohms": (
        lambda folder: written(folder, GOOD, "ohms", lambda seen: -as_ohms(seen)),
        r"ohms: -1\d\d\.\d+: must be 0 or more",
    ),
    "volts of no size": (
        lambda folder: written(folder, GOOD, "volts", as_volts),
        r"traces in volts need the size of the edge, --incident-v",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_a_trace_that_cannot_be_used_is_one_line(tmp_path: Path, kind: str) -> None:
    make, line = BAD[kind]
    path = make(tmp_path)
    with pytest.raises(InputError, match=line) as caught:
        diagnose(path, CM2)
    assert str(caught.value).startswith(f"{path}: ")
    assert str(caught.value).isprintable()


def test_the_example_is_what_the_code_makes_and_says_what_it_should(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    examples = Path(__file__).resolve().parents[3] / "examples"
    path = tmp_path / "made.csv"
    monkeypatch.setattr("sys.argv", ["bus_trace.py", str(path)])
    runpy.run_path(str(examples / "bus_trace.py"), run_name="__main__")
    kept = examples / "bad_splice.csv"
    made, stored = (np.loadtxt(p, delimiter=",", skiprows=2) for p in (path, kept))
    np.testing.assert_allclose(made, stored, atol=2e-5)
    found = diagnose(kept, CM2)
    assert not found.passed
    assert found.reading.finding is not None
    assert found.reading.finding.kind == "bad_splice"
    assert found.reading.finding.place_m == pytest.approx(23.0, abs=0.2)
    assert size_of(found.reading.finding) == pytest.approx(20.0, rel=0.05)


def run(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run ``rail tdr`` in this process; return its exit code."""
    monkeypatch.setattr("sys.argv", ["rail", "tdr", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def test_the_command_prints_draws_and_tells_by_its_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    good = written(tmp_path, GOOD)
    assert run(monkeypatch, good, "--profile", "cm2") == 0
    printed = capsys.readouterr().out
    assert "no fault found" in printed
    assert "verdict: pass" in printed
    bad = written(tmp_path, taken(cable_consist("CM2"), BadSplice(23.0, 20.0)))
    picture = tmp_path / "cable.png"
    assert run(monkeypatch, bad, "--profile", "CM2", "--out", picture) == 1
    printed = capsys.readouterr().out
    assert "fault: bad splice in car 1 at 2" in printed
    assert "verdict: fail" in printed
    assert picture.read_bytes().startswith(b"\x89PNG")
    loose = taken(train_consist(TRAIN.profiles), LooseConnector(1, 8.0, 0.0, 0.3))
    path = written(tmp_path, loose)
    drawn = tmp_path / "train.svg"
    assert run(monkeypatch, path, "--profile", "CM2,CM3,CM4", "--out", drawn) == 1
    assert "loose connector behind car 2" in drawn.read_text()


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (("none.csv", "--profile", "CM2"), "none.csv: there is no such file"),
        (("good.csv", "--profile", "CM9"), "--profile: 'CM9': must be one of cm2, cm3, cm4"),
        (("good.csv", "--profile", ""), "--profile: '': must be one of cm2"),
        (("good.csv", "--profile", "CM2", "--end", "loose"), "--end: 'loose': must be one of"),
        (("good.csv", "--profile", "CM2", "--rise-ns", "nan"), "--rise-ns: nan: must be from 0.1"),
        (("good.csv", "--profile", "CM2", "--incident-v", "0"), "--incident-v: 0: must be from"),
        (("good.csv", "--profile", "CM2", "--out", "a.doc"), "--out: a.doc: must end in .png"),
        (("good.csv", "--profile", "CM2", "--out", "x/a.png"), "--out: x/a.png: there is no"),
        (("good.csv",), "Missing option '--profile'"),
    ],
)
def test_wrong_use_is_one_line_and_exit_code_2(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: tuple[str, ...],
    line: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path, GOOD).rename("good.csv")
    assert run(monkeypatch, *arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("rail: ")
    assert line in printed.err
    assert printed.err.count("\n") == 1


def test_a_wrong_cable_in_words() -> None:
    other = load_bus_profile("polyethylene").cable
    seen = taken(train_consist(TRAIN.profiles), WrongCable(1, other))
    assert seen.reflection.shape[0] == 4
    assert fault_words("wrong_cable", 1, 47.0, 0.143) == (
        "wrong cable in car 2 at 47.0 m, 14 % of impedance off"
    )
