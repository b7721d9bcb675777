from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from rail_world.errors import WorldDataError
from rail_world.line.description import JunctionDescription, TrackDescription
from rail_world.line.network import Network, build_network

MAIN = TrackDescription.model_validate(
    {
        "elements": [{"straight_m": 500.0}, {"arc_m": 500.0, "radius_m": 800.0}],
        "gradients": [[0.0, 4.0]],
        "speed_limits": [[0.0, 80.0]],
        "stops_m": [0.0, 300.0, 1000.0],
    }
)
BRANCH = TrackDescription.model_validate(
    {
        "elements": [{"arc_m": 200.0, "radius_m": -300.0}, {"straight_m": 300.0}],
        "gradients": [[0.0, -6.0], [100.0, 0.0]],
        "speed_limits": [[0.0, 40.0], [200.0, 60.0]],
        "stops_m": [450.0],
        "start": {"x_m": 9e5},
        "altitude_m": 500.0,
    }
)


def junction(track: str, at_m: float, branch: str) -> JunctionDescription:
    return JunctionDescription(track=track, at_m=at_m, branch=branch)


@pytest.fixture
def network() -> Network:
    tracks = {"spur": MAIN, "branch": BRANCH, "main": MAIN}
    return build_network(
        tracks, [junction("branch", 250.0, "spur"), junction("main", 700.0, "branch")]
    )


def test_branch_starts_tangent_on_its_track(network: Network) -> None:
    for name in ("branch", "spur"):
        points = network.parent_junction(name)
        assert points is not None
        on = network.tracks[points.track].pose(points.at_m)
        start = network.tracks[name].pose(0.0)
        for key in ("x_m", "y_m", "z_m", "heading_rad"):
            assert float(getattr(start, key)) == pytest.approx(float(getattr(on, key)), abs=1e-9)
    assert list(network.tracks) == ["spur", "branch", "main"]
    assert network.parent_junction("main") is None
    assert [j.branch for j in network.junctions_on("main")] == ["branch"]


def test_route_over_three_tracks(network: Network) -> None:
    route = network.route(["main", "branch", "spur"])
    assert route.tracks == ("main", "branch", "spur")
    assert route.length_m == 700.0 + 250.0 + 1000.0
    assert route.locate(0.0) == ("main", 0.0)
    assert route.locate(700.0) == ("main", 700.0)
    assert route.locate(700.5) == ("branch", 0.5)
    assert route.locate(1950.0) == ("spur", 1000.0)
    assert route.path_of("spur", 10.0) == 960.0
    # The stop of the branch at 450 m lies beyond the points, and main's at 1000 m too.
    assert route.stops_m == (0.0, 300.0, 950.0, 1250.0, 1950.0)
    for path_m in np.linspace(0.0, 1950.0, 79):
        track, chainage_m = route.locate(path_m)
        assert route.path_of(track, chainage_m) == pytest.approx(path_m)
        expected, got = network.tracks[track].pose(chainage_m), route.pose(path_m)
        assert float(got.x_m) == pytest.approx(float(expected.x_m))
        assert float(got.z_m) == pytest.approx(float(expected.z_m))


def test_pose_of_a_route_is_continuous(network: Network) -> None:
    route = network.route(["main", "branch", "spur"])
    s = np.linspace(0.0, route.length_m, 4001)
    pose = route.pose(s)
    steps = np.sqrt(np.diff(pose.x_m) ** 2 + np.diff(pose.y_m) ** 2)
    np.testing.assert_allclose(steps, np.diff(s), rtol=1e-5)
    assert np.max(np.abs(np.diff(pose.heading_rad))) <= np.diff(s)[0] / 300.0 + 1e-12
    assert np.max(np.abs(np.diff(pose.z_m))) <= 6e-3 * np.diff(s)[0] + 1e-12


def test_quantities_along_a_route(network: Network) -> None:
    route = network.route(["main", "branch"])
    at = [100.0, 701.0, 801.0, 950.0]
    np.testing.assert_allclose(route.gradient_permil(at), [4.0, -6.0, 0.0, 0.0])
    np.testing.assert_allclose(route.limit_mps(at) * 3.6, [80.0, 40.0, 40.0, 60.0])
    np.testing.assert_allclose(route.curvature_per_m(at), [0.0, 1 / 300, 1 / 300, 0.0])
    np.testing.assert_allclose(
        route.altitude_m(at), np.array([0.4, 2.8 - 0.006, 2.8 - 0.6, 2.8 - 0.6])
    )


