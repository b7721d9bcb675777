from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_world.errors import WorldDataError
from rail_world.line.ttobench import load_ttobench

GOOD: dict[str, Any] = {
    "metadata": {"id": "XX_A_B", "library version": "TTOBench v1.2", "created by": "nobody"},
    "altitude": {"unit": "m", "value": 100.0},
    "stops": {"unit": "m", "values": [0.0, 400.0, 1000.0]},
    "speed limits": {
        "units": {"position": "m", "velocity": "km/h"},
        "values": [[0.0, 60], [500.0, 90]],
    },
    "gradients": {
        "units": {"position": "m", "slope": "permil"},
        "values": [[0.0, 5.0], [600.0, -10.0]],
    },
    "curvatures": {
        "units": {"position": "m", "radius at start": "m", "radius at end": "m"},
        "values": [
            [0.0, "infinity", "infinity"],
            [200.0, "infinity", 400.0],
            [300.0, 400.0, 400.0],
            [500.0, -700.0, "infinity"],
        ],
    },
}


def write(path: Path, content: object) -> Path:
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def test_fields_mean_what_they_say(tmp_path: Path) -> None:
    track = load_ttobench(write(tmp_path / "t.json", GOOD), name="main")
    assert track.length_m == 1000.0
    assert track.stops_m == (0.0, 400.0, 1000.0)
    np.testing.assert_allclose(track.limit_mps([499.0, 500.0]) * 3.6, [60.0, 90.0])
    np.testing.assert_allclose(track.altitude_m([0.0, 600.0, 1000.0]), [100.0, 103.0, 99.0])
    # Positive radii curve to the right, which is negative in the map.
    np.testing.assert_allclose(
        track.curvature_per_m([100.0, 250.0, 400.0, 500.0, 750.0]),
        [0.0, -1 / 800, -1 / 400, 1 / 700, 1 / 1400],
    )
    # 0.125 rad on the first clothoid, 0.5 on the arc, back on the last.
    heading = -0.125 - 0.5 + 500.0 / 1400.0
    assert float(track.pose(1000.0).heading_rad) == pytest.approx(heading)


def test_all_but_stops_and_limits_may_be_missing(tmp_path: Path) -> None:
    bare = {key: GOOD[key] for key in ("stops", "speed limits")}
    track = load_ttobench(write(tmp_path / "t.json", bare))
    pose = track.pose([0.0, 1000.0])
    np.testing.assert_allclose(pose.x_m, [0.0, 1000.0])
    np.testing.assert_allclose([pose.y_m, pose.z_m, pose.heading_rad], 0.0)


def test_units_are_honoured(tmp_path: Path) -> None:
    other: dict[str, Any] = {
        "altitude": {"unit": "km", "value": 0.1},
        "stops": {"unit": "km", "values": [0.0, 0.4, 1.0]},
        "speed limits": {
            "units": {"position": "km", "velocity": "m/s"},
            "values": [[0.0, 60 / 3.6], [0.5, 25.0]],
        },
        "gradients": {
            "units": {"position": "km", "slope": "%"},
            "values": [[0.0, 0.5], [0.6, -1.0]],
        },
        "curvatures": {
            "units": {"position": "km", "radius at start": "km", "radius at end": "km"},
            "values": [
                [p / 1e3, *(r if r == "infinity" else r / 1e3 for r in radii)]
                for p, *radii in GOOD["curvatures"]["values"]
            ],
        },
    }
    track = load_ttobench(write(tmp_path / "other.json", other))
    same = load_ttobench(write(tmp_path / "good.json", GOOD))
    s = np.linspace(0.0, 1000.0, 41)
    np.testing.assert_allclose(track.pose(s).x_m, same.pose(s).x_m)
    np.testing.assert_allclose(track.pose(s).y_m, same.pose(s).y_m, atol=1e-9)
    np.testing.assert_allclose(track.pose(s).z_m, same.pose(s).z_m)
    np.testing.assert_allclose(track.limit_mps(s), same.limit_mps(s))
    assert track.stops_m == same.stops_m


