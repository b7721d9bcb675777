"""What the live page is made of: cards, gauges, columns of trains, rows of the line, panels.

Equipment fills them in, the page draws them. They hold text and numbers only, so that nobody who
draws needs to know what equipment there is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal, TypeAlias

from rail_msgs_py.table import Table
from rail_msgs_py.topics.topic import Topic

from .live_state import LiveState

#: Label, text and unit of each value of a card.
Rows: TypeAlias = list[list[str]]
#: Number of writers of a topic by its name.
Writers: TypeAlias = Callable[[str], int]
Tone = Literal["", "warned", "bad"]


class CardGroup(IntEnum):
    """Where the cards of a train stand, in this order."""

    WAYSIDE_POSITION = 0
    RECEPTION = 1
    ONBOARD_POSITION = 2
    SUPERVISION = 3
    VEHICLE = 4
    OTHER = 5


@dataclass(frozen=True)
class Gauge:
    """An estimate against the truth.

    Parameters
    ----------
    off_m : float
        Estimate minus truth.
    half_m : float
        Half-width that it claims.
    what : str
        What that is, ``2σ`` or the name of a bound that must hold.
    low_m, high_m : float, optional
        Ends of the interval from the estimate, where it is not even to both sides.
    """

    off_m: float
    half_m: float
    what: str
    low_m: float | None = None
    high_m: float | None = None

    def shown(self) -> dict[str, Any]:
        """For the page."""
        values = {"off_m": self.off_m, "half_m": self.half_m}
        values |= {k: v for k in ("low_m", "high_m") if (v := getattr(self, k)) is not None}
        return {name: round(value, 3) for name, value in values.items()} | {"what": self.what}


def gauge(off_m: float | None, half_m: float, what: str) -> Gauge | None:
    """A gauge, None where either is not known."""
    if off_m is None or not (math.isfinite(off_m) and math.isfinite(half_m)):
        return None
    return Gauge(off_m, half_m, what)


@dataclass(frozen=True)
class Card:
    """What one sensor reports of a train.

    Parameters
    ----------
    title, topic : str
    stamp_ns : int
        Of what it shows.
    group : CardGroup
    rows : list of [label, text, unit]
    gauge : Gauge, optional
    """

    title: str
    topic: str
    stamp_ns: int
    group: CardGroup
    rows: Rows
    gauge: Gauge | None = None


@dataclass(frozen=True)
class TableCard:
    """How the tables of one topic are shown in a card.

    Parameters
    ----------
    topic : Topic
    title : str
        May hold the placeholders of the topic's name.
    group : CardGroup
    rows : callable, optional
        From the state, the train and the last row of the table, by columns, to rows of the card;
        by the names of the columns unless given.
    gauge : callable, optional
        From the state, the train and the table; from the columns of a position unless given.
    item : str
        What one row of the table is called.
    """

    topic: Topic
    title: str
    group: CardGroup
    rows: Callable[[LiveState, str, Mapping[str, float]], Rows] | None = None
    gauge: Callable[[LiveState, str, Table], Gauge | None] | None = None
    item: str = "row"

    def fits(self, table: Table) -> bool:
        """Whether a table is of the version that it knows."""
        return not self.topic.columns or table.columns == self.topic.columns


@dataclass(frozen=True)
class TrainColumn:
    """A column of the table of trains.

    Parameters
    ----------
    key : str
        By which the cells of a train are found.
    heading, unit, hint : str
    beside_position : bool
        Whether it stands beside the measured position, with numbers to the right.
    always : bool
        Whether it is shown even where no train has a cell, and on narrow screens.
    """

    key: str
    heading: str
    unit: str = ""
    hint: str = ""
    beside_position: bool = False
    always: bool = False


@dataclass(frozen=True)
class TrainCell:
    """A cell of it; ``group`` gives it the colour of a group of stretches of the line."""

    text: str
    tone: Tone = ""
    note: str = ""
    group: int | None = None


@dataclass(frozen=True)
class TrainInterval:
    """Part of a track that is claimed to hold a train; ``label`` is its legend."""

    track: str
    low_m: float
    high_m: float
    label: str


@dataclass(frozen=True)
class TrainRow:
    """What equipment adds to a train on the page.

    Parameters
    ----------
    cells : mapping
        Key of a `TrainColumn` to its cell.
    interval : TrainInterval, optional
    authority_end_m : float, optional
        Where its movement authority ends, on the track it is on.
    values : mapping
        More, for those who read the messages of the page.
    """

    cells: Mapping[str, TrainCell] = field(default_factory=dict)
    interval: TrainInterval | None = None
    authority_end_m: float | None = None
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ErrorTrace:
    """Names of an estimate whose error the page can draw, and what to see in it."""

    label: str
    caption: str


@dataclass(frozen=True)
class Mark:
    """Something that stands at a place of a track.

    Parameters
    ----------
    name, track : str
    at_m : float
        Chainage.
    node : str
        Its node, by which it is shown as off or failed; empty if it has none.
    map_m : (float, float), optional
        Where the map shows it.
    """

    name: str
    track: str
    at_m: float
    node: str = ""
    map_m: tuple[float, float] | None = None


@dataclass(frozen=True)
class TrackStretch:
    """A part of a track; those of one ``group`` have one colour and ``group_label``."""

    name: str
    track: str
    start_m: float
    end_m: float
    group: int | None = None
    group_label: str = ""


@dataclass(frozen=True)
class LineRow:
    """One row of the drawing of the line.

    Parameters
    ----------
    name : str
        By which the states of its elements are found.
    legend : str
        What marks are, or stretches that are active, or before the label of a group.
    marks, stretches : tuple
    symbol : str
        Of the marks: tick, triangle, diamond, circle or square.
    on_track : bool
        Whether it is drawn onto the track, its stretches in the colours of their groups, or in a
        row of its own below.
    """

    name: str
    legend: str
    marks: tuple[Mark, ...] = ()
    stretches: tuple[TrackStretch, ...] = ()
    symbol: Literal["tick", "triangle", "diamond", "circle", "square"] = "tick"
    on_track: bool = False


@dataclass(frozen=True)
class ElementState:
    """State of a mark or a stretch: a word behind its name, and how it is drawn."""

    word: str
    active: bool = True
    tone: Tone = ""


@dataclass(frozen=True)
class PanelSpec:
    """A tab of the page.

    Parameters
    ----------
    name, label : str
        In the address of the page, and on the tab.
    absent : str
        What it says where the corridor has none of the equipment.
    log : bool
        Whether it shows a log of messages, or cards and a table.
    note : str
        Below a log.
    """

    name: str
    label: str
    absent: str
    log: bool = False
    note: str = ""


@dataclass(frozen=True)
class Panel:
    """Contents of a tab.

    Parameters
    ----------
    cards_title : str
    cards : tuple of str
        Topics of the cards of the picked train that it repeats.
    title : str
        Of the table.
    headings : tuple of (text, unit)
    rows : tuple of tuple of (text, unit)
        The last cell of a row that is too short fills it up.
    picked : tuple of bool
        Which rows stand out.
    """

    cards_title: str
    cards: tuple[str, ...]
    title: str
    headings: tuple[tuple[str, str], ...]
    rows: tuple[tuple[tuple[str, str], ...], ...]
    picked: tuple[bool, ...]


@dataclass(frozen=True)
class LogEntry:
    """A message of a log: when and where it was seen, from whom to whom, what it says."""

    time_s: float
    stage: str
    place: str
    source: str
    destination: str
    kind: str
    sequence: int
    text: str

    def shown(self) -> dict[str, Any]:
        """For the page."""
        return {
            "t": round(self.time_s, 3),
            "stage": self.stage,
            "place": self.place,
            "from": self.source,
            "to": self.destination,
            "kind": self.kind,
            "seq": self.sequence,
            "text": self.text,
        }
