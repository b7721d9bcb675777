"""Tracks in the TTOBench format (Kouzoupis, Pendharkar, Corman, OR Forum 4:67, 2023).

Read as the files stand, versions 1.x: ``stops`` and ``speed limits`` must be there, ``altitude``,
``gradients`` and ``curvatures`` may be missing (level, straight). A track reaches from its first
stop, at 0, to its last; what a file says beyond is ignored. Radii are positive to the right,
"infinity" is straight, and the curvature goes linearly from the radius at the start of a section
to the one at its end. Jumps of curvature between sections occur in real files and are kept.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from rail_world.alignment import Alignment, Element
from rail_world.description import LONGEST_TRACK_M, TIGHTEST_RADIUS_M, StartPose, check_increasing
from rail_world.errors import WorldDataError
from rail_world.track import Track, gradients_from_permil, limits_from_kmh

_LARGEST_FILE: Final = 10_000_000
_LENGTH_M: Final = {"m": 1.0, "km": 1e3}
_SPEED_KMH: Final = {"km/h": 1.0, "m/s": 3.6}
_SLOPE_PERMIL: Final = {"permil": 1.0, "\u2030": 1.0, "%": 10.0, "percent": 10.0}


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


Number = Annotated[float, BeforeValidator(_a_number), Field(allow_inf_nan=False)]
Radius = Annotated[float, BeforeValidator(_radius)]
LengthUnit = Literal["m", "km"]


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="ignore", populate_by_name=True)


class _Metadata(_Section):
    id: Annotated[str, Field(max_length=200)] | None = None
    version: Annotated[str, Field(pattern=r"^TTOBench v1\.\d+$")] | None = Field(
        default=None, alias="library version"
    )


class _Altitude(_Section):
    unit: LengthUnit
    value: Number

    @model_validator(mode="after")
    def _check(self) -> _Altitude:
        altitude_m = self.value * _LENGTH_M[self.unit]
        if not -1000.0 <= altitude_m <= 9000.0:
            raise ValueError(f"altitude {altitude_m:g} m is not on this Earth's railways")
        return self


class _Stops(_Section):
    unit: LengthUnit
    values: tuple[Number, ...] = Field(min_length=2, max_length=10_000)

    @model_validator(mode="after")
    def _check(self) -> _Stops:
        if self.values[0] != 0.0:
            raise ValueError(f"values: the first stop must be at 0, not {self.values[0]:g}")
        _check_positions(self.values, self.unit)
        return self

    @property
    def positions_m(self) -> tuple[float, ...]:
        return tuple(value * _LENGTH_M[self.unit] for value in self.values)


class _SpeedUnits(_Section):
    position: LengthUnit
    velocity: Literal["km/h", "m/s"]


class _SpeedLimits(_Section):
    units: _SpeedUnits
    values: tuple[tuple[Number, Number], ...] = Field(min_length=1, max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> _SpeedLimits:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        if self.values[0][0] != 0.0:
            raise ValueError(f"values: the first must be at 0, not {self.values[0][0]:g}")
        for index, (_, limit) in enumerate(self.values):
            if not 1.0 <= limit * _SPEED_KMH[self.units.velocity] <= 600.0:
                raise ValueError(
                    f"values.{index}: a limit of {limit:g} {self.units.velocity} is not within"
                    " 1 ... 600 km/h"
                )
        return self


class _SlopeUnits(_Section):
    position: LengthUnit
    slope: Literal["permil", "\u2030", "%", "percent"]


class _Gradients(_Section):
    units: _SlopeUnits
    values: tuple[tuple[Number, Number], ...] = Field(max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> _Gradients:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        for index, (_, slope) in enumerate(self.values):
            if abs(slope * _SLOPE_PERMIL[self.units.slope]) > 150.0:
                raise ValueError(
                    f"values.{index}: a slope of {slope:g} {self.units.slope} is beyond 150 permil"
                )
        return self


class _CurvatureUnits(_Section):
    position: LengthUnit
    start: LengthUnit = Field(alias="radius at start")
    end: LengthUnit = Field(alias="radius at end")


class _Curvatures(_Section):
    units: _CurvatureUnits
    values: tuple[tuple[Number, Radius, Radius], ...] = Field(max_length=100_000)

    @model_validator(mode="after")
    def _check(self) -> _Curvatures:
        _check_positions(tuple(row[0] for row in self.values), self.units.position)
        for index, (_, start, end) in enumerate(self.values):
            for radius, unit in ((start, self.units.start), (end, self.units.end)):
                if abs(radius * _LENGTH_M[unit]) < TIGHTEST_RADIUS_M:
                    raise ValueError(
                        f"values.{index}: a radius of {radius:g} {unit} is below"
                        f" {TIGHTEST_RADIUS_M:g} m"
                    )
        return self


class _File(_Section):
    metadata: _Metadata = _Metadata()
    altitude: _Altitude = _Altitude(unit="m", value=0.0)
    stops: _Stops
    speed_limits: _SpeedLimits = Field(alias="speed limits")
    gradients: _Gradients | None = None
    curvatures: _Curvatures | None = None


def _check_positions(positions: tuple[float, ...], unit: str) -> None:
    scaled = tuple(position * _LENGTH_M[unit] for position in positions)
    check_increasing("values", scaled)
    if scaled and scaled[0] < 0.0:
        raise ValueError(f"values: position {scaled[0]:g} m is negative")
    if scaled and scaled[-1] > LONGEST_TRACK_M:
        raise ValueError(f"values: position {scaled[-1]:g} m is beyond 1000 km")


def _elements(curvatures: _Curvatures | None, length_m: float) -> list[Element]:
    if curvatures is None or not curvatures.values:
        return [Element(length_m)]
    units = curvatures.units
    scale = _LENGTH_M[units.position]
    starts_m = [row[0] * scale for row in curvatures.values]
    # The last section reaches to the last stop, or is beyond it.
    ends_m = [*starts_m[1:], max(length_m, starts_m[-1])]
    elements = [Element(min(starts_m[0], length_m))] if starts_m[0] > 0.0 else []
    for start_m, end_m, row in zip(starts_m, ends_m, curvatures.values, strict=True):
        if start_m >= length_m:
            break
        k0 = -1.0 / (row[1] * _LENGTH_M[units.start])
        k1 = -1.0 / (row[2] * _LENGTH_M[units.end])
        if end_m > length_m:
            k1 = k0 + (k1 - k0) * (length_m - start_m) / (end_m - start_m)
            end_m = length_m
        elements.append(Element(end_m - start_m, k0, k1))
    return elements


def _no_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    result = dict(pairs)
    if len(result) != len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise WorldDataError(twice, twice, "the field comes twice")
    return result


def _no_constant(text: str) -> float:
    raise WorldDataError("(file)", text, "is not a number in JSON")


def _read_json(path: Path) -> object:
    file = str(path)
    try:
        size = path.stat().st_size
        text = path.read_text(encoding="utf-8") if size <= _LARGEST_FILE else ""
    except OSError as error:
        reason = error.strerror or "cannot be read"
        raise WorldDataError("(file)", path.name, reason, file=file) from None
    except UnicodeDecodeError:
        raise WorldDataError("(file)", path.name, "is not UTF-8 text", file=file) from None
    except ValueError:  # a null byte in the name
        raise WorldDataError("(file)", file, "is no file name") from None
    if size > _LARGEST_FILE:
        raise WorldDataError("(file)", size, "bytes are too large for a track", file=file)
    try:
        return json.loads(text, object_pairs_hook=_no_duplicates, parse_constant=_no_constant)
    except WorldDataError as error:
        raise WorldDataError(error.field, error.value, error.reason, file=file) from None
    except json.JSONDecodeError as error:
        reason = f"is not JSON (line {error.lineno}: {error.msg})"
        raise WorldDataError("(file)", path.name, reason, file=file) from None
    except (RecursionError, ValueError):
        raise WorldDataError("(file)", path.name, "is not JSON of any sense", file=file) from None


def load_ttobench(path: str | Path, *, name: str = "main", start: StartPose | None = None) -> Track:
    """Read a track from a TTOBench file.

    Parameters
    ----------
    path : str or Path
        The file.
    name : str
        Name of the track.
    start : StartPose, optional
        Pose of chainage 0; by default the origin, heading east.

    Returns
    -------
    Track
        From its first stop, chainage 0, to its last.

    Raises
    ------
    WorldDataError
        One line that names the file, the field and the value.
    """
    path = Path(path)
    data = _read_json(path)
    if not isinstance(data, dict):
        raise WorldDataError("(file)", data, "is not a TTOBench track", file=str(path))
    try:
        content = _File.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False)[0]
        field = ".".join(str(part) for part in first["loc"]) or "(file)"
        reason = first["msg"].removeprefix("Value error, ")
        value = "(missing)" if first["type"] == "missing" else first["input"]
        if reason.startswith("values") and ": " in reason:
            place, reason = reason.split(": ", 1)
            field = f"{field}.{place}"
            value = _dig(value, place)
        raise WorldDataError(field, value, reason, file=str(path)) from None
    return _track(content, name, start or StartPose())


def _dig(value: object, place: str) -> object:
    for key in place.split("."):
        if isinstance(value, dict):
            value = value.get(key)
        elif isinstance(value, list):
            value = value[int(key)]
    return value


def _track(content: _File, name: str, start: StartPose) -> Track:
    stops_m = content.stops.positions_m
    length_m = stops_m[-1]
    limits = content.speed_limits
    scale = _LENGTH_M[limits.units.position]
    to_kmh = _SPEED_KMH[limits.units.velocity]
    limit_pairs = tuple((p * scale, v * to_kmh) for p, v in limits.values if p * scale < length_m)
    gradient_pairs: tuple[tuple[float, float], ...] = ()
    if content.gradients is not None and content.gradients.values:
        units = content.gradients.units
        scale, to_permil = _LENGTH_M[units.position], _SLOPE_PERMIL[units.slope]
        gradient_pairs = tuple(
            (p * scale, g * to_permil) for p, g in content.gradients.values if p * scale < length_m
        )
        if not gradient_pairs or gradient_pairs[0][0] > 0.0:
            gradient_pairs = ((0.0, 0.0), *gradient_pairs)
    return Track(
        name=name,
        alignment=Alignment(
            _elements(content.curvatures, length_m),
            x_m=start.x_m,
            y_m=start.y_m,
            heading_rad=math.radians(start.heading_deg),
        ),
        gradients_permil=gradients_from_permil(gradient_pairs),
        limits_mps=limits_from_kmh(limit_pairs),
        stops_m=stops_m,
        start_altitude_m=content.altitude.value * _LENGTH_M[content.altitude.unit],
    )
