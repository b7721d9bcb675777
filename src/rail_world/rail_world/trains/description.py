"""The validated description of vehicles, and of trains and what their drivers intend."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from rail_msgs_py.quantities import (
    ADHESION,
    BRAKE_FACTOR,
    DIRECTION,
    FAULT_BEGIN,
    FAULT_END,
    SLIP_RATIO,
    TRAIN_LENGTH,
    TRAIN_START,
    Direction,
)
from rail_world.line.description_base import (
    Chainage,
    Description,
    Name,
    Speed,
    StrictFloat,
    field_of,
    range_of,
)

from .presets import PRESETS


class Davis(Description):
    """Running resistance a + b v + c v^2 on straight, level track (Davis, 1926)."""

    a_n: StrictFloat = Field(ge=0.0, le=1e6, description="constant term [N]")
    b_n_per_mps: StrictFloat = Field(ge=0.0, le=1e5, description="linear term [N/(m/s)]")
    c_n_per_mps2: StrictFloat = Field(ge=0.0, le=1e4, description="quadratic term [N/(m/s)^2]")


class VehicleDescription(Description):
    """A train set; every figure left out is the preset's."""

    preset: Literal["metro", "regional", "high_speed"] = Field(
        default="metro", description="where the figures left out come from"
    )
    mass_kg: StrictFloat = Field(ge=1e3, le=1e7, description="mass [kg]")
    rotating_mass_factor: StrictFloat = Field(
        ge=1.0, le=1.5, description="inertia of wheels and motors: effective over true mass"
    )
    davis: Davis = Field(description="running resistance")
    max_traction_n: StrictFloat = Field(gt=0.0, le=1e7, description="greatest tractive effort [N]")
    max_power_w: StrictFloat = Field(gt=0.0, le=1e8, description="greatest power at the wheels [W]")
    max_service_brake_mps2: StrictFloat = Field(
        ge=0.2, le=3.0, description="full service braking on level track [m/s^2]"
    )
    emergency_brake_mps2: StrictFloat = Field(
        ge=0.2, le=5.0, description="emergency braking on level track [m/s^2]"
    )
    brake_build_up_s: StrictFloat = Field(
        ge=0.0, le=10.0, description="from the demand to the full force of a brake, a ramp [s]"
    )
    max_speed_kmh: Speed = Field(description="design speed [km/h]")
    wheel_diameter_m: StrictFloat = Field(
        ge=0.1, le=3.0, description="diameter of the wheel that the odometer counts [m]"
    )
    odometer_pulses: StrictFloat = Field(
        ge=0.0, le=1e5, description="pulses per turn of that wheel; 0 = as fine as one likes"
    )
    length_m: Annotated[StrictFloat, range_of(TRAIN_LENGTH)]

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        name = data.get("preset", "metro")
        preset = PRESETS.get(name) if isinstance(name, str) else None
        if preset is None:  # the field itself says what is wrong; no second message
            preset = PRESETS["metro"]
        merged: dict[Any, Any] = {**preset, **data}
        if isinstance(data.get("davis"), Mapping):
            merged["davis"] = {**preset["davis"], **data["davis"]}
        return merged

    @model_validator(mode="after")
    def _brakes_agree(self) -> VehicleDescription:
        if self.emergency_brake_mps2 < self.max_service_brake_mps2:
            raise ValueError(
                f"emergency_brake_mps2: {self.emergency_brake_mps2:g} is weaker than the service"
                f" brake, {self.max_service_brake_mps2:g}"
            )
        return self


class PlaceDescription(Description):
    """A point of a route."""

    at_m: Chainage = Field(description="chainage [m]")
    track: Name | None = Field(default=None, description="track; null = the first of the route")


def _number_is_place(value: object) -> object:
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        return {"at_m": value}
    return value


Place = Annotated[PlaceDescription, BeforeValidator(_number_is_place)]


