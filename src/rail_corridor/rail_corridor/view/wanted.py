"""Which topics a viewer reads: little for the overview, more only while somebody looks at it.

Pure: names of topics in, names of topics to hold out.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final

from rail_corridor.equipment.registry import kind_of
from rail_msgs_py.table import Table
from rail_msgs_py.topics.doppler import DOPPLER_FIX
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.qos import LATCHED, STREAM
from rail_msgs_py.topics.ranging import POSITION, RANGE, VRS_CHANNEL
from rail_msgs_py.topics.tick import DIAGNOSTICS, FAILED, FINISHED
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.track_code import CODE_SENT, OCCUPANCY
from rail_msgs_py.topics.train_radio import (
    ATP_STATE,
    AUTHORITY,
    DOWN_TELEGRAMS,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.topics.world import COMMAND, CORRIDOR_PATH, SCENARIO, STATE
from rail_msgs_py.waveform import Waveform

ARRAY: Final = "std_msgs/msg/Float64MultiArray"
#: Ticks of truth that are kept, so that an estimate is held against the truth of its own tick.
STATE_DEPTH: Final = 64
#: Telegrams of a few ticks: none should be missed between two looks.
TELEGRAM_DEPTH: Final = 8

#: Read for every train and circuit.
OVERVIEW: Final = (
    *(POSITION, VRS_CHANNEL, COMMAND, ATP_STATE, AUTHORITY),
    *(OCCUPANCY, CODE_SENT, LOCALIZER_STATE),
)
#: Read always, also before there is a corridor.
STANDING: Final = (*(STATE, SCENARIO, FINISHED, FAILED, DIAGNOSTICS),)
#: Estimates that are kept for the report, and waited for on board as well.
AWAITED_ESTIMATES: Final = (COMMAND, DOPPLER_FIX, LOCALIZER_STATE)
TELEGRAMS: Final = (
    *(TRAIN_TELEGRAMS, RADIO_TELEGRAMS),
    *(DOWN_TELEGRAMS, UP_TELEGRAMS),
)

kind_of = lru_cache(maxsize=20_000)(kind_of)


@dataclass(frozen=True)
class Tap:
    """How one topic is read."""

    type: Any
    depth: int = 1
    latched: bool = False


@dataclass(frozen=True)
class Wish:
    """What one browser looks at, beside the overview."""

    train: str = ""
    telegrams: bool = False
    scope: str = ""


def wanted(
    names: Mapping[str, Collection[str]],
    wishes: Collection[Wish],
    zones: Mapping[str, Collection[str]],
    *,
    ticking: bool,
) -> dict[str, Tap]:
    """Topics to hold.

    Parameters
    ----------
    names : mapping
        Topics that are there, and their types.
    wishes : collection of Wish
    zones : mapping
        Train to topics of the ranges measured to it.
    ticking : bool
        Whether ticks run. Before the first one a stream must not be read by strangers: nodes take
        any reader of what they send for the one that they wait for.
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
    telegrams = any(wish.telegrams for wish in wishes)
    for name, types in names.items():
        kind = kind_of(name)
        if kind is CORRIDOR_PATH:
            taps[name] = Tap(kind.type, latched=True)
        elif kind in OVERVIEW:
            if ticking or not awaited(kind):
                taps[name] = Tap(kind.type)
        elif kind in TELEGRAMS:
            if telegrams and ticking:
                taps[name] = Tap(kind.type, TELEGRAM_DEPTH)
        elif of_train(name) in trains and is_table(kind, types) and (ticking or not awaited(kind)):
            taps[name] = Tap(STATE.type)
    if ticking:
        for train in trains:
            taps.update((n, Tap(RANGE.type)) for n in zones.get(train, ()) if n in names)
        for wish in wishes:
            if ARRAY in names.get(wish.scope, ()):
                taps[wish.scope] = Tap(STATE.type)
    return taps


def awaited(kind: Topic | None) -> bool:
    """Whether a node waits for its reader on a topic before the first tick, as far as is known."""
    return kind is None or kind.qos is STREAM or kind in AWAITED_ESTIMATES


def is_table(kind: Topic | None, types: Collection[str]) -> bool:
    """Whether a topic may be a table: by its kind, or by its type if it is of no known kind."""
    return kind.view is Table if kind is not None else ARRAY in types


def is_waveform(name: str, types: Collection[str]) -> bool:
    """Whether a topic may be a waveform: by its kind, or by its type if it is of no known kind."""
    kind = kind_of(name)
    return kind.view is Waveform if kind is not None else ARRAY in types


@lru_cache(maxsize=20_000)
def of_train(name: str) -> str:
    """Train that a topic may be about, by its name: its namespace, or its part below the wayside.

    >>> of_train("/train_a/vrs/channel"), of_train("/wayside/zone_controller/train_a/authority")
    ('train_a', 'train_a')
    """
    parts = name.split("/")
    if name.startswith("/wayside/zone_controller/") and len(parts) == 5:
        return parts[3]
    return parts[1]
