"""Wrong scenarios: one line that names the file, the field and the value, and nothing else."""

from __future__ import annotations

import copy
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario
from rail_corridor.loading.overrides import Overrides

GOOD: dict[str, Any] = {
    "name": "good",
    "seed": 3,
    "duration_s": 10.0,
    "tracks": {
        "main": {
            "elements": [{"straight_m": 800}, {"arc_m": 200, "radius_m": 500}],
            "gradients": [[0, 0], [300, 5]],
            "speed_limits": [[0, 80]],
            "stops_m": [700],
        },
        "branch": {"elements": [{"arc_m": 150, "radius_m": 300}, {"straight_m": 250}]},
    },
    "junctions": [{"track": "main", "at_m": 400, "branch": "branch"}],
    "stations": {"zone_length_m": 200.0},
    "trains": [
        {"name": "t1", "route": ["main"], "start_m": 500},
        {"name": "t2", "route": ["main", "branch"], "start_m": 150},
    ],
    "faults": [
        {"kind": "dead_station", "station": "wrs2", "from_s": 1, "to_s": 2},
        {"kind": "jam", "channel": 2, "from_s": 1, "to_s": 2, "track": "main", "at_m": 100},
    ],
}
THREAT = {"kind": "threat", "threats": ["delay"], "rate": 0.1}
REMOVED = object()


def changed(path: str, value: object) -> dict[str, Any]:
    """Return the good scenario with the value at a dotted path replaced, added or removed."""
    data = copy.deepcopy(GOOD)
    place: Any = data
    *parents, last = path.split(".")
    for part in parents:
        place = place[int(part)] if isinstance(place, list) else place.setdefault(part, {})
    key: Any = int(last) if isinstance(place, list) else last
    if value is REMOVED:
        del place[key]
    else:
        place[key] = value
    return data


def complaint(load: Callable[[], object]) -> str:
    """Return the one line that loading complains with."""
    with pytest.raises(InputError) as caught:
        load()
    message = str(caught.value)
    assert message.isprintable(), message
    assert len(message) < 700
    return message


def write(folder: Path, data: object) -> Path:
    """Write a scenario file."""
    path = folder / "bad.yaml"
    path.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    return path


def test_the_good_scenario_is_good(tmp_path: Path) -> None:
    assert len(layout_of(load_scenario(write(tmp_path, GOOD))).zones) == 8


