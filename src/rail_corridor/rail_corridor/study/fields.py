"""Fields of plain data by their dotted names."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from rail_corridor.errors import InputError


def with_fields(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """A copy of plain data in which some fields have other values.

    >>> with_fields({"trains": [{"name": "a"}]}, {"trains.0.speed_kmh": 60, "cbtc.scheme": "mrc"})
    {'trains': [{'name': 'a', 'speed_kmh': 60}], 'cbtc': {'scheme': 'mrc'}}

    Raises
    ------
    InputError
        If a name leads through what has no fields, or beyond the end of a list.
    """
    changed = copy.deepcopy(dict(data))
    for name, value in values.items():
        *path, last = name.split(".")
        here: Any = changed
        for part in path:
            here = here.setdefault(part, {}) if isinstance(here, dict) else _item(here, part, name)
        if isinstance(here, dict):
            here[last] = value
        else:
            here[_index(here, last, name)] = value
    return changed


def _item(here: Any, part: str, name: str) -> Any:
    return here[_index(here, part, name)]


def _index(here: Any, part: str, name: str) -> int:
    if not isinstance(here, list):
        raise InputError(f"there are no fields before {part}", field=name)
    if not part.isdecimal() or int(part) >= len(here):
        raise InputError(f"there are {len(here)} of them, numbered from 0", field=name, value=part)
    return int(part)
