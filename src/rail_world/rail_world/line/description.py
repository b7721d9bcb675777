"""The validated description of tracks and junctions.

Every model is frozen, refuses unknown fields, and bounds every number, so that a mistake is
reported once, with the name of its field, before anything starts.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import Annotated, Final

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from .description_base import (
    LONGEST_TRACK_M,
    Chainage,
    Description,
    Length,
    Name,
    Speed,
    StrictFloat,
)

TIGHTEST_RADIUS_M: Final = 20.0
_MOST_TURN_RAD = 4.0 * math.pi
_MOST_POINTS = 100_000


def _check_radius(value: object) -> object:
    if isinstance(value, int | float) and math.isfinite(value) and abs(value) < TIGHTEST_RADIUS_M:
        raise ValueError(f"a radius must be at least {TIGHTEST_RADIUS_M:g} m")
    return value


Radius = Annotated[StrictFloat, BeforeValidator(_check_radius), Field(ge=-1e7, le=1e7)]


class Straight(Description):
    """A straight."""

    straight_m: Length = Field(description="length [m]")


class Arc(Description):
    """A circular arc."""

    arc_m: Length = Field(description="length [m]")
    radius_m: Radius = Field(description="radius [m], positive = curve to the right")

    @model_validator(mode="after")
    def _turns_little(self) -> Arc:
        _check_turn(self.arc_m / self.radius_m)
        return self


class Clothoid(Description):
    """A transition curve whose curvature changes linearly with length."""

    clothoid_m: Length = Field(description="length [m]")
    from_radius_m: Radius | None = Field(
        default=None, description="radius at the start [m], positive = right, null = straight"
    )
    to_radius_m: Radius | None = Field(
        default=None, description="radius at the end [m], positive = right, null = straight"
    )

    @model_validator(mode="after")
    def _turns_little(self) -> Clothoid:
        for radius_m in (self.from_radius_m, self.to_radius_m):
            _check_turn(0.0 if radius_m is None else self.clothoid_m / radius_m)
        return self


def _check_turn(turn_rad: float) -> None:
    if abs(turn_rad) > _MOST_TURN_RAD:
        raise ValueError(
            f"the element turns {abs(math.degrees(turn_rad)):.0f} degrees (at most 720)"
        )


def _kind_of_element(value: object) -> str | None:
    kinds = (("straight_m", "straight"), ("arc_m", "arc"), ("clothoid_m", "clothoid"))
    for key, kind in kinds:
        if (isinstance(value, Mapping) and key in value) or hasattr(value, key):
            return kind
    return None


TrackElement = Annotated[
    Annotated[Straight, Tag("straight")]
    | Annotated[Arc, Tag("arc")]
    | Annotated[Clothoid, Tag("clothoid")],
    Discriminator(
        _kind_of_element,
        custom_error_type="track_element",
        custom_error_message="an element has one of the keys straight_m, arc_m, clothoid_m",
    ),
]


class StartPose(Description):
    """Where chainage 0 lies in the map frame."""

    x_m: StrictFloat = Field(default=0.0, ge=-1e7, le=1e7, description="east [m]")
    y_m: StrictFloat = Field(default=0.0, ge=-1e7, le=1e7, description="north [m]")
    heading_deg: StrictFloat = Field(
        default=0.0, ge=-360.0, le=360.0, description="counter-clockwise from east [deg]"
    )


Gradient = tuple[Chainage, Annotated[StrictFloat, Field(ge=-150.0, le=150.0)]]
SpeedLimit = tuple[Chainage, Speed]


def _check_steps(name: str, points: tuple[tuple[float, float], ...]) -> None:
    chainages = [chainage for chainage, _ in points]
    if chainages and chainages[0] != 0.0:
        raise ValueError(f"{name}: the first must be at chainage 0, not {chainages[0]:g} m")
    check_increasing(name, chainages)


def check_increasing(name: str, chainages_m: list[float] | tuple[float, ...]) -> None:
    """Raise ValueError naming the first chainage [m] that is not above the one before it."""
    for before, after in pairwise(chainages_m):
        if after <= before:
            raise ValueError(
                f"{name}: chainages must increase, but {after:g} m follows {before:g} m"
            )


class TrackDescription(Description):
    """A track, either inline (``elements`` and what goes with them) or in a TTOBench file."""

    elements: tuple[TrackElement, ...] | None = Field(
        default=None,
        min_length=1,
        max_length=_MOST_POINTS,
        description="straights, arcs and clothoids in order of chainage",
    )
    gradients: tuple[Gradient, ...] = Field(
        default=(),
        max_length=_MOST_POINTS,
        description="[chainage m, per mille] pairs, uphill positive; none = level",
    )
    speed_limits: tuple[SpeedLimit, ...] = Field(
        default=(),
        max_length=_MOST_POINTS,
        description="[chainage m, km/h] pairs; none = no limit but the vehicle's",
    )
    stops_m: tuple[Chainage, ...] = Field(
        default=(), max_length=10_000, description="chainages of the stopping points [m]"
    )
    altitude_m: StrictFloat = Field(
        default=0.0, ge=-1000.0, le=9000.0, description="altitude at chainage 0 [m]"
    )
    ttobench: str | None = Field(
        default=None,
        min_length=1,
        max_length=4096,
        description="TTOBench file that describes the track, relative to the scenario file",
    )
    start: StartPose = Field(
        default=StartPose(),
        description="pose of chainage 0; ignored where the track starts at a junction",
    )

    @property
    def length_m(self) -> float | None:
        """Length of the inline elements [m]; None for a TTOBench file, which is not read here."""
        if self.elements is None:
            return None
        return math.fsum(_length_of(element) for element in self.elements)

    @model_validator(mode="after")
    def _agrees(self) -> TrackDescription:
        if (self.elements is None) == (self.ttobench is None):
            raise ValueError("a track has either elements or ttobench")
        if self.ttobench is not None:
            inline = (
                ("gradients", self.gradients),
                ("speed_limits", self.speed_limits),
                ("stops_m", self.stops_m),
                ("altitude_m", self.altitude_m),
            )
            for name, value in inline:
                if value:  # not the default: a dump of this very model stays readable
                    raise ValueError(f"{name}: comes from the TTOBench file, leave it out")
            return self
        _check_steps("gradients", self.gradients)
        _check_steps("speed_limits", self.speed_limits)
        check_increasing("stops_m", self.stops_m)
        length_m = self.length_m or 0.0
        if length_m > LONGEST_TRACK_M:
            raise ValueError(f"elements: {length_m:g} m are longer than 1000 km")
        ends = (
            ("gradients", self.gradients[-1][0] if self.gradients else 0.0),
            ("speed_limits", self.speed_limits[-1][0] if self.speed_limits else 0.0),
            ("stops_m", self.stops_m[-1] if self.stops_m else 0.0),
        )
        for name, last_m in ends:
            if last_m > length_m:
                raise ValueError(
                    f"{name}: {last_m:g} m is off the track, it ends at {length_m:g} m"
                )
        return self


def _length_of(element: Straight | Arc | Clothoid) -> float:
    if isinstance(element, Straight):
        return element.straight_m
    return element.arc_m if isinstance(element, Arc) else element.clothoid_m


class JunctionDescription(Description):
    """Facing points: the branch begins on another track, tangent to it."""

    track: Name = Field(description="track the points lie on")
    at_m: Chainage = Field(description="chainage of the points on that track [m]")
    branch: Name = Field(description="track whose chainage 0 lies at the points")

    @model_validator(mode="after")
    def _two_tracks(self) -> JunctionDescription:
        if self.track == self.branch:
            raise ValueError(f"branch: {self.branch} cannot branch off itself")
        return self