def test_what_lies_beyond_the_last_stop_is_ignored(tmp_path: Path) -> None:
    longer = copy.deepcopy(GOOD)
    longer["speed limits"]["values"].append([1200.0, 30])
    longer["gradients"]["values"].append([1000.0, 30.0])
    # The clothoid from 500 m now reaches to 1500 m and is cut in the middle.
    longer["curvatures"]["values"] += [[1500.0, "infinity", 300.0], [1600.0, 300.0, 300.0]]
    track = load_ttobench(write(tmp_path / "t.json", longer))
    assert track.length_m == 1000.0
    assert float(track.curvature_per_m(1000.0)) == pytest.approx(1 / 1400)
    assert track.limits_mps.values.size == 2


def test_straight_before_the_first_curvature_and_level_before_the_first_gradient(
    tmp_path: Path,
) -> None:
    late = copy.deepcopy(GOOD)
    late["curvatures"]["values"] = [[900.0, 300.0, 300.0]]
    late["gradients"]["values"] = [[900.0, 10.0]]
    track = load_ttobench(write(tmp_path / "t.json", late))
    assert float(track.pose(900.0).x_m) == 900.0
    assert float(track.altitude_m(1000.0)) == pytest.approx(101.0)


def test_real_lines_read_as_they_stand(real_line: Callable[[str], Path]) -> None:
    metro = load_ttobench(real_line("CN_Songjiazhuang_Yizhuang"))
    assert (metro.length_m, len(metro.stops_m)) == (22_728.0, 14)
    assert float(metro.limit_mps(22_700.0)) * 3.6 == pytest.approx(60.0)
    assert metro.gradient_permil([4300.0]) == [-24.0]
    railway = load_ttobench(real_line("CH_StGallen_Wil"))
    assert (railway.length_m, len(railway.stops_m)) == (29_556.1, 2)
    assert len(railway.alignment.elements) == 238
    s = np.linspace(0.0, railway.length_m, 60_000)
    pose = railway.pose(s)
    np.testing.assert_allclose(
        np.hypot(np.diff(pose.x_m), np.diff(pose.y_m)), np.diff(s), rtol=1e-6
    )
    assert np.max(np.abs(railway.curvature_per_m(s))) == pytest.approx(1 / 340.1)
    # Between the two stations the line leads west: the crow's distance is close to the track's.
    crow_m = math.hypot(float(pose.x_m[-1]), float(pose.y_m[-1]))
    assert 0.85 < crow_m / railway.length_m < 0.95


def changed(path: tuple[str | int, ...], value: object) -> dict[str, Any]:
    content = copy.deepcopy(GOOD)
    inner: Any = content
    for key in path[:-1]:
        inner = inner[key]
    if value is ...:
        del inner[path[-1]]
    else:
        inner[path[-1]] = value
    return content


