"""The plan of a run: nodes, their parameters, their processes."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from rail_corridor.equipment.ranging.calibration import transponders_of
from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.ranging.nodes import CONTROLLER, MEDIUM
from rail_corridor.equipment.ranging.world import coverage_range_m, survey
from rail_corridor.equipment.train_radio.nodes import CBTC_MEDIUM
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides
from rail_corridor.plan.plan import MOST_PROCESSES, WORLD, Placement, Plan, make_plan
from rail_corridor.run.options import default_placement
from rail_msgs_py.topics.train_radio import BACKBONE
from rail_world.ranging.description import RadioDescription
from rail_world.world_file import read_world_file


def plan_of(name: str, directory: Path, zone_length_m: float | None = None) -> Plan:
    overrides = Overrides(sections={"--zone-length": zone_length_m})
    return make_plan(load_scenario(name, overrides=overrides), directory)


def test_every_station_train_and_the_rest_is_a_node(tmp_path: Path) -> None:
    plan = plan_of("branch", tmp_path)
    names = [spec.name for spec in plan.nodes]
    stations = [f"/wayside/wrs{n}" for n in range(1, 10)]
    assert names == [WORLD, MEDIUM, CONTROLLER, *stations, "/train_a/vrs", "/train_b/vrs"]
    (world,) = (spec for spec in plan.nodes if spec.name == WORLD)
    assert set(world.parameters["nodes"]) == set(names) - {WORLD}
    assert world.parameters["sinks"] == (MEDIUM, CONTROLLER)
    assert world.parameters["clock_readers"] == 10


def test_timeouts_fall_so_that_the_nearest_to_the_fault_notices_first(tmp_path: Path) -> None:
    plan = make_plan(load_scenario("plain_line"), tmp_path, timeout_s=5.0)
    wait_s = {spec.name: spec.parameters.get("timeout_s", math.nan) for spec in plan.nodes}
    # Two passes of the medium, then the controller, then the world.
    assert wait_s[MEDIUM] < wait_s[CONTROLLER] < wait_s[WORLD] == 5.0


def test_the_backbone_is_there_with_threats_only(tmp_path: Path) -> None:
    calm, hostile = (plan_of(name, tmp_path) for name in ("moving_block", "hostile_network"))
    names = [spec.name for spec in hostile.nodes]
    assert set(names) - {spec.name for spec in calm.nodes} == {BACKBONE}
    worlds = [next(s.parameters for s in p.nodes if s.name == WORLD) for p in (calm, hostile)]
    assert set(worlds[1]["sinks"]) - set(worlds[0]["sinks"]) == {BACKBONE}
    assert worlds[1]["clock_readers"] == worlds[0]["clock_readers"] + 1
    for plan, there in ((calm, False), (hostile, True)):
        fed = [spec for spec in plan.nodes if spec.kind in ("zone_controller", "cbtc_base_station")]
        assert len(fed) > 2 and all(spec.parameters["backbone"] is there for spec in fed)
        assert ("threats" in plan.world.parts) is there
    wait_s = {spec.name: spec.parameters.get("timeout_s", math.nan) for spec in hostile.nodes}
    (backbone,) = (spec for spec in hostile.nodes if spec.name == BACKBONE)
    # The medium, the way up, the controller, the way down, the world.
    assert wait_s[CBTC_MEDIUM] < wait_s[BACKBONE] < wait_s[CONTROLLER]
    assert wait_s[CONTROLLER] < backbone.parameters["controller_timeout_s"] < wait_s[WORLD]
    assert backbone.site == "world"


@pytest.mark.parametrize("placement", ["one", "site", "node"])
def test_every_node_is_in_one_process(tmp_path: Path, placement: Placement) -> None:
    plan = plan_of("branch", tmp_path)
    groups = plan.groups(placement)
    placed = [spec.name for specs in groups.values() for spec in specs]
    assert sorted(placed) == sorted(spec.name for spec in plan.nodes)
    assert len(groups) == {"one": 1, "site": 13, "node": 14}[placement]
    if placement == "site":
        assert [spec.name for spec in groups["world"]] == [WORLD, MEDIUM]


@pytest.mark.parametrize("placement", ["site", "node"])
def test_no_more_processes_than_can_find_each_other(tmp_path: Path, placement: Placement) -> None:
    plan = plan_of("demo", tmp_path, zone_length_m=60.0)
    groups = plan.groups(placement)
    assert len(plan.nodes) > 50
    assert len(groups) == MOST_PROCESSES
    placed = [spec.name for specs in groups.values() for spec in specs]
    assert sorted(placed) == sorted(spec.name for spec in plan.nodes)
    assert len(set(groups)) == len(groups)


def test_few_cores_get_one_process_and_many_get_one_per_site(tmp_path: Path) -> None:
    plan = make_plan(load_scenario("demo"), tmp_path)
    assert default_placement(plan, cores=2) == "one"
    assert default_placement(plan, cores=8) == "site"
    assert default_placement(make_plan(load_scenario("plain_line"), tmp_path), cores=2) == "site"


def test_wayside_and_onboard_are_the_whole_corridor(tmp_path: Path) -> None:
    plan = plan_of("branch", tmp_path)
    wayside, onboard = (
        {spec.name for specs in plan.groups("node", only).values() for spec in specs}
        for only in ("wayside", "onboard")
    )
    assert onboard == {"/train_a/vrs", "/train_b/vrs"}
    assert wayside == {spec.name for spec in plan.nodes} - onboard


def test_the_world_file_is_read_back_as_it_was_made(tmp_path: Path) -> None:
    plan = plan_of("demo", tmp_path)
    assert read_world_file(str(tmp_path / "world.json")) == plan.world


def test_channels_are_paired_the_same_at_the_wayside_and_on_board(tmp_path: Path) -> None:
    plan = plan_of("branch", tmp_path)
    pairs: set[tuple[int, int]] = set()
    for spec in plan.nodes:
        if spec.kind == "wrs":
            p = spec.parameters
            pairs |= set(zip(p["downlink_channels"], p["uplink_channels"], strict=True))
    for spec in plan.nodes:
        if spec.kind == "vrs":
            p = spec.parameters
            assert set(zip(p["downlink_channels"], p["uplink_channels"], strict=True)) == pairs
    assert pairs == {(1, 2), (3, 4), (5, 6), (7, 8)}


@pytest.mark.parametrize("name", ["plain_line", "branch", "demo"])
def test_the_survey_of_a_zone_rises_and_is_the_distance_to_its_mast(name: str) -> None:
    scenario = load_scenario(name)
    layout = layout_of(scenario)
    for zone in layout.zones:
        chainage_m, distance_m = survey(scenario, layout, zone)
        assert np.all(np.diff(chainage_m) > 0.0)
        assert np.all(np.diff(distance_m) > 0.0)
        assert chainage_m[0] - zone.start_m < 5.0
        assert chainage_m[-1] >= zone.end_m - 1e-6
        pose = scenario.network.tracks[zone.track].pose(chainage_m[-1])
        place = (float(pose.x_m), float(pose.y_m), float(pose.z_m))
        assert math.dist(place, layout.station(zone.station).position_m) == pytest.approx(
            distance_m[-1]
        )


def test_no_station_reaches_past_two_zones() -> None:
    scenario = load_scenario("plain_line")
    layout = layout_of(scenario)
    for zone in layout.zones[:-2]:
        mast = layout.station(zone.station).position_m
        # Jeong et al., section 2.5: to the end of the next zone, and no further.
        assert coverage_range_m(scenario, layout, zone) == pytest.approx(
            math.dist(mast, (zone.end_m + 200.0, 0.0, 0.0))
        )


def test_antennas_of_a_branching_station_look_outward(tmp_path: Path) -> None:
    scenario = load_scenario("branch")
    radio = make_plan(scenario, tmp_path).world.part("ranging", RadioDescription)
    antennas = {antenna.zone: antenna for antenna in radio.stations}
    zones = [layout_of(scenario).zone(name) for name in ("zone5", "zone7")]
    looks = [np.array(antennas[zone.name].boresight)[:2] for zone in zones]
    straight = [np.array(zone.boresight)[:2] for zone in zones]
    angles = [
        math.acos(float(a @ b) / float(np.linalg.norm(a) * np.linalg.norm(b)))
        for a, b in (looks, straight)
    ]
    # 25 degrees outward each.
    assert math.degrees(angles[0] - angles[1]) == pytest.approx(50.0, abs=0.1)


def test_a_plan_is_repeatable_and_units_differ(tmp_path: Path) -> None:
    one, same = plan_of("demo", tmp_path), plan_of("demo", tmp_path)
    assert one.nodes == same.nodes
    units = transponders_of(load_scenario("demo"))
    delays_s = [unit.delay_s for unit in units.values()]
    assert len(set(delays_s)) == 3
    for spec in one.nodes:
        if spec.kind == "vrs":
            unit = units[spec.site]
            assert spec.parameters["transponder_delay_s"] == unit.delay_s
            assert spec.parameters["delay_trim_s"] == unit.trim_s
