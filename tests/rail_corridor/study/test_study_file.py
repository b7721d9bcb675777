"""Study files: what is wrong in them is one line that names the field, and starts nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rail_corridor.errors import InputError
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.study.cells import case_of, cells_of
from rail_corridor.study.study_file import load_study

GOOD: dict[str, Any] = {
    "name": "spacing",
    "scenario": "plain_line",
    "vary": {"stations.zone_length_m": [200, 250]},
    "draw": {"trains.0.start_m": {"uniform": [10, 60]}},
    "runs": 3,
    "figures": {"rmse_m": {"of": "trains.*.phase_ranging.rmse_m", "take": "max"}},
}


def load(tmp_path: Path, data: dict[str, Any]) -> Any:
    path = tmp_path / "study.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_study(str(path), FOLDER, GENERATORS, CALCULATIONS)


def test_cells_and_draws_depend_on_seed_and_field_alone(tmp_path: Path) -> None:
    study, _ = load(tmp_path, GOOD)
    cells = cells_of(study)
    assert cells == [{"stations.zone_length_m": 200}, {"stations.zone_length_m": 250}]
    cases = [case_of(study, cells, cell, run) for cell in (0, 1) for run in range(3)]
    assert [case.seed for case in cases] == [1, 2, 3] * 2
    starts_m = [case.values["trains.0.start_m"] for case in cases]
    assert starts_m[:3] == starts_m[3:] and len({*starts_m}) == 3
    more, _ = load(tmp_path, GOOD | {"draw": GOOD["draw"] | {"seed": {"integers": [1, 9]}}})
    assert case_of(more, cells, 0, 1).values["trains.0.start_m"] == starts_m[1]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"name": "Spacing of stations"}, "name: 'Spacing of stations': "),
        ({"scenario": "plain_lin"}, "scenario: 'plain_lin': is neither .*did you mean plain_line"),
        ({"generator": "kills"}, "scenario: .*one of scenario, generator or calculation"),
        ({"scenario": None}, "scenario: .*one of scenario, generator or calculation"),
        (
            {"scenario": None, "generator": "killer"},
            "generator: 'killer': there are handover, kills",
        ),
        ({"vary": {"stations.zone_lenght_m": [200]}}, r"vary\.stations\.zone_lenght_m: .*did you"),
        ({"vary": {"stations.zone_length_m": [200, -5]}}, r"vary\.stations\.zone_length_m: -5"),
        ({"vary": {"stations.zone_length_m": []}}, r"vary\.stations\.zone_length_m: .*no value"),
        ({"vary": {"trains.7.start_m": [1.0]}}, r"vary\.trains\.7\.start_m: '7': there are 1"),
        ({"draw": {"trains.0.start_m": {"uniform": [60, 10]}}}, r"draw\.trains\.0\.start_m"),
        ({"draw": {"trains.0.start_m": {"poisson": 3}}}, r"draw\.trains\.0\.start_m\.poisson"),
        ({"draw": {"stations.zone_length_m": {"choice": [1]}}}, "is varied already"),
        ({"runs": 0}, "runs: 0: "),
        ({"figures": {}}, "figures: .*at least one"),
        ({"figures": {"x": {"take": "median"}}}, r"figures\.x\.take: 'median'"),
        ({"figures": {"x": {"over_runs": "rate"}}}, r"figures\.x\.per: .*a rate needs"),
        ({"figures": {"x": {"per": "y", "over_runs": "rate"}}}, r"figures\.x\.per: 'y': is none"),
        ({"figures": {"x": {"per": "x"}}}, "is for a proportion or a rate"),
        ({"cells": [{"seed": 1}, {"tick_s": 0.2}]}, r"cells\.1: .*all must set the same"),
        ({"cells": [{"tick_s": 0.1}, {"tick_s": 0}]}, r"cells\.\*\.tick_s: 0"),
        ({"cells": [{"stations.zone_length_m": 1}]}, "is set by the cells already"),
        (
            {"draw": {"trains.0.start_m": {"uniform": [10, 60000]}}},
            r"draw\.trains\.0\.start_m: 5\d+.*off the route",
        ),
        ({"group_by": ["zone"]}, "group_by: 'zone': is neither varied nor drawn"),
        (
            {"stop": {"events": {"figure": "errors", "count": 3}}},
            r"stop\.events\.figure: .*none of the figures",
        ),
        ({"stops": {}}, "stops: .*there is no such field, did you mean stop"),
    ],
)
def test_what_is_wrong_is_one_line(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said) as caught:
        load(tmp_path, GOOD | changes)
    line = str(caught.value)
    assert line.startswith(f"{tmp_path / 'study.yaml'}: ") and "\n" not in line


def test_cells_go_with_every_combination_of_what_is_varied(tmp_path: Path) -> None:
    study, _ = load(tmp_path, GOOD | {"cells": [{"tick_s": 0.1}, {"tick_s": 0.2}]})
    lengths = "stations.zone_length_m"
    assert [(c["tick_s"], c[lengths]) for c in cells_of(study)] == [
        (0.1, 200),
        (0.1, 250),
        (0.2, 200),
        (0.2, 250),
    ]
    assert study.columns == ("tick_s", lengths)


def test_fields_are_set_from_the_command_line(tmp_path: Path) -> None:
    path = tmp_path / "study.yaml"
    path.write_text(yaml.safe_dump(GOOD))
    changes = {"runs": 7, "parameters.duration_s": 30, "figures.rmse_m.at_most": 2}
    study, _ = load_study(str(path), FOLDER, GENERATORS, CALCULATIONS, changes)
    assert study.runs == 7 and study.parameters == {"duration_s": 30}
    assert study.figures["rmse_m"].at_most == 2


def test_every_study_that_comes_with_the_corridor_can_be_loaded() -> None:
    for path in FOLDER.glob("*.yaml"):
        study, _ = load_study(path.stem, FOLDER, GENERATORS, CALCULATIONS)
        assert study.name == path.stem and study.description
