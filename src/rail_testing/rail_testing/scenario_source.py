"""The scenario of a test, from whatever it is given as."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import load_scenario, scenario_from_data
from rail_corridor.loading.overrides import Overrides
from rail_corridor.loading.schema import fault_fields
from rail_corridor.scenario.model import Scenario


def scenario_of(scenario: Any, overrides: Overrides) -> Scenario:
    """The scenario, with what is changed in it.

    Parameters
    ----------
    scenario : str, Path, mapping or Scenario
        As `rail_testing.corridor.Corridor` has it.
    overrides : Overrides

    Raises
    ------
    InputError
        If it is wrong.
    """
    if isinstance(scenario, str | Path):
        return load_scenario(scenario, overrides=overrides)
    if isinstance(scenario, Scenario):
        data = scenario.model_dump(mode="json", exclude_unset=True)
    elif isinstance(scenario, Mapping):
        data = dict(scenario)
    else:
        reason = "must be a name, a file, the data of a file, or a Scenario"
        raise InputError(reason, field="scenario", value=scenario)
    if overrides.seed is not None:
        data["seed"] = overrides.seed
    if overrides.duration_s is not None:
        data["duration_s"] = overrides.duration_s
    return scenario_from_data(data, directory=Path.cwd())


def times_of(kind: str, now_s: float) -> dict[str, float]:
    """From now on for good, of a fault that has a time."""
    return {
        field: value
        for field, value in (("from_s", now_s), ("to_s", 1e6))
        if field in fault_fields(kind)
    }