# path that is changed, value put there, field the complaint names, part of the reason
WRONG: list[tuple[str, object, str, str]] = [
    ("name", "Not A Name", "name", "pattern"),
    ("name", REMOVED, "name", "a value is needed"),
    ("seed", -1, "seed", "greater than or equal to 0"),
    ("seed", True, "seed", "truth value"),
    ("seed", 1.5, "seed", "integer"),
    ("seed", 2**64, "seed", "less than or equal"),
    ("duration_s", 0, "duration_s", "greater than 0"),
    ("duration_s", float("nan"), "duration_s", "finite"),
    ("duration_s", float("inf"), "duration_s", "finite"),
    ("duration_s", 1e300, "duration_s", "less than or equal"),
    ("duration_s", "soon", "duration_s", "number"),
    ("duration_s", [10], "duration_s", "number"),
    ("tick_s", 0, "tick_s", "greater than or equal"),
    ("tick_s", -0.1, "tick_s", "greater than or equal"),
    ("speed", 3, "speed", "no such field"),
    ("duration", 3, "duration", "did you mean duration_s"),
    ("tracks", {}, "tracks", "at least one track"),
    ("tracks", [], "tracks", "dictionary"),
    ("tracks", "main", "tracks", "dictionary"),
    ("tracks.Main Line", {"elements": [{"straight_m": 5}]}, "tracks.Main Line", "pattern"),
    ("tracks.main", {}, "tracks.main", "either elements or ttobench"),
    ("tracks.main.elements", [], "tracks.main.elements", "at least 1 item"),
    ("tracks.main.elements.0", {"straight_m": -800}, "tracks.main.elements.0.straight_m", ""),
    ("tracks.main.elements.0", {"straight": 800}, "tracks.main.elements.0", "straight_m"),
    ("tracks.main.elements.0.straight_m", 1e300, "tracks.main.elements.0.straight_m", ""),
    ("tracks.main.elements.1.radius_m", 0, "tracks.main.elements.1.radius_m", "at least 20 m"),
    ("tracks.main.elements.1.radius_m", 1, "tracks.main.elements.1.radius_m", "at least 20 m"),
    ("tracks.main.elements.1.radius_m", None, "tracks.main.elements.1.radius_m", "number"),
    ("tracks.main.gradients", [[0, 900]], "tracks.main.gradients.0.1", "150"),
    ("tracks.main.gradients", [[0, 1], [0, 2]], "tracks.main.gradients", "must increase"),
    ("tracks.main.gradients", [[0, 1, 2]], "tracks.main.gradients.0", ""),
    ("tracks.main.speed_limits", [[0, 0]], "tracks.main.speed_limits.0.1", ""),
    ("tracks.main.speed_limits", [[5, 80]], "tracks.main.speed_limits", "chainage 0"),
    ("tracks.main.stops_m", [5000], "tracks.main.stops_m", "off the track"),
    ("tracks.main.ttobench", "x.json", "tracks.main", "either"),
    ("junctions.0.track", "nowhere", "junctions.0.track", "no such track"),
    ("junctions.0.branch", "nowhere", "junctions.0.branch", "no such track"),
    ("junctions.0.branch", "main", "junctions.0.branch", "itself"),
    ("junctions.0.at_m", 4000, "junctions.0.at_m", "off the track"),
    ("junctions.0.at_m", 990, "junctions.0.branch", "does not get 4.5 m away"),
    ("junctions.0.at_m", 905, "junctions.0.at_m", "less than 20 m"),
    (
        "junctions",
        [
            {"track": "main", "at_m": 400, "branch": "branch"},
            {"track": "main", "at_m": 440, "branch": "third"},
        ],
        "junctions.1.branch",
        "no such track",
    ),
    ("stations", REMOVED, "stations", "a value is needed"),
    ("stations", {}, "stations.zone_length_m", "either"),
    ("stations.zone_length_m", 19, "stations.zone_length_m", "greater than or equal"),
    ("stations.zone_length_m", 900, "stations.zone_length_m", "unambiguous up to 399.72 m"),
    (
        "stations",
        {"zone_length_m": 470},
        "stations.zone_length_m",
        "zone1 on main reaches",
    ),
    ("stations.zone_lenght_m", 200, "stations.zone_lenght_m", "did you mean zone_length_m"),
    ("stations.mast_height_m", "high", "stations.mast_height_m", "number"),
    ("channels", {"main": [[1, 2]]}, "channels.main", "zone1 and zone2"),
    ("channels", {"branch": [[5, 6]]}, "channels.branch", "channel 5"),
    ("channels", {"main": [[1, 2], [2, 3]]}, "channels.main.1", "channel 2 is used twice"),
    ("channels", {"main": [[1, 1], [2, 3]]}, "channels.main.0", "channel 1 is used twice"),
    ("channels", {"main": [[1, 2, 3]]}, "channels.main.0", ""),
    ("channels", {"main": [[1], [3, 4]]}, "channels.main.0.1", "needed"),
    ("channels", {"main": []}, "channels.main", "at least 1"),
    ("channels", {"main": [[0, 2]]}, "channels.main.0.0", "greater than or equal to 1"),
    ("channels", {"spacing_hz": 1e5}, "channels.spacing_hz", "Carson"),
    ("channels", {"first_carrier_hz": 6e10}, "radio.oscillator_ppm", "off by up to"),
    ("ranging", {"samples": 1000}, "ranging.samples", "multiple of 32"),
    ("ranging", {"tone_hz": -1}, "ranging.tone_hz", "greater than or equal"),
    ("ranging", {"tone_hz": 1.9e6}, "ranging", ""),
    ("ranging", {"comparator": "two_tone"}, "ranging.low_tone_hz", "needs it"),
    ("ranging", {"low_tone_hz": 37500}, "ranging.low_tone_hz", "goes with comparator"),
    ("ranging", {"comparator": "xor"}, "ranging.comparator", "'quadrature'"),
    (
        "ranging",
        {"sample_rate_hz": 4e3, "tone_hz": 375, "deviation_hz": 375},
        "ranging.samples",
        "longer than a tick",
    ),
    ("radio", {"path_loss_exponent": 0.5}, "radio.path_loss_exponent", "1.5"),
    ("radio", {"wrs_power_dbm": 1e3}, "radio.wrs_power_dbm", "60"),
    ("radio", {"oscillator_ppm": 1.0}, "radio.oscillator_ppm", "off by up to"),
    ("transponder", {"delay_s": -1e-6}, "transponder.delay_s", "greater than or equal"),
    (
        "transponder",
        {"calibration_bursts": 0},
        "transponder.calibration_bursts",
        "greater than or equal",
    ),
    ("trains", [], "trains", "at least one train"),
    ("trains.0.name", "t2", "trains.1.name", "another train"),
    ("trains.0.name", "1st", "trains.0.name", "pattern"),
    ("trains.0.route", [], "trains.0.route", "at least 1"),
    ("trains.0.route", ["nowhere"], "trains.0.route.0", "no such track"),
    ("trains.0.route", ["branch", "main"], "trains.0.route", "no junction"),
    ("trains.0.start_m", 1200, "trains.0.start_m", "off the route"),
    ("trains.0.start_m", -5, "trains.0.start_m", "greater than or equal"),
    ("trains.0.start_m", 151, "trains.1.start_m", "t1 is in the same place"),
    ("trains.0.start_m", 20, "trains.1.start_m", "cannot be told apart"),
    ("trains.0.speed_kmh", 200, "trains.0.speed_kmh", "permitted"),
    ("trains.0.direction", 0, "trains.0.direction", "1 or -1"),
    ("trains.0.vehicle", {"mass_kg": 0}, "trains.0.vehicle.mass_kg", "greater than or equal"),
    ("trains.0.vehicle", {"preset": "tram"}, "trains.0.vehicle.preset", "'metro'"),
    ("trains.0.stop_at_m", [3000], "trains.0.stop_at_m", "off the route"),
    ("timetable", {"count": 0, "headway_s": 60, "train": {"route": ["main"]}}, "timetable", ""),
    ("timetable", {"count": 2, "headway_s": 5, "train": {"route": ["main"]}}, "timetable", "30"),
    (
        "timetable",
        {"count": 2, "headway_s": 60, "train": {"route": ["main"], "start_m": 9999}},
        "timetable.train.start_m",
        "off the route",
    ),
    ("faults.0.kind", "meteor", "faults.0", "'dead_station', 'jam'"),
    ("faults.0.station", "wrs99", "faults.0.station", "wrs1 ... wrs7"),
    ("faults.0.to_s", 0.5, "faults.0.to_s", "after from_s"),
    ("faults.1.channel", 42, "faults.1.channel", "no zone uses"),
    ("faults.1.track", "nowhere", "faults.1.track", "no such track"),
    ("faults.1.at_m", 1500, "faults.1.at_m", "off main"),
    ("faults.1.power_dbm", float("-inf"), "faults.1.power_dbm", "finite"),
    ("faults.0", {**THREAT}, "faults.0.kind: 'threat'", "goes with cbtc, of which there is none"),
    ("faults.0", {**THREAT, "threats": ["dely"]}, "faults.0.threats.0: 'dely'", "'delay'"),
    ("faults.0", {**THREAT, "threats": []}, "faults.0.threats", "at least 1"),
    ("faults.0", {**THREAT, "threats": "delay"}, "faults.0.threats: 'delay'", "tuple"),
    ("faults.0", {**THREAT, "threats": ["delay", "delay"]}, "faults.0.threats", "comes twice"),
    ("faults.0", {**THREAT, "rate": 1.01}, "faults.0.rate: 1.01", "less than or equal to 1"),
    ("faults.0", {**THREAT, "rate": -0.1}, "faults.0.rate: -0.1", "greater than or equal to 0"),
    ("faults.0", {**THREAT, "rate": True}, "faults.0.rate: True", "truth value"),
    ("faults.0", {"kind": "threat", "threats": ["delay"]}, "faults.0.rate", "needed"),
    ("faults.0", {**THREAT, "longest_delay_s": 1e4}, "faults.0.longest_delay_s", "3600"),
    ("faults.0", {**THREAT, "from_s": 5, "to_s": 5}, "faults.0.to_s: 5", "after from_s, 5 s"),
    ("description", "x" * 100_000, "description", "at most 1000 characters"),
    ("description", "line\nbreak" * 200, "description", "at most 1000 characters"),
    ("seed", 10**1000, "seed", ""),
    ("tracks.main.elements.0.straight_m", 10**400, "tracks.main.elements.0.straight_m", ""),
]


