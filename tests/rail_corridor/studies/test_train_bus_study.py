"""The study of the train bus: what is found, what is taken for what, and from which size on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rail_corridor.errors import InputError
from rail_corridor.studies import train_bus
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.studies.train_bus import (
    CONDITIONS,
    SIZES,
    TrainBusLimitParameters,
    TrainBusParameters,
    examine_train_bus,
    find_detectable_size,
)
from rail_corridor.study.cells import cells_of
from rail_corridor.study.sources import checked
from rail_corridor.study.study_file import load_study
from rail_signals.train_bus.faults import BadSplice, WaterIngress
from rail_signals.train_bus.study.campaign import HEALTHY, Case, draw_case, examine
from rail_signals.train_bus.study.detection_limits import detectable_size

REPORTED = [f"reported_{each}" for each in CONDITIONS]


class Interpreter:
    """Reports by the script, one train after the other, and keeps the trains."""

    def __init__(self, *reports: tuple[str, bool]) -> None:
        self._reports = list(reports)
        self.cases: list[Case] = []

    def __call__(self, case: Case, _: np.random.Generator) -> Any:
        self.cases.append(case)
        reported, located = self._reports.pop(0)
        return SimpleNamespace(reported=reported, is_located=located)


def examined(
    monkeypatch: pytest.MonkeyPatch, fault: str, *reports: tuple[str, bool], seed: int = 0
) -> tuple[Mapping[str, float], list[Case]]:
    """Return the figures of a run whose trains are reported by the script, and the trains."""
    interpreter = Interpreter(*reports)
    monkeypatch.setattr(train_bus, "examine", interpreter)
    parameters = TrainBusParameters(fault=fault, trains=len(reports))
    return examine_train_bus(parameters, seed), interpreter.cases


def test_what_is_reported_of_faults_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    reports = ("open", True), ("short", True), ("open", False), (HEALTHY, False), ("open", True)
    figures, _ = examined(monkeypatch, "open", *reports)
    assert {name: value for name, value in figures.items() if value} == {
        "examined": 5,
        "faulty": 5,
        "found": 4,
        "located": 3,
        "named": 3,
        "reported_open": 3,
        "reported_short": 1,
        "reported_healthy": 1,
    }


def test_a_report_of_a_healthy_train_is_a_flag(monkeypatch: pytest.MonkeyPatch) -> None:
    figures, _ = examined(monkeypatch, HEALTHY, (HEALTHY, False), ("open", False), ("short", True))
    assert {name: value for name, value in figures.items() if value} == {
        "examined": 3,
        "healthy": 3,
        "flagged": 2,
        "reported_healthy": 1,
        "reported_open": 1,
        "reported_short": 1,
    }


@pytest.mark.parametrize("fault", CONDITIONS)
def test_every_train_is_in_one_column_of_the_table(
    monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    figures, _ = examined(monkeypatch, fault, *((each, True) for each in CONDITIONS))
    assert [figures[name] for name in REPORTED] == [1] * len(CONDITIONS)
    assert sum(figures[name] for name in REPORTED) == figures["examined"] == len(CONDITIONS)
    assert figures["faulty"] + figures["healthy"] == figures["examined"]
    assert figures["named"] == (0 if fault == HEALTHY else 1)


def test_runs_go_on_where_the_one_before_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trains of two runs of two are those of four runs of one, and all of them differ."""
    report = ("open", True)
    together = [examined(monkeypatch, "open", report, report, seed=seed)[1] for seed in (0, 1)]
    alone = [examined(monkeypatch, "open", report, seed=seed)[1][0] for seed in range(4)]
    assert [repr(each) for run in together for each in run] == [repr(each) for each in alone]
    assert len({repr(each) for each in alone}) == 4
    other = examined(monkeypatch, "short", report)[1][0]
    assert other.kind == "short" and other.consist.length_m != alone[0].consist.length_m


def test_a_train_is_examined_as_in_the_campaign() -> None:
    figures = examine_train_bus(TrainBusParameters(fault="open"), 3)
    rng = np.random.default_rng([2, 0, 3])
    result = examine(draw_case("open", rng, 60.0), rng)
    assert result.reported == "open" and result.is_located
    assert [figures[name] for name in ("found", "located", "named", "reported_open")] == [1] * 4


