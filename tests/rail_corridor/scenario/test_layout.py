"""Where stations stand and which zone each watches, against the figures of the paper."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.ranging.layout import Layout, layout_of
from rail_corridor.loading.loader import load_scenario, scenario_from_data
from rail_corridor.scenario.model import Scenario

NO_FILES = Path("/nonexistent")


def scenario_of(length_m: float, zone_length_m: float, **more: Any) -> Scenario:
    """Return a scenario on one straight track."""
    data: dict[str, Any] = {
        "name": "test",
        "duration_s": 10.0,
        "tracks": {"main": {"elements": [{"straight_m": length_m}]}},
        "stations": {"zone_length_m": zone_length_m},
        "trains": [{"name": "t1", "route": ["main"]}],
        **more,
    }
    return scenario_from_data(data, directory=NO_FILES)


def channels(layout: Layout, *zones: str) -> list[tuple[int, int]]:
    """Return the channel pairs of zones."""
    return [(layout.zone(z).downlink_channel, layout.zone(z).uplink_channel) for z in zones]


def test_figure_7_channels_alternate() -> None:
    layout = layout_of(load_scenario("plain_line"))
    assert channels(layout, "zone1", "zone2", "zone3") == [(1, 2), (3, 4), (1, 2)]
    for zone, after in zip(layout.zones, layout.zones[1:], strict=False):
        assert zone.end_m == after.start_m == layout.station(after.station).at_m
        assert zone.next == (after.name,)
        assert after.previous == zone.name


def test_figure_8_station_5_watches_both_tracks() -> None:
    layout = layout_of(load_scenario("branch"))
    assert channels(layout, "zone5", "zone6", "zone7") == [(1, 2), (3, 4), (5, 6)]
    assert layout.station("wrs5").zones == ("zone5", "zone7")
    assert layout.zone("zone6").station == "wrs6"
    # railway 3 goes on by WRS8, with channels 7/8 and 5/6 in turn
    behind = layout.zone(layout.zone("zone7").next[0])
    assert behind.station == "wrs8"
    assert channels(layout, behind.name, *behind.next) == [(7, 8), (5, 6)]
    # both zones follow zone 4, which ends at the station on both tracks
    assert layout.zone("zone4").next == ("zone5", "zone7")
    assert layout.zone("zone5").previous == layout.zone("zone7").previous == "zone4"


def test_station_5_stands_between_the_tracks_at_the_fouling_point() -> None:
    scenario = load_scenario("branch")
    layout, network = layout_of(scenario), scenario.network
    on_main = network.tracks["main"].pose(layout.zone("zone5").start_m)
    on_branch = network.tracks["branch"].pose(layout.zone("zone7").start_m)
    main_xy = np.array([on_main.x_m, on_main.y_m], dtype=float)
    branch_xy = np.array([on_branch.x_m, on_branch.y_m], dtype=float)
    assert np.hypot(*(main_xy - branch_xy)) == pytest.approx(4.5, abs=1e-6)
    mast = np.array(layout.station("wrs5").position_m[:2])
    assert mast == pytest.approx(0.5 * (main_xy + branch_xy), abs=1e-9)
    # on a straight main track the gap of an arc is R (1 - cos(s / R))
    s_m = 300.0 * math.acos(1.0 - 4.5 / 300.0)
    assert layout.zone("zone7").start_m == pytest.approx(s_m, abs=1e-6)
    assert layout.zone("zone5").start_m == pytest.approx(
        760.0 + 300.0 * math.sin(s_m / 300.0), abs=1e-6
    )


@pytest.mark.parametrize(
    ("length_m", "zone_length_m", "count"),
    [(22728.0, 200.0, 114), (1200.0, 200.0, 6), (1201.0, 200.0, 7), (150.0, 200.0, 1)],
)
def test_equal_zones_none_longer_than_asked(
    length_m: float, zone_length_m: float, count: int
) -> None:
    layout = layout_of(scenario_of(length_m, zone_length_m))
    lengths_m = np.array([zone.length_m for zone in layout.zones])
    assert len(layout.stations) == len(layout.zones) == count
    assert lengths_m == pytest.approx(np.full(count, length_m / count))
    assert lengths_m.max() <= zone_length_m + 1e-9
    assert layout.zones[0].start_m == layout.stations[0].at_m == 0.0
    assert layout.zones[-1].end_m == length_m


def test_zones_cover_every_track_of_the_demo_once() -> None:
    scenario = load_scenario("demo")
    layout = layout_of(scenario)
    point = layout.fouling_points[0]
    for name, track in scenario.network.tracks.items():
        zones = [zone for zone in layout.zones if zone.track == name]
        assert zones[0].start_m == (point.branch_m if name == "branch" else 0.0)
        assert zones[-1].end_m == track.length_m
        for zone, after in itertools.pairwise(zones):
            assert zone.end_m == after.start_m
    assert [zone.name for zone in layout.zones] == [f"zone{n + 1}" for n in range(17)]
    assert [s.name for s in layout.stations] == [f"wrs{n + 1}" for n in range(16)]


def test_zone_of_a_place() -> None:
    layout = layout_of(load_scenario("branch"))
    fouling = layout.fouling_points[0]
    assert layout.zone_at("main", 0.0).name == "zone1"
    assert layout.zone_at("main", 199.999).name == "zone1"
    assert layout.zone_at("main", 200.0).name == "zone2"
    assert layout.zone_at("main", 1500.0).name == "zone8"
    # a branch, before its fouling point, is watched by the station before the junction
    assert layout.zone_at("branch", 0.0).name == "zone4"
    assert layout.zone_at("branch", fouling.branch_m - 1e-6).name == "zone4"
    assert layout.zone_at("branch", fouling.branch_m).name == "zone7"


def test_masts_stand_right_of_the_track_and_look_along_it() -> None:
    scenario = scenario_of(600.0, 200.0)
    scenario = scenario_of(
        600.0,
        200.0,
        tracks={
            "main": {"elements": [{"straight_m": 600}], "start": {"heading_deg": 90.0}},
        },
        stations={"zone_length_m": 200.0, "mast_offset_m": 3.5, "mast_height_m": 6.0},
    )
    station, zone = layout_of(scenario).stations[1], layout_of(scenario).zones[1]
    assert station.position_m == pytest.approx((3.5, 200.0, 6.0))
    line = np.array([-3.5, 100.0, -6.0])
    assert zone.boresight == pytest.approx(line / np.linalg.norm(line))


def test_a_branch_of_a_branch_changes_the_channels_again() -> None:
    scenario = scenario_of(
        1000.0,
        250.0,
        tracks={
            "main": {"elements": [{"straight_m": 1000}]},
            "siding": {"elements": [{"arc_m": 150, "radius_m": 300}, {"straight_m": 150}]},
            "branch": {"elements": [{"arc_m": 200, "radius_m": -300}, {"straight_m": 800}]},
        },
        junctions=[
            {"track": "branch", "at_m": 400, "branch": "siding"},
            {"track": "main", "at_m": 300, "branch": "branch"},
        ],
    )
    layout = layout_of(scenario)
    tracks = [zone.track for zone in layout.zones]
    assert list(dict.fromkeys(tracks)) == ["main", "branch", "siding"]
    first = {track: layout.zones[tracks.index(track)] for track in dict.fromkeys(tracks)}
    assert first["main"].downlink_channel == 1
    assert first["branch"].downlink_channel == 5
    assert first["siding"].downlink_channel == 1
    assert first["siding"].previous is not None
    shared = layout.station(first["siding"].station)
    assert {layout.zone(name).track for name in shared.zones} == {"branch", "siding"}
