"""What several sections of a scenario must agree on; the first disagreement is reported."""

from __future__ import annotations

from collections.abc import Sequence

from rail_corridor.equipment.off_times import check_off_times
from rail_corridor.equipment.registry import subsystems
from rail_corridor.errors import InputError, from_world
from rail_corridor.scenario.faults import WORLD_FAULTS, SpeedRestrictionFault
from rail_corridor.scenario.model import Scenario
from rail_world.errors import WorldDataError
from rail_world.trains.motion import TrainMotion

from .start_checks import check_start


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
    motions: list[TrainMotion] = []
    for train, field in zip(scenario.trains, train_fields, strict=True):
        if train.name in names:
            raise InputError("another train has it", field=f"{field}.name", value=train.name)
        names.add(train.name)
        try:
            motions.append(TrainMotion(train, network, scenario.tick_s))
        except WorldDataError as error:
            input_error = from_world(error)
            place = input_error.field.removeprefix(f"trains.{train.name}.")
            raise InputError(
                input_error.reason,
                field=f"{field}.{place}",
                value=input_error.value,
                file=input_error.file,
            ) from None
    check_start(scenario, motions, train_fields)
    _check_faults(scenario)
    for subsystem in subsystems():
        subsystem.check(scenario, train_fields)
    _check_supervision(scenario)
    _check_actions(scenario)
    check_off_times(scenario)


def _check_faults(scenario: Scenario) -> None:
    trains = [train.name for train in scenario.trains]
    for index, fault in enumerate(scenario.faults):
        if isinstance(fault, SpeedRestrictionFault):
            _check_restriction(scenario, fault, f"faults.{index}")
        elif isinstance(fault, WORLD_FAULTS) and fault.subject not in trains:
            raise InputError(
                f"there is no such train, they are {', '.join(trains)}",
                field=f"faults.{index}.train",
                value=fault.subject,
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


def _check_restriction(scenario: Scenario, fault: SpeedRestrictionFault, field: str) -> None:
    track = scenario.network.tracks.get(fault.track)
    if track is None:
        raise InputError("there is no such track", field=f"{field}.track", value=fault.track)
    if fault.to_m > track.length_m:
        reason = f"{fault.track} ends at {track.length_m:g} m"
        raise InputError(reason, field=f"{field}.to_m", value=fault.to_m)


def _check_supervision(scenario: Scenario) -> None:
    """See that trains obey one thing alone."""
    obeyed = [each for each in subsystems() if each.supervision(scenario) is not None]
    if len(obeyed) > 1:
        first, second = (each.sections[0].name for each in obeyed[:2])
        raise InputError(f"trains obey either {first} or {second}", field=second, value=second)
