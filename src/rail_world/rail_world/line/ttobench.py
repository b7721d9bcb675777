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
from typing import Any, Final

from pydantic import ValidationError

from rail_world.errors import WorldDataError
from rail_world.line.description import StartPose

from .alignment import Alignment, Element
from .track import Track, gradients_from_permil, limits_from_kmh
from .ttobench_format import LENGTH_M, SLOPE_PERMIL, SPEED_KMH, Curvatures, TTOBenchFile

_LARGEST_FILE: Final = 10_000_000


def _elements(curvatures: Curvatures | None, length_m: float) -> list[Element]:
    if curvatures is None or not curvatures.values:
        return [Element(length_m)]
    units = curvatures.units
    scale = LENGTH_M[units.position]
    starts_m = [row[0] * scale for row in curvatures.values]
    # The last section reaches to the last stop, or is beyond it.
    ends_m = [*starts_m[1:], max(length_m, starts_m[-1])]
    elements = [Element(min(starts_m[0], length_m))] if starts_m[0] > 0.0 else []
    for start_m, end_m, row in zip(starts_m, ends_m, curvatures.values, strict=True):
        if start_m >= length_m:
            break
        k0 = -1.0 / (row[1] * LENGTH_M[units.start])
        k1 = -1.0 / (row[2] * LENGTH_M[units.end])
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
        text = path.read_text(encoding="utf-8-sig") if size <= _LARGEST_FILE else ""
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
        content = TTOBenchFile.model_validate(data)
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


def _track(content: TTOBenchFile, name: str, start: StartPose) -> Track:
    stops_m = content.stops.positions_m
    length_m = stops_m[-1]
    limits = content.speed_limits
    scale = LENGTH_M[limits.units.position]
    to_kmh = SPEED_KMH[limits.units.velocity]
    limit_pairs = tuple((p * scale, v * to_kmh) for p, v in limits.values if p * scale < length_m)
    gradient_pairs: tuple[tuple[float, float], ...] = ()
    if content.gradients is not None and content.gradients.values:
        units = content.gradients.units
        scale, to_permil = LENGTH_M[units.position], SLOPE_PERMIL[units.slope]
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
        start_altitude_m=content.altitude.value * LENGTH_M[content.altitude.unit],
    )
