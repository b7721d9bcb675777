"""Study files: what is wrong in them is one line that names the field, and starts nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.study.cells import case_of, cells_of
from rail_corridor.study.journal import Header
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
    more, _ = load(tmp_path, GOOD | {"draw": GOOD["draw"] | {"tick_s": {"choice": [0.1, 0.2]}}})
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
        ({"draw": {"seed": {"integers": [1, 9]}}}, r"draw\.seed: .*first_seed and the number"),
        ({"draw": {"trains.0.start_m": {"integers": [1, 10**20]}}}, r"draw\.trains\.0\.start_m"),
        ({"draw": {"trains.0.start_m": {"normal": [30, 15]}}}, r"draw\.trains\.0\.start_m: -15"),
        ({"figures": {"seed": {"of": "ticks"}}}, r"figures\.seed: .*no name of a figure"),
        ({"figures": {"x": {"at_least": 3, "at_most": 1}}}, "at_least: .*is more than at_most"),
        ({"figures": {"x": {"must_be": float("nan")}}}, r"figures\.x\.must_be: nan"),
        ({"cells": [{}]}, r"cells\.0: .*nothing in it"),
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
            r"draw\.trains\.0\.start_m: 60000\.0: .*off the route",
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
    changes = {
        "runs": 7,
        "parameters.duration_s": 30,
        "figures.rmse_m.at_most": 2,
        "vary.tick_s": [0.2],
    }
    study, _ = load_study(str(path), FOLDER, GENERATORS, CALCULATIONS, changes)
    assert study.runs == 7 and study.parameters == {"duration_s": 30}
    assert study.figures["rmse_m"].at_most == 2
    assert study.varied == ("stations.zone_length_m", "tick_s")


def test_every_study_that_comes_with_the_corridor_can_be_loaded() -> None:
    for path in FOLDER.glob("*.yaml"):
        study, _ = load_study(path.stem, FOLDER, GENERATORS, CALCULATIONS)
        assert study.name == path.stem and study.description


def test_what_is_wrong_in_a_scenario_beside_the_study_is_said_of_its_file(tmp_path: Path) -> None:
    line = yaml.safe_load(builtin_scenarios()["plain_line"].read_text())
    (tmp_path / "line.yaml").write_text(yaml.safe_dump(line | {"tick_s": -1}))
    with pytest.raises(InputError, match=rf"^{tmp_path / 'line.yaml'}: tick_s: -1"):
        load(tmp_path, GOOD | {"scenario": "line.yaml"})


def test_another_scenario_is_another_study(tmp_path: Path) -> None:
    line = yaml.safe_load(builtin_scenarios()["plain_line"].read_text())
    headers = []
    for length_m in (1200, 1100):
        line["tracks"]["main"]["elements"] = [{"straight_m": length_m}]
        (tmp_path / "line.yaml").write_text(yaml.safe_dump(line | {"trains": line["trains"][:1]}))
        study, source = load(tmp_path, GOOD | {"scenario": "line.yaml", "vary": {}})
        headers.append(Header.of(study, source, "1.0"))
    assert headers[0].fingerprint != headers[1].fingerprint
