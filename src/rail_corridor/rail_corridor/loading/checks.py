"""What several sections of a scenario must agree on; the first disagreement is reported."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.equipment.off_times import check_off_times
from rail_corridor.equipment.registry import subsystems
from rail_corridor.errors import InputError, from_world
from rail_corridor.scenario.faults import TrainStopFault, WheelSlipFault
from rail_corridor.scenario.model import Scenario
from rail_corridor.scenario.timetable import CLEARING_TIME_S
from rail_world.errors import WorldDataError
from rail_world.trains.description import TrainDescription
from rail_world.trains.motion import TrainMotion


def check_scenario(scenario: Scenario, train_fields: Sequence[str]) -> None:
    """Raise InputError, without a file, for the first thing that does not fit together.

    Parameters
    ----------
    scenario : Scenario
        The scenario; its network is made on the way.
    train_fields : sequence of str
        For each train the path of its fields in the file.
    """
    try:
        network = scenario.network
    except WorldDataError as error:
        raise from_world(error) from None
    if not scenario.trains:
        raise InputError("at least one train is needed", field="trains", value=())
    names: set[str] = set()
    for train, field in zip(scenario.trains, train_fields, strict=True):
        if train.name in names:
            raise InputError("another train has it", field=f"{field}.name", value=train.name)
        names.add(train.name)
        try:
            TrainMotion(train, network, scenario.tick_s)
        except WorldDataError as error:
            input_error = from_world(error)
            place = input_error.field.removeprefix(f"trains.{train.name}.")
            raise InputError(
                input_error.reason,
                field=f"{field}.{place}",
                value=input_error.value,
                file=input_error.file,
            ) from None
    _check_places_of_trains(scenario.trains, train_fields)
    _check_faults(scenario)
    for subsystem in subsystems():
        subsystem.check(scenario, train_fields)
    _check_supervision(scenario)
    _check_actions(scenario)
    check_off_times(scenario)


def _check_places_of_trains(trains: Sequence[TrainDescription], fields: Sequence[str]) -> None:
    """See that no two trains are in one place, before or just after they depart from it."""
    for index, train in enumerate(trains):
        for other in trains[:index]:
            if train.route[0] != other.route[0]:
                continue
            (rear, front), (other_rear, other_front) = _extent(train), _extent(other)
            if rear >= other_front or other_rear >= front:
                continue
            (since, until), (other_since, other_until) = _presence(train), _presence(other)
            if since < other_until and other_since < until:
                raise InputError(
                    f"{other.name} is in the same place within {CLEARING_TIME_S:g} s of departure",
                    field=f"{fields[index]}.start_m",
                    value=train.start_m,
                )


def _presence(train: TrainDescription) -> tuple[float, float]:
    """Time for which a train takes up the place it starts from [s]."""
    since_s = train.depart_s if train.enters_at_departure else 0.0
    return since_s, train.depart_s + CLEARING_TIME_S


def _extent(train: TrainDescription) -> tuple[float, float]:
    rear_m = train.start_m - train.direction * train.vehicle.length_m
    return min(rear_m, train.start_m), max(rear_m, train.start_m)


def _check_faults(scenario: Scenario) -> None:
    trains = [train.name for train in scenario.trains]
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, TrainStopFault | WheelSlipFault) and fault.train not in trains:
            raise InputError(
                f"there is no such train, they are {', '.join(trains)}",
                field=f"faults.{index}.train",
                value=fault.train,
            )


def _check_actions(scenario: Scenario) -> None:
    trains = [train.name for train in scenario.trains]
    for index, action in enumerate(scenario.actions):
        if action.train not in trains:
            raise InputError(
                f"there is no such train, they are {', '.join(trains)}",
                field=f"actions.{index}.train",
                value=action.train,
            )


def _check_supervision(scenario: Scenario) -> None:
    """See that trains obey one thing alone."""
    obeyed = [each for each in subsystems() if each.supervision(scenario) is not None]
    if len(obeyed) > 1:
        first, second = (each.sections[0].name for each in obeyed[:2])
        raise InputError(f"trains obey either {first} or {second}", field=second, value=second)