@pytest.mark.parametrize(
    ("path", "value", "field", "reason"), WRONG, ids=[f"{n}-{w[0]}" for n, w in enumerate(WRONG)]
)
def test_one_line_names_file_field_and_reason(
    tmp_path: Path, path: str, value: object, field: str, reason: str
) -> None:
    file = write(tmp_path, changed(path, value))
    message = complaint(lambda: load_scenario(file))
    assert message.startswith(f"{file}: {field}"), message
    assert reason in message


POSITIONS: list[tuple[object, str, str]] = [
    ([], "stations.positions", "at least 1"),
    ([{"name": "a"}], "stations.positions.0.track", "track and at_m, or junction"),
    ([{"name": "a", "track": "main"}], "stations.positions.0.at_m", "track and at_m"),
    ([{"name": "a", "track": "x", "at_m": 0}], "stations.positions.0.track", "no such track"),
    ([{"name": "a", "track": "main", "at_m": 990}], "stations.positions.0.at_m", "is off main"),
    ([{"name": "a", "junction": "main"}], "stations.positions.0.junction", "no junction starts"),
    ([{"name": "a", "track": "main", "at_m": 0}], "stations.positions", "junction: branch"),
    ([{"name": "a", "junction": "branch"}], "stations.positions", "at_m: 0 of main"),
    (
        [{"name": "a", "track": "main", "at_m": 0}, {"name": "a", "junction": "branch"}],
        "stations.positions.1.name",
        "another station",
    ),
    (
        [
            {"name": "a", "track": "main", "at_m": 0, "zone": "z"},
            {"name": "b", "junction": "branch", "zone": "z"},
        ],
        "stations.positions",
        "two zones have this name",
    ),
    (
        [
            {"name": "a", "track": "main", "at_m": 0},
            {"name": "c", "track": "main", "at_m": 10},
            {"name": "b", "junction": "branch"},
        ],
        "stations.positions",
        "shorter than 20 m",
    ),
]


