"""Poses of trains in the map against the closed form of an arc on a slope."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_corridor.equipment.doppler.subsystem import DOPPLER
from rail_corridor.equipment.localizer.subsystem import LOCALIZER
from rail_corridor.equipment.map_scene import MapScene
from rail_corridor.equipment.ranging.subsystem import RANGING
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import records_of
from rail_corridor.report.map_poses import TRUTH, locators_of, map_poses, pose_on
from rail_msgs_py.map_pose import OFF_TRACK_M
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE
from rail_signals.arrays import FloatArray
from rail_world.line.alignment import Alignment, Element
from rail_world.line.network import Network
from rail_world.line.profile import StepProfile
from rail_world.line.track import Track, limits_from_kmh

RADIUS_M, LENGTH_M, SLOPE, HEADING_RAD = 300.0, 500.0, 0.02, 0.7
EAST_M, NORTH_M, ALTITUDE_M = 100.0, -50.0, 30.0
STAMP_NS = 7_000_000_000
SIGMA_M = 3.0


@pytest.fixture(scope="module")
def arc() -> Track:
    """Return an arc to the left that rises."""
    return Track(
        name="arc",
        alignment=Alignment(
            [Element.from_radii(LENGTH_M, -RADIUS_M, -RADIUS_M)],
            x_m=EAST_M,
            y_m=NORTH_M,
            heading_rad=HEADING_RAD,
        ),
        gradients_permil=StepProfile([0.0], [1e3 * SLOPE]),
        limits_mps=limits_from_kmh(()),
        stops_m=(),
        start_altitude_m=ALTITUDE_M,
    )


def closed_form(chainage_m: float) -> tuple[FloatArray, FloatArray]:
    """Return place and change of place per metre of chainage."""
    psi = HEADING_RAD + chainage_m / RADIUS_M
    x_m = EAST_M + RADIUS_M * (math.sin(psi) - math.sin(HEADING_RAD))
    y_m = NORTH_M + RADIUS_M * (math.cos(HEADING_RAD) - math.cos(psi))
    place = np.array([x_m, y_m, ALTITUDE_M + SLOPE * chainage_m])
    return place, np.array([math.cos(psi), math.sin(psi), SLOPE])


@pytest.mark.parametrize("chainage_m", [0.0, 123.4, LENGTH_M])
def test_on_an_arc_it_is_that_of_the_closed_form(arc: Track, chainage_m: float) -> None:
    pose = pose_on(arc, STAMP_NS, chainage_m, SIGMA_M**2)
    place, change = closed_form(chainage_m)
    assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx(place)
    ahead = change / np.linalg.norm(change)
    assert pose.axes[:, 0] == pytest.approx(ahead)
    # Across and up are alike: whatever is not along the track is a ball.
    assert OFF_TRACK_M[0] == OFF_TRACK_M[1]
    expected = SIGMA_M**2 * np.outer(change, change)
    expected += OFF_TRACK_M[0] ** 2 * (np.eye(3) - np.outer(ahead, ahead))
    assert pose.covariance[:3, :3] == pytest.approx(expected)


def test_two_places_apart_by_sigma_are_apart_by_the_axis_of_the_ellipsoid(arc: Track) -> None:
    pose = pose_on(arc, STAMP_NS, 200.0, 0.5**2)
    moved = closed_form(200.5)[0] - closed_form(200.0)[0]
    values, vectors = np.linalg.eigh(pose.covariance[:3, :3])
    assert math.sqrt(values[-1]) == pytest.approx(np.linalg.norm(moved), rel=1e-3)
    assert abs(vectors[:, -1] @ moved) == pytest.approx(np.linalg.norm(moved), rel=1e-5)


@pytest.mark.parametrize(("chainage_m", "end_m"), [(-2.0, 0.0), (LENGTH_M + 1.0, LENGTH_M)])
def test_beyond_an_end_it_is_that_of_the_end(arc: Track, chainage_m: float, end_m: float) -> None:
    assert pose_on(arc, STAMP_NS, chainage_m, None) == pose_on(arc, STAMP_NS, end_m, None)


def row(topic: Topic, **values: float) -> list[float]:
    """Return a row of a table, NaN where nothing is given."""
    return [values.get(name, math.nan) for name in topic.columns]


def scene_of(arc: Track, tables: list[tuple[Topic, list[list[float]]]]) -> MapScene:
    """Return a scene of as many trains as the truth has."""
    arrays = {topic.pattern: np.array(rows) for topic, rows in tables}
    trains = [f"train_{number}" for number in range(len(arrays[STATE.pattern]))]
    tracks = ["arc"] * len(trains)
    network = Network({"arc": arc})
    return MapScene(STAMP_NS, trains, network, tracks, lambda topic: arrays.get(topic.pattern))


def test_each_source_that_knows_a_train_gives_its_pose(arc: Track) -> None:
    here = row(STATE, track_index=0.0, chainage_m=250.0, on_line=1.0)
    scene = scene_of(
        arc,
        [
            (STATE, [here, here, row(STATE, track_index=0.0, chainage_m=250.0, on_line=0.0)]),
            (
                POSITION,
                [[0.0, 251.0, 4.0, 20.0], [0.0, 200.0, math.inf, 0.0], [0.0, 9.0, 1.0, 0.0]],
            ),
            (
                DOPPLER_FIX,
                [
                    row(DOPPLER_FIX, reason=0.0, chainage_m=249.0, chainage_m2=1.0),
                    row(DOPPLER_FIX, reason=2.0),
                    row(DOPPLER_FIX, reason=0.0, chainage_m=9.0, chainage_m2=1.0),
                ],
            ),
            (
                LOCALIZER_STATE,
                [
                    row(LOCALIZER_STATE, front_m=250.5, sigma_m=0.5),
                    row(LOCALIZER_STATE, sigma_m=math.inf),
                    row(LOCALIZER_STATE, front_m=9.0, sigma_m=0.5),
                ],
            ),
        ],
    )
    locators = [RANGING, DOPPLER, LOCALIZER]
    assert map_poses(scene, 0, locators) == {
        TRUTH: pose_on(arc, STAMP_NS, 250.0, None),
        "ranging": pose_on(arc, STAMP_NS, 251.0, 4.0),
        "doppler": pose_on(arc, STAMP_NS, 249.0, 1.0),
        "localizer": pose_on(arc, STAMP_NS, 250.5, 0.25),
    }
    # Where no position is known there is none; of a train off the line not even the truth.
    assert {*map_poses(scene, 1, locators)} == {TRUTH}
    assert map_poses(scene, 2, locators) == {}


@pytest.mark.parametrize(
    ("name", "sources"), [("demo", ["ranging"]), ("sensors", ["ranging", "doppler", "localizer"])]
)
def test_sources_are_those_of_the_scenario(name: str, sources: list[str]) -> None:
    found = locators_of(records_of(load_scenario(name)))
    assert [each.name for each in found] == sources
