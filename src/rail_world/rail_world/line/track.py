"""A track: its alignment, gradients, speed limits and stops."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rail_signals.arrays import FloatArray
from rail_world.line.description import Clothoid, Straight, TrackDescription

from .alignment import Alignment, Element
from .profile import StepProfile


@dataclass(frozen=True)
class Pose:
    """Where points of the track lie: map frame, x east, y north, z up (REP 103).

    Parameters
    ----------
    x_m, y_m, z_m : float64 [...]
        Position [m]; z is the altitude.
    heading_rad : float64 [...]
        Direction of increasing chainage [rad], counter-clockwise from east, not wrapped.
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray


@dataclass(frozen=True)
class Track:
    """One track, from chainage 0 to its length; every method is vectorised over chainages [m].

    Parameters
    ----------
    name : str
        Name of the track, also the ROS frame of positions on it.
    alignment : Alignment
        The plane curve.
    gradients_permil : StepProfile
        Slope, uphill in the direction of increasing chainage positive.
    limits_mps : StepProfile
        Speed limits; infinite where none is set.
    stops_m : tuple of float
        Chainages of the stopping points, increasing.
    start_altitude_m : float
        Altitude at chainage 0 [m].
    """

    name: str
    alignment: Alignment
    gradients_permil: StepProfile
    limits_mps: StepProfile
    stops_m: tuple[float, ...]
    start_altitude_m: float

    @property
    def length_m(self) -> float:
        """Length [m]."""
        return self.alignment.length_m

    def altitude_m(self, chainage_m: npt.ArrayLike) -> FloatArray:
        """Altitude [m]; chainages are measured in plan, so the slope is the tangent."""
        rise: FloatArray = self.gradients_permil.integral(chainage_m)
        origin = float(self.gradients_permil.integral(0.0))
        altitude: FloatArray = self.start_altitude_m + 1e-3 * (rise - origin)
        return altitude

    def pose(self, chainage_m: npt.ArrayLike) -> Pose:
        """Position and heading; ValueError off the track."""
        x_m, y_m, heading_rad = self.alignment.pose(chainage_m)
        return Pose(x_m, y_m, self.altitude_m(chainage_m), heading_rad)

    def gradient_permil(self, chainage_m: npt.ArrayLike) -> FloatArray:
        """Slope [per mille]."""
        return self.gradients_permil.at(chainage_m)

    def limit_mps(self, chainage_m: npt.ArrayLike) -> FloatArray:
        """Speed limit [m/s]."""
        return self.limits_mps.at(chainage_m)

    def curvature_per_m(self, chainage_m: npt.ArrayLike) -> FloatArray:
        """Curvature [1/m], positive to the left."""
        return self.alignment.curvature_per_m(chainage_m)

    def moved(self, x_m: float, y_m: float, heading_rad: float, altitude_m: float) -> Track:
        """Return the same track with another start."""
        alignment = self.alignment.moved(x_m, y_m, heading_rad)
        return dataclasses.replace(self, alignment=alignment, start_altitude_m=altitude_m)


def limits_from_kmh(pairs: tuple[tuple[float, float], ...]) -> StepProfile:
    """Make the profile of speed limits [m/s] from (chainage [m], km/h); none at all is no limit."""
    if not pairs:
        return StepProfile([0.0], [math.inf])
    return StepProfile([p for p, _ in pairs], [v / 3.6 for _, v in pairs])


def gradients_from_permil(pairs: tuple[tuple[float, float], ...]) -> StepProfile:
    """Make the profile of gradients from (chainage [m], per mille); none at all is level."""
    return StepProfile([p for p, _ in pairs] or [0.0], [g for _, g in pairs] or [0.0])


def track_from_description(name: str, description: TrackDescription) -> Track:
    """Make a track from inline elements.

    Raises
    ------
    ValueError
        If the description refers to a TTOBench file, which ``ttobench.load_ttobench`` reads.
    """
    if description.elements is None:
        raise ValueError(f"track {name}: refers to a file")
    elements = []
    for element in description.elements:
        if isinstance(element, Straight):
            elements.append(Element(element.straight_m))
        elif isinstance(element, Clothoid):
            elements.append(
                Element.from_radii(element.clothoid_m, element.from_radius_m, element.to_radius_m)
            )
        else:
            elements.append(Element.from_radii(element.arc_m, element.radius_m, element.radius_m))
    start = description.start
    return Track(
        name=name,
        alignment=Alignment(
            elements, x_m=start.x_m, y_m=start.y_m, heading_rad=float(np.deg2rad(start.heading_deg))
        ),
        gradients_permil=gradients_from_permil(description.gradients),
        limits_mps=limits_from_kmh(description.speed_limits),
        stops_m=description.stops_m,
        start_altitude_m=description.altitude_m,
    )
