"""The topics of all equipment that comes with the corridor."""

from __future__ import annotations

from typing import Final

from . import doppler, localizer, ranging, tick, track_code, train_bus, train_radio, world
from .topic import Topic

MODULES: Final = (tick, world, ranging, track_code, train_radio, doppler, localizer, train_bus)
ALL: Final[tuple[Topic, ...]] = tuple(topic for module in MODULES for topic in module.TOPICS)


def kind_of(name: str) -> Topic | None:
    """The kind of a topic by its absolute name, None if it is not one of the corridor's."""
    if name.endswith("/done"):
        return tick.DONE
    return next((topic for topic in ALL if topic.matches(name)), None)