@pytest.mark.parametrize(("positions", "field", "reason"), POSITIONS)
def test_stations_placed_wrongly_by_hand(
    tmp_path: Path, positions: object, field: str, reason: str
) -> None:
    file = write(tmp_path, changed("stations", {"positions": positions}))
    message = complaint(lambda: load_scenario(file))
    assert message.startswith(f"{file}: {field}"), message
    assert reason in message


def test_zones_may_be_half_as_long_with_the_and_comparator(tmp_path: Path) -> None:
    data = changed("stations.zone_length_m", 230)
    load_scenario(write(tmp_path, data))
    data["ranging"] = {"comparator": "and"}
    message = complaint(lambda: load_scenario(write(tmp_path, data)))
    assert "stations.zone_length_m: 230.0: zone1 on main reaches 225.96 m" in message
    assert message.endswith("comparator and is unambiguous up to 199.86 m")


@pytest.mark.parametrize("digits", [401, 4001, 50_000])
def test_numbers_of_any_length_are_named_by_their_field(tmp_path: Path, digits: int) -> None:
    text = yaml.safe_dump(GOOD).replace("duration_s: 10.0", "duration_s: " + "9" * digits)
    file = tmp_path / "bad.yaml"
    file.write_text(text)
    assert complaint(lambda: load_scenario(file)).startswith(f"{file}: duration_s: ")


def test_junctions_too_close(tmp_path: Path) -> None:
    data = changed("tracks.third", {"elements": [{"arc_m": 300, "radius_m": -300}]})
    data["junctions"].append({"track": "main", "at_m": 440, "branch": "third"})
    message = complaint(lambda: load_scenario(write(tmp_path, data)))
    assert "junctions.1.at_m: 440.0: is less than 100 m from the junction at 400 m" in message