def test_the_ratio_of_signal_to_noise_is_that_of_the_instrument(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    interpreter = Interpreter(("open", True), ("open", True))
    monkeypatch.setattr(train_bus, "examine", interpreter)
    for snr_db in (40.0, 60.0):
        examine_train_bus(TrainBusParameters(fault="open", snr_db=snr_db), 1)
    loud, quiet = (case.instrument.noise_rms for case in interpreter.cases)
    assert loud / quiet == pytest.approx(10.0)


@pytest.mark.parametrize(("kind", "unit"), [("bad_splice", 1.0), ("water_ingress", 0.01)])
def test_a_size_is_in_the_unit_of_its_kind(kind: Any, unit: float) -> None:
    figures = find_detectable_size(TrainBusLimitParameters(kind=kind, snr_db=50.0), 4)
    rng = np.random.default_rng([1, 100 + list(SIZES).index(kind), 4])
    expected = detectable_size(draw_case(kind, rng, 50.0), rng, 0.5)
    assert figures == {"size": pytest.approx(expected / unit), "found": None}


def test_with_less_noise_less_is_found() -> None:
    sizes = [
        find_detectable_size(TrainBusLimitParameters(kind="bad_splice", snr_db=snr_db), 4)["size"]
        for snr_db in (40.0, 60.0)
    ]
    assert None not in sizes
    assert sizes[1] < 0.9 * sizes[0]  # type: ignore[operator]


def test_a_fault_of_the_size_asked_for_is_looked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(train_bus, "detectable_size", lambda *_: math.nan)
    interpreter = Interpreter(("short", False), (HEALTHY, False))
    monkeypatch.setattr(train_bus, "examine", interpreter)
    splice = TrainBusLimitParameters(kind="bad_splice", of_size=7.0)
    water = TrainBusLimitParameters(kind="water_ingress", of_size=30.0)
    assert find_detectable_size(splice, 0)["found"] is True  # whatever it is taken for
    assert find_detectable_size(water, 0)["found"] is False
    one, other = (case.fault for case in interpreter.cases)
    assert isinstance(one, BadSplice) and one.resistance_ohm == 7.0
    assert isinstance(other, WaterIngress)
    assert other.capacitance_rise == pytest.approx(0.3)


def test_the_study_file_has_300_faults_of_each_kind_and_600_healthy_trains(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    study, source = load_study("train_bus", FOLDER, GENERATORS, CALCULATIONS)
    trains = {cell["fault"]: study.runs * cell["trains"] for cell in cells_of(study)}
    assert trains == {kind: 600 if kind == HEALTHY else 300 for kind in CONDITIONS}
    for cell in cells_of(study):
        interpreter = Interpreter(*[(cell["fault"], True)] * cell["trains"])
        monkeypatch.setattr(train_bus, "examine", interpreter)
        _, figures = source.run(cell, study.first_seed, study.figures)
        assert sum(figures[name] or 0.0 for name in REPORTED) == cell["trains"]


def test_the_study_files_of_the_limits_have_every_case_and_the_same_ones() -> None:
    names = "train_bus_limits", "train_bus_limits_check"
    (limits, source), (check, _) = (
        load_study(name, FOLDER, GENERATORS, CALCULATIONS) for name in names
    )
    cells = [(cell["kind"], cell["snr_db"]) for cell in cells_of(limits)]
    assert [(cell["kind"], cell["snr_db"]) for cell in cells_of(check)] == cells
    assert {*cells} == {(kind, snr_db) for kind in SIZES for snr_db in (40, 50, 60, 70)}
    _, figures = source.run(cells_of(limits)[0], limits.first_seed, limits.figures)
    assert len({*figures.values()}) == 1 and None not in figures.values()
    assert {*check.figures} == {"found"}


@pytest.mark.parametrize(
    ("model", "values", "said"),
    [
        (
            TrainBusParameters,
            {"fault": "opne"},
            "fault: 'opne': .*no such fault, did you mean open",
        ),
        (TrainBusParameters, {"trains": 0}, "trains: 0: "),
        (TrainBusLimitParameters, {"kind": "open"}, "kind: 'open': must be 'bad_splice'"),
        (TrainBusLimitParameters, {"of_size": 0.0}, "of_size: 0.0: "),
        (TrainBusLimitParameters, {"size": 1.0}, "size: 1.0: there is no such field"),
    ],
)
def test_what_there_is_not_is_one_line_that_names_the_field(
    model: Any, values: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=f"^{said}") as caught:
        checked(model, values)
    assert "\n" not in str(caught.value)
