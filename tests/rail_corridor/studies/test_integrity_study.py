"""The study of integrity: each figure is its own count, and of what the parameters ask for."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from rail_corridor.errors import InputError
from rail_corridor.studies import integrity
from rail_corridor.studies.integrity import FAULTS, IntegrityParameters, count_integrity
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.study.cells import cells_of
from rail_corridor.study.sources import checked
from rail_corridor.study.study_file import load_study
from rail_signals.localizer.localizer import Localizer
from rail_signals.localizer.protection_level import Estimate
from rail_signals.localizer.settings import LocalizerSettings, Sensor
from rail_signals.localizer.study import campaign
from rail_signals.localizer.study.campaign import Tally, stated_s
from rail_signals.localizer.study.faults import FaultKind
from rail_signals.localizer.study.simulation import SimulatedLine
from rail_signals.localizer.study.worlds import AS_BELIEVED, WORLDS

COUNTS = (
    *("positions", "claimed", "protected", "misleading", "misleading_runs", "misleading_speeds"),
    *("false_alarms", "wrong_exclusions", "due", "late", "excluded"),
)
DELAYS_S = np.array([4.0, 0.0, 1.0, 3.0, 2.0])


class Asked:
    """Stands for the campaign: keeps what it is asked for, counts what it is given."""

    def __init__(self) -> None:
        self.counted = Tally(
            Sensor.RANGE,
            FaultKind.BIAS,
            **{name: 100 + number for number, name in enumerate(COUNTS)},
            healthy_s=9000.0,
            delays_s=DELAYS_S,
            protection_m=np.arange(101.0),
            error_m=np.array([3.0, -4.0]),
            reasons=(),
        )

    def __call__(self, *positional: Any, **named: Any) -> Tally:
        self.positional, self.named = positional, named
        return self.counted


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> Asked:
    """Return what stands for the campaign."""
    stand_in = Asked()
    monkeypatch.setattr(integrity, "tally", stand_in)
    return stand_in


def test_each_figure_is_its_own_count(asked: Asked) -> None:
    figures = dict(count_integrity(IntegrityParameters(fault="range bias"), 1))
    assert figures.pop("misleading_trains") == 100 + COUNTS.index("misleading_runs")
    for number, name in enumerate(COUNTS):
        if name != "misleading_runs":
            assert figures.pop(name) == 100 + number, name
    assert figures == {
        "healthy_h": 2.5,
        "delay_p50_s": 2.0,
        "delay_p95_s": 4.0,
        "delay_max_s": 4.0,
        "stated_s": stated_s(Sensor.RANGE, FaultKind.BIAS),
        "protection_mean_m": 50.0,
        "protection_p95_m": 95.0,
        "rmse_m": pytest.approx(math.sqrt(12.5)),
    }
    # What the campaign counts is in the figures, but for why nothing was claimed.
    assert {each.name for each in fields(Tally)} == {
        *(*COUNTS, "sensor", "kind", "healthy_s", "delays_s", "protection_m", "error_m", "reasons")
    }


def test_what_is_not_known_is_no_number(asked: Asked) -> None:
    asked.counted = replace(asked.counted, delays_s=np.append(DELAYS_S, np.inf))
    late = count_integrity(IntegrityParameters(fault="range bias"), 1)
    assert (late["delay_p50_s"], late["delay_p95_s"], late["delay_max_s"]) == (2.0, None, None)
    nothing = np.empty(0)
    asked.counted = replace(asked.counted, delays_s=nothing, protection_m=nothing, error_m=nothing)
    empty = count_integrity(IntegrityParameters(), 1)
    assert {name for name, value in empty.items() if value is None} == {
        *("delay_p50_s", "delay_p95_s", "delay_max_s", "stated_s"),
        *("protection_mean_m", "protection_p95_m", "rmse_m"),
    }


def test_the_campaign_gets_what_is_asked_for(asked: Asked) -> None:
    """Faults have random numbers of their own, and every second one runs the other way."""
    states = []
    for number, (name, fault) in enumerate(FAULTS.items()):
        for world in (AS_BELIEVED, "wheels of 2 %"):
            parameters = IntegrityParameters(fault=name, world=world, trains=7, ticks=600)
            count_integrity(parameters, 5)
            settings, line, sensor, kind = asked.positional
            assert settings == LocalizerSettings(direction=-1 if number % 2 else 1)
            assert (sensor, kind) == (fault or (None, None))
            assert line == SimulatedLine(wheel_scale=0.01 if world == AS_BELIEVED else 0.02)
            assert (asked.named["runs"], asked.named["ticks"]) == (7, 600)
            states.append(asked.named["rng"].bit_generator.state["state"]["state"])
        expected = np.random.default_rng([5, number]).bit_generator.state["state"]["state"]
        assert states[-2:] == [expected, expected]
    assert len({*states}) == len(FAULTS) == 23


def test_each_world_is_another() -> None:
    assert WORLDS[AS_BELIEVED] == SimulatedLine()
    assert len({repr(world) for world in WORLDS.values()}) == len(WORLDS) == 9


@pytest.mark.parametrize(
    ("name", "cells", "left_out"),
    [
        ("integrity", {(fault, None) for fault in FAULTS}, set()),
        (
            "integrity_worlds",
            {(fault, world) for fault in ("none", "range drift") for world in WORLDS},
            {"protected", "healthy_h", "excluded", "delay_p50_s", "delay_max_s", "stated_s"},
        ),
    ],
)
def test_the_study_files_have_every_case_and_show_what_is_counted(
    asked: Asked, name: str, cells: set[Any], left_out: set[str]
) -> None:
    study, source = load_study(name, FOLDER, GENERATORS, CALCULATIONS)
    found = [(cell["fault"], cell.get("world")) for cell in cells_of(study)]
    assert {*found} == cells and len(found) == len(cells)
    _, figures = source.run({**cells_of(study)[-1]}, 1, study.figures)
    assert asked.named["runs"] == 100 and study.runs == 1
    counted = count_integrity(IntegrityParameters(fault="range bias"), 1)
    shown = {figure.of or name for name, figure in study.figures.items()}
    assert shown == {*counted} - left_out
    assert None not in figures.values()


def lying(lie: Callable[[int, Estimate], Mapping[str, Any]]) -> type[Localizer]:
    """A localizer whose estimates are changed."""

    class Lying(Localizer):
        def tick(self, time_s: float, readings: Any) -> Estimate:
            estimate = super().tick(time_s, readings)
            return estimate._replace(**lie(round(10 * time_s), estimate))

    return Lying


def figures_of(
    monkeypatch: pytest.MonkeyPatch, lie: Callable[[int, Estimate], Mapping[str, Any]], fault: str
) -> Mapping[str, float | None]:
    monkeypatch.setattr(campaign, "Localizer", lying(lie))
    return count_integrity(IntegrityParameters(fault=fault, trains=4, ticks=500), 1)


def test_a_localizer_that_lies_is_seen_in_every_counter(monkeypatch: pytest.MonkeyPatch) -> None:
    def lie(tick: int, estimate: Estimate) -> Mapping[str, Any]:
        last = tick == 499  # each train has its fault by then
        return {
            "low_m": estimate.low_m + (1e6 if last else 0.0),
            "speed_low_mps": estimate.speed_low_mps + (1e6 if last else 0.0),
            "detected": np.full(4, tick == 1),
            "excluded": np.full_like(estimate.excluded, last),
            "uncovered": np.zeros_like(estimate.uncovered),
            "status": np.full_like(estimate.status, estimate.status.max()),
        }

    figures = figures_of(monkeypatch, lie, "range wrong station")
    for name in ("misleading", "misleading_trains", "misleading_speeds", "wrong_exclusions"):
        assert figures[name] == 4, name
    # Those that were not found in time are due; what was said before does not count.
    assert figures["false_alarms"] == 4
    due, late = figures["due"], figures["late"]
    assert due == late and due is not None and due > 0
    assert figures["excluded"] == due
    assert figures["delay_max_s"] is None


def test_an_honest_one_is_blamed_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    figures = figures_of(monkeypatch, lambda *_: {}, "range wrong station")
    names = "misleading", "misleading_trains", "misleading_speeds", "false_alarms", "late"
    assert [figures[name] for name in names] == [0] * len(names)
    assert figures["due"] == figures["excluded"] == 4
    delay_s = figures["delay_max_s"]
    assert delay_s is not None and delay_s <= 0.3
    positions, healthy_h = figures["positions"], figures["healthy_h"]
    assert positions is not None and healthy_h is not None
    assert positions + healthy_h * 36_000.0 == pytest.approx(4 * 500)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"fault": "range bais"}, "fault: 'range bais': .*no such fault, did you mean range bias"),
        ({"world": "wheels of 3 %"}, "world: 'wheels of 3 %': .*did you mean wheels of 2 %"),
        ({"trains": 0}, "trains: 0: "),
        ({"ticks": 400}, "ticks: 400: "),
        ({"tics": 500}, "tics: 500: there is no such field, did you mean ticks"),
    ],
)
def test_what_there_is_not_is_one_line_that_names_the_field(
    values: dict[str, Any], said: str
) -> None:
    with pytest.raises(InputError, match=f"^{said}") as caught:
        checked(IntegrityParameters, values)
    assert "\n" not in str(caught.value)
