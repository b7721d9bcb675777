"""The fouling point: where a branch and the track it leaves are far enough apart to pass."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from rail_corridor.errors import InputError
from rail_world.line.network import Network
from rail_world.line.track import Track

_SEARCHED_M: Final = 2000.0
_STEP_M: Final = 2.0
_PROJECTIONS: Final = 12


@dataclass(frozen=True)
class FoulingPoint:
    """Where a branch is clear of its track.

    ``junction`` is the index of the junction in the scenario, which lies on ``track`` at ``at_m``;
    the fouling point is at ``track_m`` on that track and at ``branch_m`` on ``branch`` [m].
    """

    junction: int
    track: str
    branch: str
    at_m: float
    track_m: float
    branch_m: float


def find_fouling_point(network: Network, junction: int, distance_m: float) -> FoulingPoint:
    """Find the first place where a branch is ``distance_m`` from its track.

    Parameters
    ----------
    network : Network
        The tracks.
    junction : int
        Index of the junction.
    distance_m : float
        Distance of the centre lines [m].

    Raises
    ------
    InputError
        If the branch never gets that far from the track while both lie side by side.
    """
    description = network.junctions[junction]
    track, branch = network.tracks[description.track], network.tracks[description.branch]
    longest_m = min(branch.length_m, _SEARCHED_M)
    branch_m = np.linspace(0.0, longest_m, max(2, int(longest_m / _STEP_M) + 1))
    track_m = _project(track, branch, branch_m, description.at_m)
    clear = _gap_m(track, branch, branch_m, track_m) >= distance_m
    if not clear.any() or track_m[np.argmax(clear)] >= track.length_m:
        raise InputError(
            f"the branch does not get {distance_m:g} m away from {description.track} beside it",
            field=f"junctions.{junction}.branch",
            value=description.branch,
        )
    first = int(np.argmax(clear))

    def excess_m(at_m: float) -> float:
        point = np.array([at_m])
        beside = _project(track, branch, point, description.at_m)
        return float(_gap_m(track, branch, point, beside)[0]) - distance_m

    from scipy.optimize import brentq  # a quarter of a second, and not for every start

    at_m = float(brentq(excess_m, branch_m[first - 1], branch_m[first], xtol=1e-9))
    beside_m = float(_project(track, branch, np.array([at_m]), description.at_m)[0])
    return FoulingPoint(
        junction, description.track, description.branch, description.at_m, beside_m, at_m
    )


def _project(
    track: Track, branch: Track, branch_m: npt.NDArray[np.float64], at_m: float
) -> npt.NDArray[np.float64]:
    """Chainage [n] on the track beside points [n] of the branch, within the track."""
    points = branch.pose(branch_m)
    beside_m = np.minimum(at_m + branch_m, track.length_m)
    for _ in range(_PROJECTIONS):  # converges by a factor of distance over radius each time
        pose = track.pose(beside_m)
        along_m = (points.x_m - pose.x_m) * np.cos(pose.heading_rad) + (
            points.y_m - pose.y_m
        ) * np.sin(pose.heading_rad)
        beside_m = np.clip(beside_m + along_m, 0.0, track.length_m)
    return beside_m


def _gap_m(
    track: Track,
    branch: Track,
    branch_m: npt.NDArray[np.float64],
    track_m: npt.NDArray[np.float64],
) -> npt.NDArray[np.float64]:
    one, other = branch.pose(branch_m), track.pose(track_m)
    return np.hypot(one.x_m - other.x_m, one.y_m - other.y_m)
