"""Whatever a file holds: a scenario, or one line of complaint, and nothing else."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, scenario_from_data
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import load_yaml, parse_yaml

BASES = [load_yaml(builtin_scenarios()[name]) for name in ("branch", "demo", "plain_line")]
NAMES = sorted({"main", "wrs1", *(key for base in BASES for key in base)})
NUMBERS = (
    st.floats()
    | st.integers()
    | st.sampled_from([0, -1, 1, 1e300, 2**63, 10**400, 1e-300, 200.0, 5000])
)
SCALARS = st.none() | st.booleans() | NUMBERS | st.text(max_size=20) | st.sampled_from(NAMES)
TREES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=8), inner, max_size=4)
    ),
    max_leaves=12,
)


def outcome(data: Any) -> None:
    """Make a scenario of the data; only InputError may come out, in one line."""
    try:
        scenario = scenario_from_data(data, directory=Path("/nonexistent"))
    except InputError as error:
        assert str(error).isprintable()
    else:
        assert isinstance(scenario, Scenario)
        assert layout_of(scenario).zones


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Return the paths of every value in nested data."""
    found = [path] if path else []
    if isinstance(data, dict):
        for key, value in data.items():
            found += places(value, (*path, key))
    elif isinstance(data, list):
        for index, value in enumerate(data):
            found += places(value, (*path, index))
    return found


@given(st.dictionaries(st.sampled_from(NAMES) | st.text(max_size=8), TREES, max_size=6))
@settings(max_examples=50)
def test_random_data(data: dict[str, Any]) -> None:
    outcome(data)


@given(st.data())
@settings(max_examples=80)
def test_a_valid_scenario_with_values_replaced(draw: st.DataObject) -> None:
    data = copy.deepcopy(draw.draw(st.sampled_from(BASES)))
    for _ in range(draw.draw(st.integers(1, 2))):
        path = draw.draw(st.sampled_from(places(data)))
        parent = data
        for part in path[:-1]:
            parent = parent[part]
        parent[path[-1]] = draw.draw(NUMBERS | TREES)
    outcome(data)


@given(st.data())
@settings(max_examples=50)
def test_a_valid_scenario_with_numbers_scaled(draw: st.DataObject) -> None:
    """Numbers of a plausible size reach the checks behind the model."""
    data = copy.deepcopy(draw.draw(st.sampled_from(BASES)))
    numbers = []
    for path in places(data):
        value = data
        for part in path:
            value = value[part]
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            numbers.append((path, value))
    for path, value in draw.draw(st.lists(st.sampled_from(numbers), min_size=1, max_size=3)):
        parent = data
        for part in path[:-1]:
            parent = parent[part]
        parent[path[-1]] = value * draw.draw(st.sampled_from([-1, 0, 0.1, 0.5, 0.9, 1.5, 2, 10]))
    outcome(data)


@given(st.text(alphabet=st.characters(codec="utf-8"), max_size=60) | st.text("[]{}:,&*!|>-'\"# \n"))
@settings(max_examples=100)
def test_random_text_as_yaml(text: str) -> None:
    try:
        parse_yaml(text)
    except InputError as error:
        assert str(error).isprintable()
