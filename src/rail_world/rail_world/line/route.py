"""A route: the path over one or more tracks, measured by one distance.

The path distance is 0 at chainage 0 of the first track and increases with chainage everywhere; a
train that runs towards decreasing chainage has a decreasing path distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rail_signals.arrays import FloatArray

from .profile import StepProfile
from .track import Pose, Track

_TOLERANCE_M = 1e-6


@dataclass(frozen=True)
class Leg:
    """The part of one track, from chainage 0 on, that a route uses.

    Parameters
    ----------
    track : Track
        The track.
    path_start_m : float
        Path distance of its chainage 0 [m].
    end_m : float
        Chainage where the route leaves the track [m].
    """

    track: Track
    path_start_m: float
    end_m: float

    @property
    def path_end_m(self) -> float:
        """Path distance where the route leaves the track [m]."""
        return self.path_start_m + self.end_m


class Route:
    """Legs end to end.

    Parameters
    ----------
    legs : sequence of Leg
        In order of increasing path distance.
    """

    def __init__(self, legs: Sequence[Leg]) -> None:
        self.legs = tuple(legs)
        self._starts_m = np.array([leg.path_start_m for leg in self.legs])

    @property
    def length_m(self) -> float:
        """Length of the path [m]."""
        return self.legs[-1].path_end_m

    @property
    def tracks(self) -> tuple[str, ...]:
        """Names of the tracks, by increasing path distance."""
        return tuple(leg.track.name for leg in self.legs)

    @property
    def stops_m(self) -> tuple[float, ...]:
        """Path distances of the stopping points on the route [m], increasing."""
        stops: list[float] = []
        for leg in self.legs:
            # A stop at the very end may lie beyond it by the rounding of a sum of elements.
            stops += [
                leg.path_start_m + min(s, leg.end_m)
                for s in leg.track.stops_m
                if s <= leg.end_m + _TOLERANCE_M
            ]
        return tuple(sorted(set(stops)))

    def path_of(self, track: str, chainage_m: float) -> float:
        """Path distance [m] of a point; ValueError if the route does not pass it."""
        for leg in self.legs:
            if leg.track.name == track:
                if not -_TOLERANCE_M <= chainage_m <= leg.end_m + _TOLERANCE_M:
                    raise ValueError(
                        f"chainage {chainage_m:g} m of {track} is off the route, which uses"
                        f" 0 ... {leg.end_m:g} m of it"
                    )
                return leg.path_start_m + min(max(chainage_m, 0.0), leg.end_m)
        raise ValueError(f"the route does not use the track {track}")

    def locate(self, path_m: float) -> tuple[str, float]:
        """Track and chainage [m] of one path distance [m]; ValueError off the route."""
        if not -_TOLERANCE_M <= path_m <= self.length_m + _TOLERANCE_M:
            raise ValueError(f"{path_m} m is off the route (0 ... {self.length_m} m)")
        for leg in self.legs:
            if path_m <= leg.path_end_m:
                break
        return leg.track.name, min(max(path_m - leg.path_start_m, 0.0), leg.end_m)

    def locate_all(self, path_m: npt.ArrayLike) -> tuple[npt.NDArray[np.intp], FloatArray]:
        """Leg index [...] and chainage [...] [m] of path distances [...] [m]."""
        path = np.asarray(path_m, dtype=np.float64)
        inside = (path >= -_TOLERANCE_M) & (path <= self.length_m + _TOLERANCE_M)
        if not inside.all():
            raise ValueError(f"a path distance is off the route (0 ... {self.length_m} m)")
        path = np.minimum(np.maximum(path, 0.0), self.length_m)
        # side="left": the points themselves belong to the track they lie on, as in locate().
        leg = np.maximum(np.searchsorted(self._starts_m, path, side="left") - 1, 0)
        return leg, path - self._starts_m[leg]

    def pose(self, path_m: npt.ArrayLike) -> Pose:
        """Position and heading at path distances [...]; ValueError off the route."""
        index, chainage = self.locate_all(path_m)
        if len(self.legs) == 1:
            return self.legs[0].track.pose(chainage)
        result = np.empty((4, *chainage.shape))
        for number, leg in enumerate(self.legs):
            here = index == number
            if not np.any(here):
                continue
            pose = leg.track.pose(np.clip(chainage[here], 0.0, leg.end_m))
            result[:, here] = (pose.x_m, pose.y_m, pose.z_m, pose.heading_rad)
        return Pose(*result)

    def altitude_m(self, path_m: npt.ArrayLike) -> FloatArray:
        """Altitude [m] at path distances [...]."""
        return self.pose(path_m).z_m

    def gradient_permil(self, path_m: npt.ArrayLike) -> FloatArray:
        """Slope [per mille] at path distances [...], uphill towards increasing path positive."""
        return self.gradients_permil.at(self._on_route(path_m))

    def limit_mps(self, path_m: npt.ArrayLike) -> FloatArray:
        """Speed limit [m/s] at path distances [...]."""
        return self.limits_mps.at(self._on_route(path_m))

    def curvature_per_m(self, path_m: npt.ArrayLike) -> FloatArray:
        """Curvature [1/m] at path distances [...], positive to the left."""
        index, chainage = self.locate_all(path_m)
        result = np.empty(chainage.shape)
        for number, leg in enumerate(self.legs):
            here = index == number
            if np.any(here):
                result[here] = leg.track.curvature_per_m(np.clip(chainage[here], 0.0, leg.end_m))
        return result

    @property
    def gradients_permil(self) -> StepProfile:
        """Gradients along the path."""
        return self._joined([leg.track.gradients_permil for leg in self.legs])

    @property
    def limits_mps(self) -> StepProfile:
        """Speed limits along the path."""
        return self._joined([leg.track.limits_mps for leg in self.legs])

    def _on_route(self, path_m: npt.ArrayLike) -> FloatArray:
        self.locate_all(path_m)
        return np.asarray(path_m, dtype=np.float64)

    def _joined(self, profiles: Sequence[StepProfile]) -> StepProfile:
        starts_m: list[float] = []
        values: list[float] = []
        for leg, profile in zip(self.legs, profiles, strict=True):
            if leg.end_m <= 0.0 and leg is not self.legs[-1]:
                continue
            for start_m, value in profile.part(0.0, leg.end_m):
                starts_m.append(leg.path_start_m + start_m)
                values.append(value)
        return StepProfile(starts_m, values)
