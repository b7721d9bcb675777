"""Scenarios: the built-in ones, overrides, and what a loaded scenario promises."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario, scenario_from_json
from rail_corridor.loading.overrides import Overrides
from rail_world.trains.motion import TrainMotion

COMPLETE = sorted(set(builtin_scenarios()) - {"real_line", "real_line_sensors"})


def write_line(path: Path, length_m: float = 2000.0) -> Path:
    """Write a TTOBench file of a straight line with a stop in the middle."""
    line = {
        "metadata": {"id": "test", "library version": "TTOBench v1.2"},
        "stops": {"unit": "m", "values": [0.0, length_m / 2, length_m]},
        "speed limits": {
            "units": {"position": "m", "velocity": "km/h"},
            "values": [[0.0, 80.0]],
        },
    }
    path.write_text(json.dumps(line))
    return path


def test_the_built_in_scenarios() -> None:
    assert set(builtin_scenarios()) >= {"branch", "demo", "plain_line", "real_line"}


@pytest.mark.parametrize("name", COMPLETE)
def test_a_built_in_scenario_is_quick_to_load_and_named_after_its_file(name: str) -> None:
    load_scenario(name)
    start_s = time.process_time()
    scenario = load_scenario(name)
    assert time.process_time() - start_s < 0.2
    assert scenario.name == name
    assert scenario.description


@pytest.mark.parametrize("name", ["branch", "demo", "plain_line"])
def test_trains_never_share_a_zone_and_the_run_takes_the_branch(name: str) -> None:
    """One channel pair serves one train: two trains in a zone would answer together."""
    scenario = load_scenario(name)
    layout = layout_of(scenario)
    trains = [TrainMotion(t, scenario.network, scenario.tick_s) for t in scenario.trains]
    visited: set[str] = set()
    for _ in range(scenario.ticks):
        present = [
            train
            for train in trains
            if not (train.state == "arrived" and train.description.leaves_on_arrival)
        ]
        here = [layout.zone_at(train.track, train.chainage_m).name for train in present]
        assert len(set(here)) == len(here)
        visited.update(here)
        for train in trains:
            train.step()
    tracks = {layout.zone(zone).track for zone in visited}
    assert tracks == set(scenario.tracks)


def test_the_demo_is_three_kilometres_with_three_trains() -> None:
    scenario = load_scenario("demo")
    assert scenario.network.tracks["main"].length_m == pytest.approx(3000.0)
    assert len(scenario.trains) == 3
    assert 12 <= len(layout_of(scenario).stations) <= 16
    assert any("branch" in train.route for train in scenario.trains)
    curvature = scenario.network.tracks["main"].curvature_per_m([300.0, 800.0, 2000.0])
    assert [float(k > 0) - float(k < 0) for k in curvature] == [0.0, -1.0, 1.0]


def test_plain_line_runs_at_a_steady_speed() -> None:
    scenario = load_scenario("plain_line")
    train = TrainMotion(scenario.trains[0], scenario.network, scenario.tick_s)
    for _ in range(scenario.ticks):
        train.step()
        assert train.speed_mps == pytest.approx(80 / 3.6, abs=1e-9)


def test_overrides_replace_what_the_file_says(tmp_path: Path) -> None:
    overrides = Overrides(
        seed=99,
        duration_s=12.5,
        track=write_line(tmp_path / "line.json"),
        sections={"--zone-length": 150.0},
    )
    scenario = load_scenario("plain_line", overrides=overrides)
    assert scenario.seed == 99
    assert scenario.ticks == 125
    assert scenario.network.tracks["main"].length_m == 2000.0
    assert len(layout_of(scenario).zones) == 14
    assert max(zone.length_m for zone in layout_of(scenario).zones) <= 150.0


def test_zone_length_replaces_stations_placed_by_hand() -> None:
    scenario = load_scenario("branch", overrides=Overrides(sections={"--zone-length": 120.0}))
    assert max(zone.length_m for zone in layout_of(scenario).zones) <= 120.0


def test_a_real_line_gets_a_timetable(tmp_path: Path) -> None:
    line = write_line(tmp_path / "line.json")
    scenario = load_scenario("real_line", overrides=Overrides(track=line, trains=5))
    assert [train.name for train in scenario.trains] == [f"train{n}" for n in range(1, 6)]
    assert [train.depart_s for train in scenario.trains] == [0.0, 120.0, 240.0, 360.0, 480.0]
    assert all(train.enters_at_departure for train in scenario.trains)
    assert all(train.leaves_on_arrival for train in scenario.trains)
    assert scenario.timetable is None
    assert scenario.end_when_arrived
    assert len(layout_of(scenario).zones) == 10


def test_a_real_line_asks_for_its_track() -> None:
    with pytest.raises(InputError, match=r"real_line\.yaml: tracks: .*--track FILE\.json"):
        load_scenario("real_line")


def test_fewer_trains_are_the_first_of_the_list() -> None:
    scenario = load_scenario("demo", overrides=Overrides(trains=2))
    assert [train.name for train in scenario.trains] == ["train_a", "train_b"]


def test_a_track_file_is_found_beside_the_scenario_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    write_line(folder / "line.json")
    (folder / "mine.yaml").write_text(
        "{name: mine, duration_s: 10, tracks: {main: {ttobench: line.json}},"
        " stations: {zone_length_m: 200}, trains: [{name: t1, route: [main]}]}"
    )
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario("elsewhere/mine.yaml")
    monkeypatch.chdir("/")
    again = scenario_from_json(scenario.to_json())
    assert again == scenario
    assert again.network.tracks["main"].length_m == 2000.0


@pytest.mark.parametrize("name", COMPLETE)
def test_a_scenario_survives_the_way_to_another_process(name: str) -> None:
    scenario = load_scenario(name)
    again = scenario_from_json(scenario.to_json())
    assert again == scenario
    assert layout_of(again) == layout_of(scenario)


def test_a_scenario_is_frozen() -> None:
    scenario = load_scenario("plain_line")
    with pytest.raises(ValueError, match="frozen"):
        scenario.seed = 3  # type: ignore[misc]
    with pytest.raises(ValueError, match="frozen"):
        scenario.radio.noise_figure_db = 0.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("comparator", "low_tone_hz", "range_m"),
    [("and", None, 199.862), ("quadrature", None, 399.723), ("two_tone", 37500.0, 3997.233)],
)
def test_unambiguous_range_of_the_comparators(
    comparator: str, low_tone_hz: float | None, range_m: float
) -> None:
    from rail_corridor.equipment.ranging.section import RangingPlan

    plan = RangingPlan.model_validate({"comparator": comparator, "low_tone_hz": low_tone_hz})
    assert plan.unambiguous_range_m == pytest.approx(range_m, abs=1e-3)


def test_carriers_of_the_channel_plan() -> None:
    carriers_hz = load_scenario("demo").channels.carriers_hz
    assert carriers_hz[1] == 2.4e9
    assert carriers_hz[8] == 2.435e9
    assert list(carriers_hz) == [1, 2, 3, 4, 5, 6, 7, 8]
