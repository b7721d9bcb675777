"""The TTOBench track format, versions 1.x, as validated models.

Keys are those of the files; see ``ttobench.load_ttobench`` for their meaning. Fields the format
may gain in later versions are ignored.
"""

from __future__ import annotations

import math
from typing import Annotated, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from rail_world.line.description import TIGHTEST_RADIUS_M, check_increasing
from rail_world.line.description_base import LONGEST_TRACK_M

LENGTH_M: Final = {"m": 1.0, "km": 1e3}
SPEED_KMH: Final = {"km/h": 1.0, "m/s": 3.6}
SLOPE_PERMIL: Final = {"permil": 1.0, "\u2030": 1.0, "%": 10.0, "percent": 10.0}


def _a_number(value: object) -> object:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("a number is wanted")
    return value


def _radius(value: object) -> object:
    if value in ("infinity", "+infinity", "-infinity"):
        return math.inf
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError('a radius or "infinity" is wanted')
    if value == 0:
        raise ValueError("a radius cannot be zero")
    return value


FiniteFloat = Annotated[float, BeforeValidator(_a_number), Field(allow_inf_nan=False)]
Radius = Annotated[float, BeforeValidator(_radius)]
LengthUnit = Literal["m", "km"]


class TTOBenchSection(BaseModel):
    """A part of a file."""

    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True)


class Metadata(TTOBenchSection):
    """Where the file comes from."""

    id: Annotated[str, Field(max_length=200)] | None = None
    version: Annotated[str, Field(pattern=r"^TTOBench v1\.\d+$")] | None = Field(
        default=None, alias="library version"
    )


class Altitude(TTOBenchSection):
    """Altitude at the first stop."""

    unit: LengthUnit
    value: FiniteFloat

    @model_validator(mode="after")
    def _check(self) -> Altitude:
        altitude_m = self.value * LENGTH_M[self.unit]
        if not -1000.0 <= altitude_m <= 9000.0:
            raise ValueError(f"altitude {altitude_m:g} m is not on this Earth's railways")
        return self


class Stops(TTOBenchSection):
    """Positions of the stops; the last is the length of the track."""

    unit: LengthUnit
    values: tuple[FiniteFloat, ...] = Field(min_length=2, max_length=10_000)

    @model_validator(mode="after")
    def _check(self) -> Stops:
        if self.values[0] != 0.0:
            raise ValueError(f"values: the first stop must be at 0, not {self.values[0]:g}")
        _check_positions(self.values, self.unit)
        return self

    @property
    def positions_m(self) -> tuple[float, ...]:
        """Positions [m]."""
        return tuple(value * LENGTH_M[self.unit] for value in self.values)


class SpeedUnits(TTOBenchSection):
    """Units of the speed limits."""

    position: LengthUnit
    velocity: Literal["km/h", "m/s"]


class SpeedLimits(TTOBenchSection):
    """Pairs of position and limit, each holding up to the next."""

    units: SpeedUnits
    values: tuple[tuple[FiniteFloat, FiniteFloat], ...] = Field(min_length=1, max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> SpeedLimits:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        if self.values[0][0] != 0.0:
            raise ValueError(f"values: the first must be at 0, not {self.values[0][0]:g}")
        for index, (_, limit) in enumerate(self.values):
            if not 1.0 <= limit * SPEED_KMH[self.units.velocity] <= 600.0:
                raise ValueError(
                    f"values.{index}: a limit of {limit:g} {self.units.velocity} is not within"
                    " 1 ... 600 km/h"
                )
        return self


class SlopeUnits(TTOBenchSection):
    """Units of the gradients."""

    position: LengthUnit
    slope: Literal["permil", "\u2030", "%", "percent"]


class Gradients(TTOBenchSection):
    """Pairs of position and slope, uphill positive."""

    units: SlopeUnits
    values: tuple[tuple[FiniteFloat, FiniteFloat], ...] = Field(max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> Gradients:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        for index, (_, slope) in enumerate(self.values):
            if abs(slope * SLOPE_PERMIL[self.units.slope]) > 150.0:
                raise ValueError(
                    f"values.{index}: a slope of {slope:g} {self.units.slope} is beyond 150 permil"
                )
        return self


class CurvatureUnits(TTOBenchSection):
    """Units of the curvatures."""

    position: LengthUnit
    start: LengthUnit = Field(alias="radius at start")
    end: LengthUnit = Field(alias="radius at end")


class Curvatures(TTOBenchSection):
    """Triples of position, radius at the start and radius at the end, right positive."""

    units: CurvatureUnits
    values: tuple[tuple[FiniteFloat, Radius, Radius], ...] = Field(max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> Curvatures:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        for index, (_, start, end) in enumerate(self.values):
            for radius, unit in ((start, self.units.start), (end, self.units.end)):
                if abs(radius * LENGTH_M[unit]) < TIGHTEST_RADIUS_M:
                    raise ValueError(
                        f"values.{index}: a radius of {radius:g} {unit} is below"
                        f" {TIGHTEST_RADIUS_M:g} m"
                    )
        return self


class TTOBenchFile(TTOBenchSection):
    """A whole file."""

    metadata: Metadata = Metadata()
    altitude: Altitude = Altitude(unit="m", value=0.0)
    stops: Stops
    speed_limits: SpeedLimits = Field(alias="speed limits")
    gradients: Gradients | None = None
    curvatures: Curvatures | None = None


def _check_positions(positions: tuple[float, ...], unit: str) -> None:
    scaled = tuple(position * LENGTH_M[unit] for position in positions)
    check_increasing("values", scaled)
    if scaled and scaled[0] < 0.0:
        raise ValueError(f"values: position {scaled[0]:g} m is negative")
    if scaled and scaled[-1] > LONGEST_TRACK_M:
        raise ValueError(f"values: position {scaled[-1]:g} m is beyond 1000 km")
