"""Keys of pairs: who is handed which, and files of keys that are none."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import pytest
import yaml

from rail_corridor.equipment.train_radio import keys
from rail_corridor.equipment.train_radio.keys import pair_keys, write_keys
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import load_scenario, scenario_from_data
from rail_corridor.loading.scenario_files import files_of, scenario_from
from rail_corridor.plan.parameter_files import write_plan
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.train_radio.safe_frame import FrameKind
from rail_msgs_py.train_radio.safe_result import Greeted, Rejected, RejectionReason
from rail_msgs_py.train_radio.train_channel import EndSettings, controller_end, train_end

FILE = {"a": "0a" * 32, "b": "0b" * 16}


def data(**cbtc: Any) -> dict[str, Any]:
    return {
        "name": "keys",
        "seed": 4,
        "duration_s": 2.0,
        "tracks": {"main": {"elements": [{"straight_m": 2000}]}},
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1000, **cbtc},
        "trains": [
            {"name": "a", "route": ["main"], "start_m": 900},
            {"name": "b", "route": ["main"], "start_m": 400},
        ],
    }


def scenario_with(folder: Path, content: Any) -> Any:
    (folder / "keys.yaml").write_text(yaml.safe_dump(content))
    return scenario_from_data(data(keys="keys.yaml"), directory=folder)


@pytest.mark.parametrize("from_file", [False, True])
def test_each_train_has_its_own_key_and_nobody_anothers(tmp_path: Path, from_file: bool) -> None:
    (tmp_path / "keys.yaml").write_text(yaml.safe_dump(FILE))
    made = scenario_from_data(
        data(**({"keys": "keys.yaml"} if from_file else {})), directory=tmp_path
    )
    mine = pair_keys(made)
    assert len({*mine.values()}) == 2
    folder = tmp_path / "plan"
    write_plan(made, folder)
    holders: dict[str, set[str]] = {name: set() for name in mine}
    for path in folder.rglob("*"):
        text = path.read_text() if path.is_file() else ""
        assert keys._root(made.seed).hex() not in text
        for name, key in mine.items():
            if key in text:
                holders[name].add(str(path.relative_to(folder)))
    wayside = "parameters/wayside_zone_controller.yaml"
    assert holders == {name: {f"parameters/{name}_atp.yaml", wayside} for name in mine}


def test_neither_recording_nor_announcement_says_where_keys_lie(tmp_path: Path) -> None:
    made = scenario_with(tmp_path, FILE)
    assert made.cbtc.keys == str(tmp_path / "keys.yaml")
    files = files_of(made)
    text = b"".join(each.data for each in files).decode() + made.to_json()
    text += make_plan(made, tmp_path).world.model_dump_json()
    assert "keys.yaml" not in text
    assert not any(key in text for key in FILE.values())
    again = tmp_path / "again"
    again.mkdir()
    assert scenario_from(files, again).cbtc.keys is None


def test_derived_keys_follow_from_the_seed_and_from_nothing_less() -> None:
    one, other = load_scenario("moving_block"), load_scenario("moving_block")
    assert pair_keys(one) == pair_keys(other)
    changed = other.model_copy(update={"seed": other.seed + 1})
    assert not {*pair_keys(changed).values()} & {*pair_keys(one).values()}


def test_ends_with_keys_of_different_pairs_do_not_hear_each_other() -> None:
    made = pair_keys(load_scenario("moving_block"))
    first, second = [*made.values()][:2]
    for key, heard in ((first, True), (second, False)):
        train = train_end(EndSettings(first, 1, 1, 0.25))
        opened = controller_end(EndSettings(key, 1, 1, 0.25)).open(
            train.seal(FrameKind.LOCATION_REPORT, b"", 0), 250_000_000
        )
        assert opened == (Greeted(False) if heard else Rejected(RejectionReason.SAFETY_CODE))


@pytest.mark.parametrize(
    ("content", "field", "reason"),
    [
        ({"a": FILE["a"]}, "b", "a key is needed"),
        ({**FILE, "bb": "00" * 16}, "bb", "there is no such train"),
        ({**FILE, "b": "0b" * 15}, "b", "16 bytes or more, got 15"),
        ({**FILE, "b": "no key"}, "b", "hexadecimal digits"),
        ({**FILE, "b": 12}, "b", "must be text"),
        ({**FILE, "b": FILE["a"].upper()}, "b", "is another train's as well"),
    ],
)
def test_a_file_of_keys_that_are_none_is_one_line(
    tmp_path: Path, content: Any, field: str, reason: str
) -> None:
    with pytest.raises(InputError) as caught:
        scenario_with(tmp_path, content)
    error = caught.value
    assert (error.file, error.field) == (str(tmp_path / "keys.yaml"), field)
    assert reason in str(error) and "\n" not in str(error)
    assert not any(str(key) in str(error) for key in content.values() if key != 12)


def test_a_file_of_keys_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        scenario_from_data(data(keys="none.yaml"), directory=tmp_path)


def test_keys_are_drawn_into_a_new_file_of_their_owner(tmp_path: Path) -> None:
    made = scenario_from_data(data(), directory=tmp_path)
    path = tmp_path / "keys.yaml"
    assert write_keys(made, path) == 2
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    drawn = pair_keys(scenario_from_data(data(keys="keys.yaml"), directory=tmp_path))
    assert not {*drawn.values()} & {*pair_keys(made).values()}
    with pytest.raises(InputError, match="is there already"):
        write_keys(made, path)
    with pytest.raises(InputError, match="has no train control by radio"):
        write_keys(load_scenario("plain_line"), tmp_path / "other.yaml")


@pytest.mark.parametrize(
    ("fault", "field", "reason"),
    [
        ({"node": "/a/apt"}, "node", "did you mean /a/atp"),
        ({"node": "/a/vrs"}, "node", "no such unit has a clock of its own"),
        ({"node": "/a/atp", "offset_s": 1e5}, "offset_s", "less than or equal to 3600"),
        ({"node": "/a/atp", "drift_ppm": -2e3}, "drift_ppm", "greater than or equal to -1000"),
    ],
)
def test_clocks_that_cannot_be_are_refused(
    tmp_path: Path, fault: dict[str, Any], field: str, reason: str
) -> None:
    with pytest.raises(InputError) as caught:
        scenario_from_data({**data(), "faults": [{"kind": "clock", **fault}]}, directory=tmp_path)
    assert caught.value.field == f"faults.0.{field}"
    assert reason in str(caught.value)


def test_a_clock_is_wrong_in_one_way_at_a_time(tmp_path: Path) -> None:
    faults = [{"kind": "clock", "node": "/a/atp", "offset_s": s} for s in (1.0, 2.0)]
    with pytest.raises(InputError, match="another fault of the clock of /a/atp begins then"):
        scenario_from_data({**data(), "faults": faults}, directory=tmp_path)
    faults[1]["from_s"] = 5.0
    made = scenario_from_data({**data(), "faults": faults[::-1]}, directory=tmp_path)
    parameters = make_plan(made, tmp_path).node("/a/atp").parameters
    assert parameters["clock_from_s"] == (0.0, 5.0)
    assert parameters["clock_offset_s"] == (1.0, 2.0)
