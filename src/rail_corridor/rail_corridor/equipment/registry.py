"""Every kind of equipment that a corridor may have.

Other distributions add theirs by an entry point of the group ``rail_corridor.equipment`` that names
an instance of `Subsystem`; see docs/adding_equipment.md.
"""

from __future__ import annotations

from functools import lru_cache
from importlib.metadata import entry_points
from re import sub
from typing import Final, get_args

from rail_corridor.equipment.doppler.subsystem import DOPPLER
from rail_corridor.equipment.localizer.subsystem import LOCALIZER
from rail_corridor.equipment.ranging.subsystem import RANGING
from rail_corridor.equipment.track_code.subsystem import TRACK_CODE
from rail_corridor.equipment.train_bus.subsystem import TRAIN_BUS
from rail_corridor.equipment.train_radio.subsystem import TRAIN_RADIO
from rail_corridor.errors import InputError
from rail_corridor.scenario.faults import COMMON_FAULTS, Fault
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics import tick, world
from rail_msgs_py.topics.topic import Topic

from .live import LiveView
from .node_spec import NodeKind
from .subsystem import Subsystem, Supervision

GROUP: Final = "rail_corridor.equipment"
#: In the order in which they are asked.
BUILTIN: Final = (RANGING, TRACK_CODE, TRAIN_RADIO, DOPPLER, LOCALIZER, TRAIN_BUS)
WORLD: Final = NodeKind("world", "rail_world.world_node:WorldNode", waits=True)


@lru_cache(maxsize=1)
def subsystems() -> tuple[Subsystem, ...]:
    """All subsystems: those of the corridor, then those of other distributions by name.

    Raises
    ------
    InputError
        If one of another distribution cannot be loaded, declares what is none of the kinds above,
        or takes a name that is taken.
    """
    found: list[Subsystem] = list(BUILTIN)
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        try:
            extra = entry.load()
        except (Exception, SystemExit) as error:
            reason = f"cannot be loaded: {type(error).__name__}: {error}"
            raise InputError(reason, field=GROUP, value=entry.value) from None
        if not isinstance(extra, Subsystem):
            raise InputError("is not a Subsystem", field=GROUP, value=entry.value)
        try:
            mine = names_of(extra)
        except Exception as error:
            reason = f"what it declares cannot be read: {type(error).__name__}: {error}"
            raise InputError(reason, field=GROUP, value=entry.value) from None
        _refuse_twins(found, mine, entry.value)
        found.append(extra)
    return tuple(found)


def _refuse_twins(found: list[Subsystem], mine: dict[str, list[str]], where: str) -> None:
    taken = [("the corridor", _OWN), *((other.name, names_of(other)) for other in found)]
    for what, names in mine.items():
        for owner, theirs in taken:
            for twin in sorted({*names}.intersection(theirs[what])):
                raise InputError(f"{what} {twin} belongs to {owner}", field=GROUP, value=where)
        for twin in sorted(name for name in {*names} if names.count(name) > 1):
            raise InputError(f"{what} {twin} is declared twice", field=GROUP, value=where)


def names_of(subsystem: Subsystem) -> dict[str, list[str]]:
    """Every name that a subsystem takes, by what it names; of a topic its shape.

    Raises
    ------
    AttributeError, TypeError, ValueError
        If something that it declares is not of the kind it should be.
    """
    return {
        "name": [subsystem.name],
        "section": [section.name for section in subsystem.sections],
        "kind of fault": [_kind_of_fault(fault) for fault in subsystem.faults],
        "option": [option.option for option in subsystem.options],
        "kind of node": [kind.name for kind in subsystem.nodes],
        "topic": [_shape(topic) for topic in subsystem.topics],
    }


def _kind_of_fault(fault: type[Fault]) -> str:
    kinds = get_args(fault.model_fields["kind"].annotation)
    if not kinds:
        raise ValueError(f"{fault.__name__} has no kind: Literal[...]")
    return str(kinds[0])


def _shape(topic: Topic) -> str:
    """Of two patterns that differ in names of placeholders only, every name would match both."""
    return sub(r"\{\w+\}", "{}", topic.pattern)


#: Names that are the corridor's own.
_OWN: Final[dict[str, list[str]]] = {
    "name": [],
    "section": [*Scenario.model_fields],
    "kind of fault": [_kind_of_fault(fault) for fault in COMMON_FAULTS],
    "option": [],
    "kind of node": [WORLD.name],
    "topic": [_shape(topic) for topic in (*tick.TOPICS, *world.TOPICS)],
}


@lru_cache(maxsize=1)
def node_kinds() -> dict[str, NodeKind]:
    """Every kind of node by its name."""
    kinds = [WORLD, *(kind for subsystem in subsystems() for kind in subsystem.nodes)]
    return {kind.name: kind for kind in kinds}


@lru_cache(maxsize=1)
def live_views() -> tuple[LiveView, ...]:
    """What every subsystem shows on the live page."""
    return tuple(subsystem.live() for subsystem in subsystems())


@lru_cache(maxsize=1)
def topics() -> tuple[Topic, ...]:
    """Every kind of topic, in the order of the documentation."""
    common = (*tick.TOPICS, *world.TOPICS)
    return (*common, *(topic for subsystem in subsystems() for topic in subsystem.topics))


def kind_of(name: str) -> Topic | None:
    """The kind of a topic by its absolute name, None if it is not one of the corridor's."""
    if name.endswith("/done"):
        return tick.DONE
    return next((topic for topic in topics() if topic.matches(name)), None)


def supervision_of(scenario: Scenario) -> Supervision | None:
    """What the trains of a scenario obey, None if they run by themselves."""
    found = (subsystem.supervision(scenario) for subsystem in subsystems())
    return next((each for each in found if each is not None), None)


def odometer_error_of(scenario: Scenario) -> float | None:
    """Standard deviation of the wheels' error, None where nobody reads them.

    Of several that read them, what trains obey comes first.
    """
    supervision = supervision_of(scenario)
    if supervision is not None:
        return supervision.odometer_error
    found = (subsystem.odometer_error(scenario) for subsystem in subsystems())
    return next((each for each in found if each is not None), None)
