"""Which kind of topic a name is of, without loading all equipment, which takes half a second."""

from __future__ import annotations

import sys
from functools import cache
from importlib.metadata import entry_points
from typing import Final

from rail_msgs_py.topics import (
    doppler,
    localizer,
    ranging,
    tick,
    track_code,
    train_bus,
    train_radio,
    world,
)
from rail_msgs_py.topics.topic import Topic

_REGISTRY: Final = "rail_corridor.equipment.registry"
_BUILTIN: Final = (
    *tick.TOPICS,
    *world.TOPICS,
    *ranging.TOPICS,
    *track_code.TOPICS,
    *train_radio.TOPICS,
    *doppler.TOPICS,
    *localizer.TOPICS,
    *train_bus.TOPICS,
)


def kind_of(name: str) -> Topic | None:
    """As that of `rail_corridor.equipment.registry`, which is asked if others have equipment."""
    if name.endswith("/done"):
        return tick.DONE
    found = next((topic for topic in _BUILTIN if topic.matches(name)), None)
    if found is None and _others_have_equipment():
        from rail_corridor.equipment.registry import kind_of as kind_of_all

        return kind_of_all(name)
    return found


def _others_have_equipment() -> bool:
    """Whether it may be; once all equipment is loaded asking it costs nothing."""
    return _REGISTRY in sys.modules or _has_entry_points()


@cache
def _has_entry_points() -> bool:
    return bool(entry_points(group="rail_corridor.equipment"))