def test_route_towards_decreasing_chainage_is_named_in_order_of_travel(network: Network) -> None:
    assert network.route(["branch", "main"], -1).tracks == ("main", "branch")
    with pytest.raises(WorldDataError, match="no junction on branch starts main"):
        network.route(["main", "branch"], -1)


@pytest.mark.parametrize(
    ("tracks", "reason"),
    [
        (["branch", "main"], "no junction on branch starts main"),
        (["main", "spur"], "no junction on main starts spur"),
        (["main", "siding"], "no such track"),
    ],
)
def test_unconnected_routes_are_refused(network: Network, tracks: list[str], reason: str) -> None:
    with pytest.raises(WorldDataError, match=reason) as caught:
        network.route(tracks)
    assert caught.value.field.startswith("route")


@pytest.mark.parametrize("path_m", [-1.0, 1951.0, math.nan])
def test_off_the_route_is_refused(network: Network, path_m: float) -> None:
    route = network.route(["main", "branch", "spur"])
    with pytest.raises(ValueError, match="off the route"):
        route.pose(path_m)
    with pytest.raises(ValueError, match="off the route"):
        route.locate(path_m)
    with pytest.raises(ValueError, match="off the route"):
        route.limit_mps([path_m])


def test_point_beyond_the_junction_is_off_the_route(network: Network) -> None:
    with pytest.raises(ValueError, match="off the route"):
        network.route(["main", "branch"]).path_of("main", 800.0)
    with pytest.raises(ValueError, match="does not use"):
        network.route(["main"]).path_of("branch", 0.0)


@pytest.mark.parametrize(
    ("junctions", "field", "reason"),
    [
        ([("siding", 10.0, "branch")], "junctions.0.track", "no such track"),
        ([("main", 10.0, "siding")], "junctions.0.branch", "no such track"),
        ([("main", 1000.1, "branch")], "junctions.0.at_m", "off the track main"),
        (
            [("main", 100.0, "branch"), ("main", 900.0, "branch")],
            "junctions.1.branch",
            "another junction starts it",
        ),
        ([("main", 100.0, "branch"), ("branch", 100.0, "main")], "junctions.0.branch", "circle"),
        ([("main", 500.0, "branch"), ("main", 430.0, "spur")], "junctions.0.at_m", "100 m"),
    ],
)
def test_wrong_junctions_are_refused(
    junctions: list[tuple[str, float, str]], field: str, reason: str
) -> None:
    tracks = {"main": MAIN, "branch": BRANCH, "spur": BRANCH}
    with pytest.raises(WorldDataError, match=reason) as caught:
        build_network(tracks, [junction(*j) for j in junctions])
    assert caught.value.field == field


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"branch": "main"}, "cannot branch off itself"),
        ({"at_m": -1.0}, "at_m"),
        ({"at_m": 1e7}, "at_m"),
        ({"track": "Main Line"}, "track"),
        ({"to": "x"}, "to"),
    ],
)
def test_wrong_junction_fields_are_refused(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError, match=field):
        JunctionDescription.model_validate({"track": "main", "at_m": 1.0, "branch": "b", **change})


def test_stop_at_the_end_is_on_the_route_whatever_the_rounding() -> None:
    tenths = TrackDescription.model_validate(
        {"elements": [{"straight_m": 0.1}] * 1000, "stops_m": [100.0]}
    )
    network = build_network({"main": tenths})
    length_m = network.tracks["main"].length_m
    assert length_m != 100.0
    assert network.route(["main"]).stops_m == (min(length_m, 100.0),)
    ends = build_network({"main": tenths, "spur": BRANCH}, [junction("main", 100.0, "spur")])
    assert ends.route(["main", "spur"]).length_m == pytest.approx(600.0)


def test_network_of_nothing_is_refused() -> None:
    with pytest.raises(WorldDataError, match="at least one track"):
        build_network({})


def test_files_are_found_from_the_directory_given(real_line: Callable[[str], Path]) -> None:
    path = real_line("CN_Songjiazhuang_Yizhuang")
    description = TrackDescription(ttobench=path.name)
    assert description.length_m is None
    network = build_network({"main": description}, directory=path.parent)
    assert network.tracks["main"].length_m == 22_728.0