FILES: list[tuple[bytes, str]] = [
    (b"", "is empty"),
    (b"# only a comment\n", "is empty"),
    (b"just text", "must be a mapping"),
    (b"- 1\n- 2\n", "must be a mapping"),
    (b"name: [unclosed\n", "is not YAML"),
    (b"name: a\nname: b\n", "name: 'name': the field comes twice, line 2"),
    (b"a: {b: 1, b: 2}\n", "the field comes twice"),
    (b"a: &x [1]\nb: *x\n", "anchors and aliases are not allowed, line 1"),
    (b"a: !!python/object/apply:os.system [true]\n", "tags are not allowed"),
    (b"a: 1\n---\nb: 2\n", "more than one document"),
    (b"a: \x00\n", "null byte"),
    (b"a: \xff\xfe\n", "is not UTF-8 text (byte 3)"),
    (b"a: \x01\n", "is not YAML"),
    (b"\ta: 1\n", "is not YAML"),
    (b"? [1, 2]\n: 3\n", "a field name must be text"),
    (b"1: 2\n", "a field name must be text"),
    (b"[" * 100_000, "nested deeper than 30 levels"),
    (b"a: " + b"[" * 40 + b"]" * 40, "nested deeper than 30 levels"),
    (b"%YAML 9.9\n---\na: 1\n", "is not YAML"),
    (b"{" * 31, "is not YAML"),
]


@pytest.mark.parametrize(("content", "reason"), FILES)
def test_files_that_are_no_scenario(tmp_path: Path, content: bytes, reason: str) -> None:
    file = tmp_path / "bad.yaml"
    file.write_bytes(content)
    message = complaint(lambda: load_scenario(file))
    assert message.startswith(f"{file}: ")
    assert reason in message


def test_a_missing_file_and_an_unknown_name(tmp_path: Path) -> None:
    assert complaint(lambda: load_scenario(tmp_path / "none.yaml")).endswith(
        "none.yaml: there is no such file"
    )
    message = complaint(lambda: load_scenario("dmeo"))
    assert message == (
        "dmeo: there is no such file, and no built-in scenario of that name"
        f" ({', '.join(sorted(builtin_scenarios()))})"
    )


def test_a_directory_a_pipe_and_names_that_are_none(tmp_path: Path) -> None:
    assert "is a directory" in complaint(lambda: load_scenario(tmp_path))
    pipe = tmp_path / "pipe.yaml"
    os.mkfifo(pipe)
    assert "is not a regular file" in complaint(lambda: load_scenario(pipe))
    complaint(lambda: load_scenario("nul\0byte.yaml"))
    complaint(lambda: load_scenario("long" * 5000 + ".yaml"))
    complaint(lambda: load_scenario("two\nlines"))
    complaint(lambda: load_scenario(""))


def test_a_file_that_is_too_large(tmp_path: Path) -> None:
    file = tmp_path / "large.yaml"
    with file.open("wb") as handle:
        handle.truncate(10_000_001)
    assert complaint(lambda: load_scenario(file)).endswith("is larger than 10 MB")


@pytest.mark.parametrize(
    ("overrides", "start"),
    [
        (Overrides(seed=-1), "command line: --seed: -1: must be greater than or equal to 0"),
        (Overrides(duration_s=0.0), "command line: --duration: 0.0: "),
        (Overrides(duration_s=float("nan")), "command line: --duration: nan: "),
        (Overrides(sections={"--zone-length": 5.0}), "command line: --zone-length: 5.0: "),
        (Overrides(sections={"--zone-length": 600.0}), "command line: --zone-length: 600.0: zone"),
        (Overrides(trains=0), "command line: --trains: 0: the scenario lists 3 trains"),
        (Overrides(trains=9), "command line: --trains: 9: the scenario lists 3 trains"),
    ],
)
def test_wrong_options_are_told_from_wrong_files(overrides: Overrides, start: str) -> None:
    assert complaint(lambda: load_scenario("demo", overrides=overrides)).startswith(start)


def test_a_wrong_number_of_trains_of_a_timetable(tmp_path: Path) -> None:
    message = complaint(lambda: load_scenario("real_line", overrides=Overrides(trains=1000)))
    assert message.startswith("command line: --trains: 1000: ")