BROKEN: list[tuple[tuple[str | int, ...], object]] = [
    (("metadata",), 5),
    (("metadata", "library version"), "TTOBench v2.0"),
    (("metadata", "library version"), 1.2),
    (("metadata", "id"), ["a"]),
    (("altitude",), 100.0),
    (("altitude", "unit"), "ft"),
    (("altitude", "value"), "high"),
    (("altitude", "value"), 1e6),
    (("altitude", "value"), None),
    (("stops",), ...),
    (("stops",), [0.0, 1000.0]),
    (("stops", "unit"), "mile"),
    (("stops", "unit"), ...),
    (("stops", "values"), ...),
    (("stops", "values"), []),
    (("stops", "values"), [0.0]),
    (("stops", "values"), [5.0, 1000.0]),
    (("stops", "values"), [0.0, 500.0, 500.0]),
    (("stops", "values"), [0.0, -500.0]),
    (("stops", "values"), [0.0, 2e6]),
    (("stops", "values"), [0.0, 10**400]),
    (("stops", "values"), "0, 1000"),
    (("stops", "values", 1), "400"),
    (("stops", "values", 1), True),
    (("stops", "values", 1), None),
    (("speed limits",), ...),
    (("speed limits", "units"), ...),
    (("speed limits", "units", "position"), "s"),
    (("speed limits", "units", "velocity"), "mph"),
    (("speed limits", "values"), []),
    (("speed limits", "values", 0), [10.0, 60]),
    (("speed limits", "values", 1), [0.0, 60]),
    (("speed limits", "values", 1), [500.0]),
    (("speed limits", "values", 1), [500.0, 60, 70]),
    (("speed limits", "values", 1), [500.0, -60]),
    (("speed limits", "values", 1), [500.0, 0]),
    (("speed limits", "values", 1), [500.0, 9000]),
    (("speed limits", "values", 1), [500.0, "fast"]),
    (("speed limits", "values", 1), 60),
    (("gradients",), "level"),
    (("gradients", "units", "slope"), "degrees"),
    (("gradients", "units", "position"), ...),
    (("gradients", "values", 1), [600.0, 900.0]),
    (("gradients", "values", 1), [600.0, None]),
    (("gradients", "values", 1), [-600.0, 5.0]),
    (("gradients", "values", 0), [-5.0, 5.0]),
    (("curvatures", "units", "radius at start"), "deg"),
    (("curvatures", "units", "radius at end"), ...),
    (("curvatures", "values"), {"0": 1}),
    (("curvatures", "values", 1), [200.0, "straight", 400.0]),
    (("curvatures", "values", 1), [200.0, 400.0]),
    (("curvatures", "values", 1), [200.0, 0, 400.0]),
    (("curvatures", "values", 1), [200.0, 400.0, 3.0]),
    (("curvatures", "values", 1), [200.0, 400.0, None]),
    (("curvatures", "values", 1), [200.0, 10**400, 400.0]),
    (("curvatures", "values", 2), [100.0, 400.0, 400.0]),
]


@pytest.mark.parametrize(("path", "value"), BROKEN, ids=str)
def test_each_broken_field_is_named_in_one_line(
    tmp_path: Path, path: tuple[str | int, ...], value: object
) -> None:
    file = write(tmp_path / "broken.json", changed(path, value))
    with pytest.raises(WorldDataError) as caught:
        load_ttobench(file)
    text = str(caught.value)
    assert text.splitlines() == [text]
    assert text.startswith(f"{file}: {path[0]}")
    assert caught.value.field.split(".")[0] == path[0]
    # As deep as the mistake itself, or as deep as the list it is in.
    named = caught.value.field.split(".")
    assert [str(part) for part in path[: len(named)]] == named[: len(path)]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"", "not JSON"),
        (b"{", "not JSON"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"[1, 2]", "not a TTOBench track"),
        (b"null", "not a TTOBench track"),
        (b'{"stops": NaN}', "not a number"),
        (b'{"stops": -Infinity}', "not a number"),
        (b'{"stops": {}, "stops": {}}', "twice"),
        (b"[" * 200_000, "JSON"),
        (b'{"stops": ' + b"1" * 5000 + b"}", "stops|JSON"),
    ],
)
def test_files_that_are_no_tracks(tmp_path: Path, text: bytes, reason: str) -> None:
    file = tmp_path / "t.json"
    file.write_bytes(text)
    with pytest.raises(WorldDataError, match=reason) as caught:
        load_ttobench(file)
    assert len(str(caught.value).splitlines()) == 1


def test_files_that_are_not_there(tmp_path: Path) -> None:
    with pytest.raises(WorldDataError, match=r"absent\.json"):
        load_ttobench(tmp_path / "absent.json")
    with pytest.raises(WorldDataError, match="directory"):
        load_ttobench(tmp_path)
    with pytest.raises(WorldDataError, match="no file name"):
        load_ttobench("a\0b")


def test_file_too_large(tmp_path: Path) -> None:
    file = tmp_path / "large.json"
    file.write_bytes(b" " * 10_000_001)
    with pytest.raises(WorldDataError, match="too large"):
        load_ttobench(file)


def test_a_file_with_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    plain = write(tmp_path / "plain.json", GOOD)
    marked = tmp_path / "marked.json"
    marked.write_bytes(b"\xef\xbb\xbf" + plain.read_bytes())
    assert load_ttobench(marked).stops_m == load_ttobench(plain).stops_m
