from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rail_world.errors import WorldDataError, shorten
from rail_world.line.description import TrackDescription
from rail_world.line.profile import StepProfile
from rail_world.line.track import track_from_description

PLAIN: dict[str, Any] = {
    "elements": [
        {"straight_m": 400.0},
        {"clothoid_m": 80.0, "from_radius_m": None, "to_radius_m": 500.0},
        {"arc_m": 200.0, "radius_m": 500.0},
        {"clothoid_m": 80.0, "from_radius_m": 500.0, "to_radius_m": None},
    ],
    "gradients": [[0.0, 5.0], [200.0, -10.0]],
    "speed_limits": [[0.0, 80.0], [300.0, 60.0]],
    "stops_m": [0.0, 350.0],
    "altitude_m": 40.0,
    "start": {"x_m": 10.0, "y_m": 20.0, "heading_deg": 90.0},
}


def described(**changes: Any) -> TrackDescription:
    return TrackDescription.model_validate({**PLAIN, **changes})


def test_track_is_what_was_described() -> None:
    description = described()
    track = track_from_description("main", description)
    assert description.length_m == track.length_m == 760.0
    pose = track.pose([0.0, 400.0, 760.0])
    np.testing.assert_allclose(pose.x_m[:2], 10.0, atol=1e-12)
    np.testing.assert_allclose(pose.y_m[:2], [20.0, 420.0])
    # 80/1000 rad on each clothoid and 0.4 rad on the arc, to the right.
    np.testing.assert_allclose(pose.heading_rad[2], math.pi / 2 - 0.56)
    np.testing.assert_allclose(pose.z_m, [40.0, 41.0 - 2.0, 41.0 - 5.6])
    np.testing.assert_allclose(track.limit_mps([299.0, 300.0]) * 3.6, [80.0, 60.0])
    np.testing.assert_allclose(track.gradient_permil([199.0, 200.0]), [5.0, -10.0])
    np.testing.assert_allclose(track.curvature_per_m([100.0, 440.0, 500.0]), [0, -1e-3, -2e-3])
    assert track.stops_m == (0.0, 350.0)


def test_track_without_limits_has_none() -> None:
    track = track_from_description("main", described(speed_limits=[]))
    assert track.limit_mps(100.0) == math.inf


