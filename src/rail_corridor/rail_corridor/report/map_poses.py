"""Poses of trains in ``map`` for filters and viewers: the truth, and what each equipment thinks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

from rail_corridor.equipment.map_scene import MapScene, TrackEstimate
from rail_corridor.equipment.registry import subsystems
from rail_corridor.equipment.subsystem import Subsystem
from rail_corridor.run_data import RecordSpec
from rail_msgs_py.map_pose import MapPose
from rail_msgs_py.topics.world import STATE
from rail_world.line.track import Track

#: Source of the poses that are exact.
TRUTH: Final = "truth"


def locators_of(records: Iterable[RecordSpec]) -> list[Subsystem]:
    """Equipment that says where trains are, of what the report reads."""
    read = [spec.topic for spec in records]
    return [each for each in subsystems() if each.locates_by in read]


def map_poses(scene: MapScene, train: int, locators: Sequence[Subsystem]) -> dict[str, MapPose]:
    """Pose of a train by each source that knows it; none of a train that is not on the line."""
    if not scene.on_line(train):
        return {}
    state = scene.row(STATE, train)
    assert state is not None
    track = list(scene.network.tracks.values())[int(state["track_index"])]
    poses = {TRUTH: pose_on(track, scene.stamp_ns, state["chainage_m"], None)}
    for locator in locators:
        estimate: TrackEstimate | None = locator.map_estimate(scene, train)
        if estimate is not None:
            track = scene.network.tracks[estimate.track]
            poses[locator.name] = pose_on(
                track, scene.stamp_ns, estimate.chainage_m, estimate.variance_m2
            )
    return poses


def pose_on(track: Track, stamp_ns: int, chainage_m: float, variance_m2: float | None) -> MapPose:
    """Pose of a place of a track; of one beyond its ends that of the end."""
    at_m = min(max(chainage_m, 0.0), track.length_m)
    pose = track.pose(at_m)
    return MapPose(
        stamp_ns,
        float(pose.x_m),
        float(pose.y_m),
        float(pose.z_m),
        float(pose.heading_rad),
        1e-3 * float(track.gradient_permil(at_m)),
        variance_m2,
    )
