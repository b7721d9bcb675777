"""A scenario as files and back: the same to the last bit, complete in itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario, scenario_from_data
from rail_corridor.loading.overrides import Overrides
from rail_corridor.loading.scenario_files import files_of, scenario_from
from rail_corridor.recording.frames import Attachment
from rail_corridor.scenario.model import Scenario

LINE = {
    "metadata": {"id": "test", "library version": "TTOBench v1.2"},
    "stops": {"unit": "m", "values": [0.0, 1500.0]},
    "speed limits": {
        "units": {"position": "m", "velocity": "km/h"},
        "values": [[0.0, 80.0]],
    },
}


@pytest.fixture
def track_file(tmp_path: Path) -> Path:
    """Return a line in TTOBench format."""
    path = tmp_path / "line.json"
    path.write_text(json.dumps(LINE))
    return path


def there_and_back(scenario: Scenario, directory: Path) -> Scenario:
    directory.mkdir()
    return scenario_from(files_of(scenario), directory)


@pytest.mark.parametrize(
    "name", sorted(set(builtin_scenarios()) - {"real_line", "real_line_sensors"})
)
def test_every_built_in_scenario_comes_back_as_it_was(name: str, tmp_path: Path) -> None:
    scenario = load_scenario(name)
    back = there_and_back(scenario, tmp_path / "back")
    assert back == scenario
    assert back.model_dump() == scenario.model_dump()


def test_what_the_command_line_changed_is_in_it(tmp_path: Path) -> None:
    overrides = Overrides(
        seed=2**62 + 1, duration_s=0.1 + 0.2, sections={"--zone-length": 123.4567890123456}
    )
    scenario = load_scenario("plain_line", overrides=overrides)
    back = there_and_back(scenario, tmp_path / "back")
    assert (back.seed, back.duration_s) == (2**62 + 1, 0.1 + 0.2)
    assert back.stations.zone_length_m == 123.4567890123456
    assert back == scenario


@pytest.mark.parametrize(
    "text", ["on", "1:30", "2.4e9", "0o17", "null", "~", "a: b", "# no", "'", '"', " x ", "ä\n\tb"]
)
def test_text_stays_text(text: str, tmp_path: Path) -> None:
    scenario = load_scenario("plain_line").model_copy(update={"description": text})
    assert there_and_back(scenario, tmp_path / "back").description == text


def test_the_file_of_a_track_goes_with_it(tmp_path: Path, track_file: Path) -> None:
    overrides = Overrides(track=track_file)
    scenario = load_scenario("real_line", overrides=overrides)
    files = files_of(scenario)
    assert [each.name for each in files] == ["scenario.yaml", "tracks/main.json"]
    lengths_m = [track.length_m for track in scenario.network.tracks.values()]
    track_file.unlink()  # elsewhere it is not there either
    (tmp_path / "back").mkdir()
    back = scenario_from(files, tmp_path / "back")
    assert [track.length_m for track in back.network.tracks.values()] == lengths_m


def test_the_text_is_a_scenario_that_can_be_run(tmp_path: Path) -> None:
    (file,) = files_of(load_scenario("branch"))
    path = tmp_path / "again.yaml"
    path.write_bytes(file.data)
    assert load_scenario(path) == load_scenario("branch")


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (None, "holds no scenario.yaml"),
        (b"\xff", "not UTF-8"),
        (b"- 1", "mapping"),
        (b"name: [", "in its scenario.yaml: is not YAML"),
        (b"name: x\nseed: -1\n", "in its scenario.yaml"),
        (b"name: x\ntracks: {../up: {ttobench: /etc/passwd}}", "in its scenario.yaml"),
    ],
)
def test_what_is_no_scenario_is_one_line(data: bytes | None, told: str, tmp_path: Path) -> None:
    files = [Attachment("other.txt", "text/plain", b"")]
    files += [] if data is None else [Attachment("scenario.yaml", "application/yaml", data)]
    with pytest.raises(InputError, match=told) as caught:
        scenario_from(files, tmp_path)
    assert "\n" not in str(caught.value)


def test_a_track_file_that_has_gone_is_one_line(tmp_path: Path, track_file: Path) -> None:
    scenario = load_scenario("real_line", overrides=Overrides(track=track_file))
    track_file.unlink()
    with pytest.raises(InputError, match=r"line\.json: there is no such file"):
        files_of(scenario)


def test_no_file_is_put_outside_the_folder(tmp_path: Path) -> None:
    data: dict[str, Any] = json.loads(load_scenario("plain_line").to_json())
    assert scenario_from_data(data, directory=tmp_path)
    data["tracks"] = {"../../outside": data["tracks"]["main"]}
    files = [
        Attachment("scenario.yaml", "", json.dumps(data).encode()),
        Attachment("tracks/../../outside.json", "", b"gotcha"),
    ]
    (tmp_path / "a" / "b").mkdir(parents=True)
    with pytest.raises(InputError):
        scenario_from(files, tmp_path / "a" / "b")
    assert not list(tmp_path.rglob("outside*"))