class ReversalDescription(Description):
    """The train stops at a point, or at a time, and runs back."""

    at_m: Chainage | None = Field(default=None, description="chainage to stop at [m]")
    at_s: Annotated[StrictFloat, Field(ge=0.0, le=1e6)] | None = Field(
        default=None, description="time at which the train brakes to a stand [s]"
    )
    track: Name | None = Field(default=None, description="track of at_m; null = the first one")
    dwell_s: StrictFloat = Field(
        default=10.0, ge=0.0, le=1e5, description="stand before running back [s]"
    )

    @model_validator(mode="after")
    def _one_trigger(self) -> ReversalDescription:
        if (self.at_m is None) == (self.at_s is None):
            raise ValueError("a reversal has either at_m or at_s")
        if self.at_m is None and self.track is not None:
            raise ValueError("track: goes with at_m only")
        return self


class TrainDescription(Description):
    """A train and what its driver intends."""

    name: Name = Field(description="name, also the ROS namespace: [a-z][a-z0-9_]*")
    route: tuple[Name, ...] = Field(
        min_length=1, max_length=100, description="tracks in order of travel, joined by junctions"
    )
    start_m: StrictFloat = field_of(TRAIN_START)
    depart_s: StrictFloat = Field(default=0.0, ge=0.0, le=1e6, description="time of departure [s]")
    speed_kmh: StrictFloat = Field(
        default=0.0, ge=0.0, le=600.0, description="speed at departure [km/h]"
    )
    direction: Direction = field_of(DIRECTION)
    enters_at_departure: bool = Field(
        default=False, description="whether the train is not on the line before it departs"
    )
    leaves_on_arrival: bool = Field(
        default=False,
        description="whether the train is gone when its run ends; it then runs out of the end of a"
        " track without braking",
    )
    dwell_s: StrictFloat = Field(
        default=30.0, ge=0.0, le=1e5, description="stand at every stop [s]"
    )
    target_speed_kmh: Speed | None = Field(
        default=None, description="the driver goes no faster than this [km/h]"
    )
    sight_m: StrictFloat = Field(
        default=80.0, ge=10.0, le=1000.0, description="how far its driver sees on sight [m]"
    )
    stop_at_m: tuple[Place, ...] = Field(
        default=(),
        max_length=10_000,
        description="further stops: chainages on the first track [m], or {track, at_m}",
    )
    reverse_at: tuple[ReversalDescription, ...] = Field(
        default=(), max_length=1000, description="points or times of turning back, in order"
    )
    vehicle: VehicleDescription = Field(
        default_factory=lambda: VehicleDescription.model_validate({}), description="the train set"
    )

    @model_validator(mode="after")
    def _agrees(self) -> TrainDescription:
        if len(set(self.route)) != len(self.route):
            raise ValueError("route: a track comes twice")
        if self.speed_kmh > 0.0 and self.depart_s > 0.0 and not self.enters_at_departure:
            raise ValueError(
                "speed_kmh: a train that waits on the line until depart_s starts from standstill"
            )
        return self


class TrainStop(Description):
    """A train that brakes to a stand by itself, from one time [s] to another."""

    train: str
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]


class WheelSlip(Description):
    """Wheels that turn `ratio` times as fast as the train runs, from one time [s] to another."""

    train: str
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]
    ratio: Annotated[float, range_of(SLIP_RATIO)]


class ReducedBraking(Description):
    """Brakes that give a part of their force, from one time [s] to another."""

    train: str
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]
    service: Annotated[float, range_of(BRAKE_FACTOR)]
    emergency: Annotated[float, range_of(BRAKE_FACTOR)]


class LowAdhesion(Description):
    """Rails on which the wheels of a train slide and spin, from one time [s] to another."""

    train: str
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]
    adhesion: Annotated[float, range_of(ADHESION)]


class SpeedRestriction(Description):
    """A lower limit on a stretch of a track, from one time [s] to another."""

    track: str
    from_m: float
    to_m: float
    speed_kmh: float
    from_s: Annotated[float, range_of(FAULT_BEGIN)]
    to_s: Annotated[float, range_of(FAULT_END)]
