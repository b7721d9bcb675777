"""Loading scenarios: one situation per YAML file, validated whole before anything starts."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from rail_corridor.equipment.registry import subsystems
from rail_corridor.errors import InputError, from_validation
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import load_yaml

from .checks import check_scenario
from .overrides import Overrides, apply_overrides, blame_override, turned_round
from .schema import field_names, parse_scenario, scenario_model

_SCENARIOS: Final = Path(str(resources.files("rail_corridor.loading"))) / "builtin"


def builtin_scenarios() -> dict[str, Path]:
    """Return the scenarios that come with the corridor and with equipment, name to file.

    Raises
    ------
    InputError
        If two have one name.
    """
    folders = (_SCENARIOS, *(each.scenarios for each in subsystems() if each.scenarios))
    found: dict[str, Path] = {}
    for folder in folders:
        for path in sorted(folder.glob("*.yaml")):
            if path.stem in found:
                reason = f"there is one of this name already, {found[path.stem]}"
                raise InputError(reason, file=str(path))
            found[path.stem] = path
    return found


def load_scenario(name_or_path: str | Path, *, overrides: Overrides | None = None) -> Scenario:
    """Load a scenario and see that everything in it fits together.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a built-in scenario, or a YAML file.
    overrides : Overrides, optional
        What to change in it first.

    Returns
    -------
    Scenario
        Complete in itself: names of track files are absolute, trains of a timetable are listed.

    Raises
    ------
    InputError
        One line that names the file (or the command line), the field and the value.
    """
    path = _find(name_or_path)
    data = load_yaml(path)
    overrides = overrides or Overrides()
    origins = apply_overrides(data, overrides)
    try:
        return scenario_from_data(data, directory=path.parent, reverse=overrides.reverse)
    except InputError as error:
        raise blame_override(error, overrides, origins).located(str(path)) from None


def scenario_from_data(
    data: Mapping[str, Any], *, directory: Path, reverse: bool = False
) -> Scenario:
    """Make a scenario from plain data, as they stand in a file.

    Parameters
    ----------
    data : mapping
        The top level of the file.
    directory : Path
        Where relative names of track files start from.
    reverse : bool
        Whether trains run the other way, from the other end of their track.

    Raises
    ------
    InputError
        Names the field and the value; the file is left to the caller.
    """
    try:
        scenario = parse_scenario(data)
    except ValidationError as error:
        raise from_validation(error, data, field_names()) from None
    except RecursionError:
        raise InputError("is nested too deeply") from None
    except OverflowError:
        raise InputError("holds a number beyond all bounds") from None
    if not scenario.tracks:
        raise InputError(
            "at least one track is needed; describe one, or give a line with --track FILE.json",
            field="tracks",
            value={},
        )
    fields = [f"trains.{index}" for index in range(len(scenario.trains))]
    trains = scenario.trains
    if scenario.timetable is not None:
        trains += scenario.timetable.trains()
        fields += ["timetable.train"] * scenario.timetable.count
    tracks = {
        name: track
        if track.ttobench is None
        else track.model_copy(update={"ttobench": str((directory / track.ttobench).absolute())})
        for name, track in scenario.tracks.items()
    }
    sections = {
        section.name: plan.located(directory)
        for subsystem in subsystems()
        for section in subsystem.sections
        if hasattr(plan := section.of(scenario), "located")
    }
    changes = {"trains": trains, "timetable": None, "tracks": tracks, **sections}
    scenario = scenario.model_copy(update=changes)
    check_scenario(scenario, fields)
    if reverse:
        trains = turned_round(trains, scenario.network)
        scenario = scenario.model_copy(update={"trains": trains})
        check_scenario(scenario, fields)
    return scenario


def _find(name_or_path: str | Path) -> Path:
    known = builtin_scenarios()
    if str(name_or_path) in known:
        return known[str(name_or_path)]
    path = Path(name_or_path)
    try:
        there = path.exists()
    except (OSError, ValueError):
        there = False
    if not there and path.suffix not in (".yaml", ".yml"):
        raise InputError(
            f"there is no such file, and no built-in scenario of that name ({', '.join(known)})",
            file=str(name_or_path),
        )
    return path


def scenario_from_json(text: str) -> Scenario:
    """The scenario that `Scenario.to_json` wrote."""
    return scenario_model().model_validate_json(text)
