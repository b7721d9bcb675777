"""Trains and zones in the map, as RViz and Foxglove draw them."""

from __future__ import annotations

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from rail_corridor.equipment.map_scene import MapScene
from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_corridor.report.map_markers import train_markers
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_signals.localizer.protection_level import Status
from rail_world.line.corridor_map import PAIR_COLOURS, markers


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("demo")


def scene_of(
    scenario: Scenario, names: tuple[str, ...], tables: dict[str, FloatArray], stamp_ns: int = 0
) -> MapScene:
    first_tracks = ("main",) * len(names)

    def table(topic: Topic) -> FloatArray | None:
        return tables.get(topic.pattern)

    return MapScene(stamp_ns, names, scenario.network, first_tracks, table)


def test_a_train_stands_where_it_is_and_where_it_is_thought_to_be(scenario: Scenario) -> None:
    track = scenario.network.tracks["branch"]
    state = np.zeros((3, len(STATE.columns)))
    pose = track.pose(200.0)
    state[0, 1:5] = [float(p) for p in (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)]
    state[0, 9] = state[1, 9] = 1.0
    position = np.array([[1, 203.0, 4.0, 20.0], [0, 5.0, np.inf, 0.0], [np.nan] * 4])
    names = ("train_a", "train_b", "train_c")
    tables = {STATE.pattern: state, POSITION.pattern: position}
    found = train_markers(scene_of(scenario, names, tables, 3_500_000_000)).markers
    by = {(marker.ns, marker.id): marker for marker in found}
    assert {marker.header.frame_id for marker in found} == {"map"}
    assert by["truth", 0].header.stamp.nanosec == 500_000_000
    truth, estimate = by["truth", 0].pose.position, by["estimate", 0].pose.position
    away_m = np.hypot(truth.x - estimate.x, truth.y - estimate.y)
    assert away_m == pytest.approx(3.0, abs=0.01)
    assert by["estimate", 0].scale.x == pytest.approx(8.0)  # two sigma to either side
    assert by["name", 0].text == "train_a: 72 km/h, sigma 2.00 m"
    assert by["name", 1].text == "train_b: position not known"
    shown = {key for key, marker in by.items() if marker.action == Marker.ADD}
    assert shown == {
        *(("truth", 0), ("estimate", 0), ("name", 0)),
        *(("truth", 1), ("name", 1)),
    }


@pytest.mark.parametrize(
    ("status", "colour"), [(Status.PROTECTED, 0.91), (Status.UNMONITORED, 0.26)]
)
def test_the_interval_of_the_localizer_lies_along_the_track(
    scenario: Scenario, status: Status, colour: float
) -> None:
    state = np.zeros((2, len(STATE.columns)))
    state[:, 9] = 1.0
    row = {"status": float(status), "front_m": 700.0, "low_m": 690.0, "high_m": 712.0}
    located = np.array([[row.get(column, 0.0) for column in LOCALIZER_STATE.columns]] * 2)
    located[1, [0, 5, 6]] = (0.0, -np.inf, np.inf)
    tables = {STATE.pattern: state, LOCALIZER_STATE.pattern: located}
    found = train_markers(scene_of(scenario, ("train_a", "train_b"), tables)).markers
    texts = [marker.text for marker in found if marker.ns == "name"]
    assert texts == ["train_a", "train_b"]
    line, none = [marker for marker in found if marker.ns == "interval"]
    steps = np.diff([(p.x, p.y) for p in line.points], axis=0)
    assert np.hypot(*steps.T).sum() == pytest.approx(22.0, abs=0.01)
    assert line.color.b == pytest.approx(colour, abs=1e-6)
    assert (line.action, none.action) == (Marker.ADD, Marker.DELETE)


def test_zones_lie_along_the_track_in_the_colour_of_their_channels(
    scenario: Scenario, tmp_path: object
) -> None:
    world = make_plan(scenario, tmp_path).world  # type: ignore[arg-type]
    found = markers(world.drawing, world.network()).markers
    lines = [marker for marker in found if marker.ns == "zones"]
    assert len(lines) == len(layout_of(scenario).zones)
    colours = {}
    for line, zone in zip(lines, layout_of(scenario).zones, strict=True):
        steps = np.diff([(p.x, p.y) for p in line.points], axis=0)
        assert np.hypot(*steps.T).sum() == pytest.approx(zone.length_m, rel=1e-3)
        colours[zone.downlink_channel] = (line.color.r, line.color.g, line.color.b)
    assert len(set(colours.values())) == len(colours) <= len(PAIR_COLOURS)
