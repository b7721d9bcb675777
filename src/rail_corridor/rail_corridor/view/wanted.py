"""Which topics a viewer reads: little for the overview, more only while somebody looks at it.

Pure: names of topics in, names of topics to hold out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from rail_corridor.equipment.registry import kind_of as find_kind
from rail_corridor.equipment.registry import live_views
from rail_msgs_py.table import Table
from rail_msgs_py.topics.qos import LATCHED, STREAM
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import COMMAND, CORRIDOR_PATH, SCENARIO, STATE
from rail_msgs_py.waveform import Waveform

ARRAY: Final = "std_msgs/msg/Float64MultiArray"
#: Ticks of truth that are kept, so that an estimate is held against the truth of its own tick.
STATE_DEPTH: Final = 64
#: Telegrams of a few ticks: none should be missed between two looks.
EVENT_DEPTH: Final = 8
#: Read always, also before there is a corridor.
STANDING: Final = (STATE, SCENARIO, FINISHED, FAILED, DIAGNOSTICS)


@lru_cache(maxsize=1)
def overview() -> tuple[Topic, ...]:
    """Read for every train and place."""
    return (COMMAND, *(topic for view in live_views() for topic in view.overview))


@lru_cache(maxsize=1)
def events() -> tuple[Topic, ...]:
    """Topics of which every message counts."""
    return tuple(topic for view in live_views() for topic in view.events)


@lru_cache(maxsize=20_000)
def kind_of(name: str) -> Topic | None:
    """See `rail_corridor.equipment.registry.kind_of`."""
    return find_kind(name)


@dataclass(frozen=True)
class Tap:
    """How one topic is read."""

    type: Any
    depth: int = 1
    latched: bool = False


@dataclass(frozen=True)
class Wish:
    """What one browser looks at beside the overview: a train, a log of telegrams, a waveform."""

    train: str = ""
    telegrams: bool = False
    scope: str = ""


def wanted(
    names: Mapping[str, Collection[str]],
    wishes: Collection[Wish],
    details: Mapping[str, Collection[str]],
    *,
    ticking: bool,
) -> dict[str, Tap]:
    """Topics to hold.

    Parameters
    ----------
    names : mapping
        Topics that are there, and their types.
    wishes : collection of Wish
    details : mapping
        Train to the topics beyond its namespace that are read while it is looked at.
    ticking : bool
        Whether ticks run. Before the first one a stream must not be read by external nodes: nodes
        take any reader of what they send for the one that they wait for.
    """
    taps = {
        topic.name(): Tap(
            topic.type,
            STATE_DEPTH if topic is STATE else topic.qos.depth,
            latched=topic.qos is LATCHED,
        )
        for topic in STANDING
    }
    trains = {wish.train for wish in wishes if wish.train}
    named = {name for train in trains for name in details.get(train, ())}
    telegrams = any(wish.telegrams for wish in wishes)
    for name, types in names.items():
        kind = kind_of(name)
        if kind is CORRIDOR_PATH:
            taps[name] = Tap(kind.type, latched=True)
        elif kind in events():
            if telegrams and ticking:
                taps[name] = Tap(kind.type, EVENT_DEPTH)
        elif awaited(kind) and not ticking:
            continue
        elif kind is not None and (kind in overview() or name in named):
            taps[name] = Tap(kind.type)
        elif of_train(name) in trains and is_table(kind, types):
            taps[name] = Tap(STATE.type)
    if ticking:
        for wish in wishes:
            if ARRAY in names.get(wish.scope, ()):
                taps[wish.scope] = Tap(STATE.type)
    return taps


def awaited(kind: Topic | None) -> bool:
    """Whether a node waits for its reader on a topic before the first tick, as far as is known."""
    return kind is None or kind.qos is STREAM or kind.awaited


def is_table(kind: Topic | None, types: Collection[str]) -> bool:
    """Whether a topic may be a table: by its kind, or by its type if it is of no known kind."""
    return kind.view is Table if kind is not None else ARRAY in types


def is_waveform(name: str, types: Collection[str]) -> bool:
    """Whether a topic may be a waveform: by its kind, or by its type if it is of no known kind."""
    kind = kind_of(name)
    return kind.view is Waveform if kind is not None else ARRAY in types


@lru_cache(maxsize=20_000)
def of_train(name: str) -> str:
    """Train that a topic may be about, by its kind; its namespace if it is of no known kind.

    >>> of_train("/train_a/radar/fix"), of_train("/wayside/zone_controller/train_a/authority")
    ('train_a', 'train_a')
    """
    kind = kind_of(name)
    parts = {} if kind is None else kind.parts(name)
    return parts.get("train", name.split("/")[1])