@pytest.mark.parametrize("exclude_unset", [True, False])
@pytest.mark.parametrize("content", [PLAIN, {"ttobench": "line.json"}], ids=["inline", "file"])
def test_description_survives_its_own_dump(content: dict[str, Any], exclude_unset: bool) -> None:
    description = TrackDescription.model_validate(content)
    dumped = description.model_dump_json(exclude_unset=exclude_unset)
    assert TrackDescription.model_validate_json(dumped) == description


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"elements": None}, "elements"),
        ({"elements": []}, "elements"),
        ({"elements": [{"straight_m": -1.0}]}, "elements.0.straight.straight_m"),
        ({"elements": [{"straight_m": 0.0}]}, "straight_m"),
        ({"elements": [{"straight_m": math.nan}]}, "straight_m"),
        ({"elements": [{"straight_m": math.inf}]}, "straight_m"),
        ({"elements": [{"straight_m": 1e10}]}, "straight_m"),
        ({"elements": [{"straight_m": 10**400}]}, "straight_m"),
        ({"elements": [{"straight_m": True}]}, "straight_m"),
        ({"elements": [{"straight_m": "long"}]}, "straight_m"),
        ({"elements": [{"straight_m": 1.0, "radius_m": 3.0}]}, "radius_m"),
        ({"elements": [{"arc_m": 10.0}]}, "radius_m"),
        ({"elements": [{"arc_m": 10.0, "radius_m": 0.0}]}, "radius_m"),
        ({"elements": [{"arc_m": 10.0, "radius_m": -5.0}]}, "radius_m"),
        ({"elements": [{"arc_m": 4000.0, "radius_m": 300.0}]}, "turns 764 degrees"),
        ({"elements": [{"clothoid_m": 9000.0, "to_radius_m": 300.0}]}, "turns"),
        ({"elements": [{"clothoid_m": 10.0, "to_radius_m": math.nan}]}, "to_radius_m"),
        ({"elements": [{"curve_m": 10.0}]}, "straight_m, arc_m, clothoid_m"),
        ({"elements": [17]}, "straight_m, arc_m, clothoid_m"),
        ({"elements": [{"straight_m": 6e5}, {"straight_m": 6e5}]}, "1000 km"),
        ({"elements": "straight"}, "elements"),
        ({"gradients": [[10.0, 5.0]]}, "gradients"),
        ({"gradients": [[0.0, 5.0], [0.0, 6.0]]}, "gradients"),
        ({"gradients": [[0.0, 500.0]]}, "gradients.0.1"),
        ({"gradients": [[0.0]]}, "gradients.0"),
        ({"gradients": [[0.0, 1.0], [761.0, 2.0]]}, "gradients"),
        ({"speed_limits": [[0.0, 0.0]]}, "speed_limits.0.1"),
        ({"speed_limits": [[0.0, -5.0]]}, "speed_limits.0.1"),
        ({"speed_limits": [[0.0, 1e4]]}, "speed_limits.0.1"),
        ({"speed_limits": [[-1.0, 50.0]]}, "speed_limits.0.0"),
        ({"speed_limits": [[0.0, 50.0], [900.0, 60.0]]}, "speed_limits"),
        ({"stops_m": [100.0, 50.0]}, "stops_m"),
        ({"stops_m": [800.0]}, "stops_m"),
        ({"stops_m": [math.nan]}, "stops_m.0"),
        ({"altitude_m": 1e5}, "altitude_m"),
        ({"start": {"x_m": 1e300}}, "start.x_m"),
        ({"start": {"z_m": 1.0}}, "start.z_m"),
        ({"ttobench": "line.json"}, "either elements or ttobench"),
        ({"elements": None, "ttobench": "line.json"}, "comes from the TTOBench file"),
        ({"colour": "red"}, "colour"),
    ],
)
def test_wrong_tracks_are_refused_by_field(change: dict[str, Any], field: str) -> None:
    with pytest.raises(ValidationError) as caught:
        described(**change)
    first = caught.value.errors(include_url=False)[0]
    where = ".".join(str(part) for part in first["loc"])
    assert field in f"{where}: {first['msg']}"


def test_profile_integral_is_the_area() -> None:
    profile = StepProfile([0.0, 10.0, 30.0], [2.0, -1.0, 4.0])
    x = np.linspace(-5.0, 50.0, 1101)
    area = np.concatenate(([0.0], np.cumsum(profile.at(x[:-1] + 0.025) * np.diff(x))))
    np.testing.assert_allclose(profile.integral(x) - profile.integral(-5.0), area, atol=1e-9)


def test_profile_part() -> None:
    profile = StepProfile([0.0, 10.0, 30.0], [2.0, -1.0, 4.0])
    assert profile.part(0.0, 30.0) == [(0.0, 2.0), (10.0, -1.0)]
    assert profile.part(15.0, 40.0) == [(15.0, -1.0), (30.0, 4.0)]


@pytest.mark.parametrize(
    ("starts", "values"), [([], []), ([0.0, 0.0], [1.0, 2.0]), ([0.0, 1.0], [1.0])]
)
def test_impossible_profiles_are_refused(starts: list[float], values: list[float]) -> None:
    with pytest.raises(ValueError, match=r"profile|positions"):
        StepProfile(starts, values)


@given(st.text(max_size=100) | st.integers() | st.lists(st.text(max_size=30), max_size=4))
def test_errors_are_one_short_line(value: object) -> None:
    assert len(shorten(value)) <= 60
    text = str(WorldDataError("a.b", value, "some\nreason"))
    assert text.splitlines() == [text]
    assert text.startswith("a.b: ")
    assert text.endswith(": some reason")
