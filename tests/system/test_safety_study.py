"""The study of safety: runs in which a planted fault makes it fail, one for each judgement."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.studies.safety.judgement import judge_safety
from rail_corridor.study.journal import Entry
from rail_corridor.study.sources import Drawn, found
from rail_corridor.study.study_file import load_study
from rail_corridor.study.summary import violations_of
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.train_radio import ATP_STATE, AUTHORITY
from rail_msgs_py.topics.world import COMMAND
from rail_testing.corridor import Corridor
from rail_world.line.profile import StepProfile
from rail_world.trains import driver

LAST_END_S = 20.0
DURATION_S = LAST_END_S + 62.0
#: Fields of the table of a message of one row, as those who receive it see them.
Row = dict[str, float]
Make = Callable[..., Corridor]


def line(*, localizer: bool = False) -> dict[str, Any]:
    """Return a scenario in which b, a heedless driver, follows a, which stops for a while."""
    return {
        "name": "planted",
        "seed": 5,
        "tick_s": 0.5,
        "duration_s": DURATION_S,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 2600}],
                "speed_limits": [[0, 60], [700, 40], [900, 60]],
                "stops_m": [2450],
            }
        },
        "stations": {"zone_length_m": 350},
        "cbtc": {"base_spacing_m": 1000, "cab_signals": False},
        "trains": [
            {"name": "a", "route": ["main"], "start_m": 850},
            {"name": "b", "route": ["main"], "start_m": 500},
        ],
        "faults": [{"kind": "train_stop", "train": "a", "from_s": 0, "to_s": LAST_END_S}],
    } | ({"references": {"spacing_m": 500}, "localizer": {}} if localizer else {})


def changed(topic: Topic, change: Callable[[Row], Row], message: Any) -> Any:
    """Return a message of one row with columns changed."""
    names = [column.name for column in topic.table]
    offset = len(message.data) - len(names)
    values = dict(zip(names, message.data[offset:], strict=True))
    message.data[offset:] = type(message.data)("d", [change(values)[name] for name in names])
    return message


def violated(make: Make, plants: dict[str, Any], *, localizer: bool = False) -> set[str]:
    """Return what the study says is not as it must be of a run with planted faults."""
    corridor = make(line(localizer=localizer))
    for name, function in plants.items():
        corridor.intercept(name, function)
    corridor.run_for(DURATION_S)
    data = corridor._running().observer.recording  # the study reads the same
    drawn = Drawn(line(localizer=localizer), facts={"last_end_s": LAST_END_S})
    scenario = scenario_from_data(drawn.data, directory=Path.cwd())
    report = corridor.report() | {"drawn": judge_safety(drawn, scenario, data)}
    study, _ = load_study("safety", FOLDER, GENERATORS, CALCULATIONS)
    entry = Entry(0, 0, 1, {}, {}, found(study.figures, report), None, 0.0)
    return {violation.figure for violation in violations_of([entry], study.figures)}


def never_brakes(row: Row) -> Row:
    demands = ("service_brake", "emergency_brake", "traction_cut_off")
    return row | {"permitted_mps": np.inf} | dict.fromkeys(demands, 0.0)


def never_lets_go(row: Row) -> Row:
    return row | {"service_brake": 1.0, "permitted_mps": 0.0}


def claims_a_tenth(row: Row) -> Row:
    return row | {"uncertainty_m": 0.1 * row["uncertainty_m"], "front_m": row["front_m"] + 0.5}


def claims_half(row: Row) -> Row:
    middle_m, half_m = row["front_m"], 0.25 * (row["high_m"] - row["low_m"])
    return row | {"low_m": middle_m + half_m, "high_m": middle_m + 2.0 * half_m}


def takes_the_rear_further(row: Row) -> Row:
    return row | {"worst_rear_m": row["worst_rear_m"] + 30.0}


COMMAND_OF_B = COMMAND.name(train="b", supervision="atp")
PLANTS: dict[str, tuple[dict[str, Any], set[str], bool]] = {
    "a protection that never brakes": (
        {COMMAND_OF_B: partial(changed, COMMAND, never_brakes)},
        {"collisions", "passed_ends"},
        False,
    ),
    "a protection that never lets go": (
        {COMMAND_OF_B: partial(changed, COMMAND, never_lets_go)},
        {"stuck"},
        False,
    ),
    "a protection that claims a tenth of its doubt": (
        {ATP_STATE.name(train="b"): partial(changed, ATP_STATE, claims_a_tenth)},
        {"mislocated_atp"},
        False,
    ),
    "a localizer that claims half its level": (
        {LOCALIZER_STATE.name(train="b"): partial(changed, LOCALIZER_STATE, claims_half)},
        {"mislocated_localizer"},
        True,
    ),
    "a controller that takes a rear further than it is": (
        {AUTHORITY.name(train="a"): partial(changed, AUTHORITY, takes_the_rear_further)},
        {"passed_tails"},
        False,
    ),
}


@pytest.mark.parametrize("localizer", [False, True])
def test_a_run_in_which_a_train_stops_for_a_while_violates_nothing(
    localizer: bool, corridor: Make
) -> None:
    assert violated(corridor, {}, localizer=localizer) == set()


@pytest.mark.parametrize("plant", PLANTS)
def test_a_planted_fault_is_seen_by_the_judgement_that_is_meant_for_it(
    plant: str, corridor: Make
) -> None:
    plants, expected, localizer = PLANTS[plant]
    found_in = violated(corridor, plants, localizer=localizer)
    # What a localizer claims goes on to the protection and to the controller.
    assert expected == found_in or (localizer and expected < found_in)


def test_a_driver_above_the_limits_whom_no_protection_brakes_is_seen(
    corridor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = driver.limits_for_train

    def half_as_much_again(*arguments: Any, **more: Any) -> StepProfile:
        right = limits(*arguments, **more)
        return StepProfile(right.starts_m.tolist(), (1.5 * right.values).tolist())

    monkeypatch.setattr(driver, "limits_for_train", half_as_much_again)
    command_of_a = COMMAND.name(train="a", supervision="atp")
    plants = {command_of_a: partial(changed, COMMAND, never_brakes)}
    assert violated(corridor, plants) == {"overspeed_s"}
