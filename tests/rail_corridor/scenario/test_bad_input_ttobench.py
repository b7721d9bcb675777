"""Track files that are broken: the line names the track file and the field in it."""

from __future__ import annotations

import copy
import json
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import load_scenario
from rail_corridor.loading.overrides import Overrides

GOOD: dict[str, Any] = {
    "metadata": {"id": "test", "library version": "TTOBench v1.2"},
    "altitude": {"unit": "m", "value": 31.5},
    "stops": {"unit": "m", "values": [0.0, 1000.0, 2400.0]},
    "speed limits": {
        "units": {"position": "m", "velocity": "km/h"},
        "values": [[0.0, 50.0], [300.0, 80.0]],
    },
    "gradients": {"units": {"position": "m", "slope": "permil"}, "values": [[0.0, 3.0]]},
    "curvatures": {
        "units": {"position": "m", "radius at start": "m", "radius at end": "m"},
        "values": [[0.0, "infinity", "infinity"], [500.0, 600.0, 600.0]],
    },
}
WRONG: list[tuple[str, object, str]] = [
    ("metadata.library version", "OtherBench v7", "metadata.library version"),
    ("altitude.unit", "ft", "altitude.unit"),
    ("altitude.value", "high", "altitude.value"),
    ("stops", None, "stops"),
    ("stops.unit", "miles", "stops.unit"),
    ("stops.values", [0.0], "stops.values"),
    ("stops.values", [0.0, 900.0, 100.0], "stops"),
    ("stops.values", [5.0, 900.0], "stops"),
    ("stops.values", "none", "stops.values"),
    ("speed limits", {}, "speed limits.units"),
    ("speed limits.units.velocity", "mph", "speed limits.units.velocity"),
    ("speed limits.values", [[0.0, -3.0]], "speed limits"),
    ("speed limits.values", [[0.0]], "speed limits.values.0"),
    ("gradients.units.slope", "degrees", "gradients.units.slope"),
    ("gradients.values", [[0.0, 9e9]], "gradients"),
    ("curvatures.values", [[0.0, 0.0, 500.0]], "curvatures.values.0"),
    ("curvatures.values", [[0.0, "straight", 500.0]], "curvatures.values.0"),
    ("curvatures.units", [], "curvatures.units"),
]


def load(folder: Path, text: str) -> str:
    """Return the complaint about a track file, or nothing."""
    file = folder / "line.json"
    file.write_text(text, encoding="utf-8")
    try:
        load_scenario("real_line", overrides=Overrides(track=file))
    except InputError as error:
        assert str(error).isprintable()
        return str(error)
    return ""


def test_the_good_file_is_good(tmp_path: Path) -> None:
    assert load(tmp_path, json.dumps(GOOD)) == ""


@pytest.mark.parametrize(
    ("path", "value", "field"), WRONG, ids=[f"{n}-{w[0]}" for n, w in enumerate(WRONG)]
)
def test_a_broken_field_is_named_with_the_track_file(
    tmp_path: Path, path: str, value: object, field: str
) -> None:
    data = copy.deepcopy(GOOD)
    place: Any = data
    *parents, last = path.split(".")
    for part in parents:
        place = place[part]
    place[last] = value
    message = load(tmp_path, json.dumps(data))
    assert message.startswith(f"{tmp_path / 'line.json'}: {field}"), message


@pytest.mark.parametrize("text", ["", "{", "[]", "null", "NaN", '{"a": 1, "a": 2}', "[" * 100_000])
def test_a_file_that_is_no_track(tmp_path: Path, text: str) -> None:
    assert load(tmp_path, text).startswith(f"{tmp_path / 'line.json'}: ")


def test_a_track_file_that_is_not_there(tmp_path: Path) -> None:
    file = tmp_path / "nowhere.json"
    with pytest.raises(InputError, match=r"nowhere\.json: "):
        load_scenario("real_line", overrides=Overrides(track=file))
    with pytest.raises(InputError) as caught:
        load_scenario("real_line", overrides=Overrides(track=tmp_path))
    assert str(caught.value).startswith(f"{tmp_path}: ")
