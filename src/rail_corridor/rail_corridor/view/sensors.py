"""What each sensor reports of one train, as cards: in plain words, or by the names of columns."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any, Final

from rail_corridor.equipment.column_text import shown_value
from rail_corridor.equipment.live_elements import (
    Card,
    CardGroup,
    Gauge,
    Rows,
    TableCard,
    Writers,
    gauge,
)
from rail_corridor.equipment.live_state import LiveState
from rail_corridor.equipment.registry import live_views
from rail_msgs_py.stamps import seconds_to_ns
from rail_msgs_py.table import Table
from rail_msgs_py.topics.world import COMMAND, ODOMETER

from .wanted import kind_of, of_train

#: Tables of every corridor, whatever equipment it has.
_COMMON: Final = (
    TableCard(COMMAND, "Supervision commands", CardGroup.SUPERVISION),
    TableCard(ODOMETER, "Odometer", CardGroup.VEHICLE),
)
_PLACES: Final = ("chainage_m", "front_m", "position_m", "along_m")
#: Column that says how sure a place is, and what makes it the half-width that is drawn.
_SPREADS: Final[tuple[tuple[str, Callable[[float], float], str], ...]] = (
    ("chainage_m2", lambda value: 2.0 * math.sqrt(value) if value >= 0.0 else math.nan, "2σ"),
    ("half_m", lambda value: value, "bound"),
    ("sigma_m", lambda value: 2.0 * value, "2σ"),
    ("variance_m2", lambda value: 2.0 * math.sqrt(value) if value >= 0.0 else math.nan, "2σ"),
    ("uncertainty_m", lambda value: value, "bound"),
)
#: An estimate older than this many ticks, and than a second, is stale.
_STALE_TICKS: Final = 4


@lru_cache(maxsize=1)
def table_cards() -> dict[str, tuple[int, TableCard]]:
    """Place and card of each kind of table that is known, by the pattern of its topic."""
    cards = [card for view in live_views() for card in view.tables]
    return {card.topic.pattern: (place, card) for place, card in enumerate([*cards, *_COMMON])}


def cards(state: LiveState, train: str, writers: Writers) -> list[dict[str, Any]]:
    """Cards of one train.

    Parameters
    ----------
    state : LiveState
    train : str
    writers : callable
        Number of writers of a topic; 0 makes the card say that it has gone.
    """
    own = [card for view in live_views() for card in view.cards(state, train)]
    all_cards = sorted([*own, *_of_tables(state, train)], key=lambda card: card.group)
    stale_s = max(1.0, _STALE_TICKS * float(state.line.get("tick_s", 0.0)))
    return [_shown(state, card, writers, stale_s) for card in all_cards]


def _of_tables(state: LiveState, train: str) -> list[Card]:
    """Cards of the tables of a train in the order of the equipment, those of unknown ones last."""
    known = table_cards()
    placed = []
    for name in sorted(state.tables):
        if of_train(name) == train:
            kind = kind_of(name)
            place, how = known.get("" if kind is None else kind.pattern, (len(known), None))
            placed.append((place, _table_card(state, train, name, how)))
    return [card for _, card in sorted(placed, key=lambda each: each[0])]


def _table_card(state: LiveState, train: str, name: str, how: TableCard | None) -> Card:
    table = state.tables[name]
    group = CardGroup.OTHER if how is None else how.group
    if how is None:
        title = " ".join(name.strip("/").split("/")[1:]).replace("_", " ")
    else:
        title = how.title.format(**how.topic.parts(name))
    row = _row_of(table, train)
    fitting = how if how is not None and how.fits(table) else None
    if not table.rows:
        item = "row" if fitting is None else fitting.item
        rows = [[item, "none in this tick", ""]]
    elif fitting is not None and fitting.rows is not None:
        rows = fitting.rows(state, train, row)
    else:
        rows = _plain_rows(table, train)
    if fitting is not None and fitting.gauge is not None:
        shown = fitting.gauge(state, train, table)
    else:
        shown = _position_gauge(state, train, table, row)
    return Card(title, name, table.stamp_ns, group, rows, shown)


def _row_of(table: Table, train: str) -> Mapping[str, float]:
    """The row of a train, or else the last one."""
    if not table.rows:
        return {}
    return table.row(train if train in table.rows else table.rows[-1])


def _plain_rows(table: Table, train: str) -> Rows:
    """All there is in a table, by the names of its columns."""
    names = [train] if train in table.rows else list(table.rows)
    prefixes = [f"{name} " if len(names) > 1 else "" for name in names]
    return [
        [f"{prefix}{shown.label}", shown.text, shown.unit]
        for prefix, name in zip(prefixes, names, strict=True)
        for shown in (shown_value(column, value) for column, value in table.row(name).items())
    ]


def _position_gauge(
    state: LiveState, train: str, table: Table, row: Mapping[str, float]
) -> Gauge | None:
    """Gauge of a table with a place and how sure it is, by the names of its columns."""
    place_m = next((row[column] for column in _PLACES if column in row), math.nan)
    spread = next((spread for spread in _SPREADS if spread[0] in row), None)
    if spread is None or not math.isfinite(place_m):
        return None
    column, half_width, what = spread
    # What is reported later is of the time that it names.
    stamp_ns = seconds_to_ns(row["time_s"]) if "time_s" in row else table.stamp_ns
    true = state.true_place(train, stamp_ns)
    return gauge(None if true is None else place_m - true[1], half_width(row[column]), what)


def _shown(state: LiveState, card: Card, writers: Writers, stale_s: float) -> dict[str, Any]:
    age_s = max(0.0, (state.now_ns - card.stamp_ns) * 1e-9)
    status = "ok" if age_s <= stale_s else "stale"
    return {
        "title": card.title,
        "topic": card.topic,
        "age_s": round(age_s, 2),
        "state": "gone" if writers(card.topic) == 0 else status,
        "rows": card.rows,
        "gauge": None if card.gauge is None else card.gauge.shown(),
    }
