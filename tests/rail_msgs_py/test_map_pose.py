"""A pose aligned with the track, and its covariance, in `map`."""

from __future__ import annotations

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from rail_msgs_py.map_pose import OFF_TRACK_M, TURN_RAD, MapPose

POSES = st.builds(
    MapPose,
    st.integers(0, 10**15),
    *(st.floats(-1e5, 1e5) for _ in range(3)),
    st.floats(-math.pi + 1e-6, math.pi),
    st.floats(-0.1, 0.1),
    st.one_of(st.none(), st.floats(1e-6, 1e6)),
)


def turned(message: PoseWithCovarianceStamped) -> np.ndarray:
    """Return the matrix of the orientation of a message."""
    q = message.pose.pose.orientation
    vector, scalar = np.array([q.x, q.y, q.z]), q.w
    columns = []
    for axis in np.eye(3):
        twice = 2.0 * np.cross(vector, axis)
        columns.append(axis + scalar * twice + np.cross(vector, twice))
    return np.array(columns).T


@given(POSES)
def test_a_message_says_all_of_a_pose(pose: MapPose) -> None:
    raw = serialize_message(pose.to_msg())
    read = MapPose.from_msg(deserialize_message(raw, PoseWithCovarianceStamped))
    assert read.stamp_ns == pose.stamp_ns
    assert (read.x_m, read.y_m, read.z_m) == (pose.x_m, pose.y_m, pose.z_m)
    assert read.heading_rad == pytest.approx(pose.heading_rad, abs=1e-9)
    assert read.slope == pytest.approx(pose.slope, abs=1e-9)
    assert read.variance_m2 == (
        None if pose.variance_m2 is None else pytest.approx(pose.variance_m2, rel=1e-6)
    )
    assert ("along" in pose.describe()) is (pose.variance_m2 is not None)


@given(POSES)
def test_the_orientation_is_that_of_the_axes_of_the_track(pose: MapPose) -> None:
    axes = pose.axes
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert turned(pose.to_msg()) == pytest.approx(axes, abs=1e-9)
    # Along the track, to the left on the level, up.
    long = math.hypot(1.0, pose.slope)
    ahead = np.array([math.cos(pose.heading_rad), math.sin(pose.heading_rad), pose.slope]) / long
    assert axes[:, 0] == pytest.approx(ahead, abs=1e-12)
    assert axes[2, 1] == 0.0
    assert axes[2, 2] > 0.9


@given(POSES)
def test_the_covariance_is_that_of_the_track_turned(pose: MapPose) -> None:
    whole = pose.covariance
    assert whole.shape == (6, 6)
    if pose.variance_m2 is None:
        assert not whole.any()
        return
    along_m2 = pose.variance_m2 * (1.0 + pose.slope**2)
    position = pose.axes.T @ whole[:3, :3] @ pose.axes
    scale = max(1.0, along_m2)
    assert position == pytest.approx(np.diag([along_m2, *np.square(OFF_TRACK_M)]), abs=1e-9 * scale)
    assert pose.axes.T @ whole[3:, 3:] @ pose.axes == pytest.approx(np.diag(np.square(TURN_RAD)))
    assert np.linalg.eigvalsh(whole).min() > 0.0 or along_m2 > 1e5
    assert pose.to_msg().pose.covariance == pytest.approx(whole.ravel())
