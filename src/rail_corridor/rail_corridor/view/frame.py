"""One message to a browser: everything that has changed since it last asked, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

from rail_corridor.equipment.live_elements import Writers
from rail_corridor.equipment.registry import live_views
from rail_msgs_py.topics.world import COMMAND
from rail_msgs_py.waveform import Waveform

from .layout import panel_of
from .live_state import LiveStateStore, position_topics
from .scope import scope
from .sensors import cards
from .wanted import kind_of

#: An estimate that is older is drawn beside the truth of the present.
_FRESH_NS = 1_000_000_000
#: The strongest first: each brings the ones behind it.
_BRAKES = ("emergency_brake", "service_brake", "warning")


@dataclass(frozen=True)
class Asked:
    """What a browser looks at, and what it has already.

    Parameters
    ----------
    train, tab : str
        Selected train, and part of the page that is open.
    run, generation, rows : int
        Line and history that it has.
    health, lists, telegrams : int
        Versions that it has.
    scope : str
        Topic of the scope.
    antenna, zoom : int
        Of the scope.
    """

    train: str = ""
    tab: str = ""
    run: int = -1
    generation: int = -1
    rows: int = 0
    health: int = -1
    lists: int = -1
    telegrams: int = 0
    scope: str = ""
    antenna: int = 0
    zoom: int = 1


@dataclass(frozen=True)
class Lists:
    """What there is to choose from: waveform topics, equipment that can be switched."""

    version: int = 0
    waveforms: tuple[str, ...] = ()
    equipment: tuple[str, ...] = ()


def frame(
    state: LiveStateStore, asked: Asked, lists: Lists, writers: Writers, wall_s: float
) -> dict[str, Any]:
    """The message, ready for JSON; a number that is not finite is None."""
    health = state.health
    commands = {t: n for n in sorted(state.tables) if (t := _commanded(n))}
    message: dict[str, Any] = {
        "run": state.run,
        "status": state.status(wall_s),
        "t": round(state.now_s, 3),
        "rate": _rounded(state.rate(), 2),
        "silent_s": round(state.silent_s(wall_s), 1),
        "trains": [_train(state, n, writers, commands.get(n)) for n in state.trains],
        "states": _states(state),
        "off": [node for node in lists.equipment if health.switched_off(node)],
        "failed": sorted(health.failed()),
        "counts": health.counts(),
    }
    if asked.run != state.run:
        message["line"] = state.drawn()
    begin, rows = state.history.since(asked.generation, asked.rows)
    message["history"] = {
        "generation": state.history.generation,
        "begin": begin,
        "rows": rows,
    }
    if asked.train in state.trains:
        message["cards"] = cards(state, asked.train, writers)
        message["diagnostics"] = health.of(f"/{asked.train}")
    if asked.lists != lists.version:
        message["lists"] = {
            "version": lists.version,
            "waveforms": lists.waveforms,
            "equipment": lists.equipment,
        }
    if asked.tab == "health" and asked.health != health.version:
        message["health"] = health.shown()
    if (panel := panel_of(asked.tab)) is not None and panel.log:
        message["telegrams"] = state.log(panel.name).since(asked.telegrams)
    elif panel is not None:
        message["panel"] = _panel(state, asked)
    if asked.tab == "scope" and asked.scope:
        message["scope"] = _scope(state, asked, writers)
    return message


def _train(
    state: LiveStateStore, name: str, writers: Writers, command: str | None
) -> dict[str, Any]:
    shown = _place(state, name, writers) | {"cells": {}}
    if command is not None:
        shown |= _supervised(state.row(command))
    for view in live_views():
        row = view.train_row(state, name, writers)
        shown |= row.values
        shown["cells"] |= {
            key: [cell.text, cell.tone, cell.note, cell.group] for key, cell in row.cells.items()
        }
        if row.interval is not None:
            shown.setdefault("intervals", []).append(asdict(row.interval))
        if row.authority_end_m is not None:
            shown["end_m"] = row.authority_end_m
    return shown


def _place(state: LiveStateStore, name: str, writers: Writers) -> dict[str, Any]:
    """Where a train is, and where it was measured."""
    row, measured = state.true_row(name), state.position(name)
    shown: dict[str, Any] = {"name": name, "on": row is not None and row["on_line"] > 0.0}
    if row is not None:
        # Beside an estimate stands the truth of its own tick: a tick is some metres of travel.
        stamp_ns = -1 if measured is None else measured.stamp_ns
        fresh = stamp_ns in state.truth and stamp_ns + _FRESH_NS > state.now_ns
        place = state.true_place(name, stamp_ns if fresh else state.now_ns)
        shown["true"] = None if place is None else [place[0], round(place[1], 3)]
        shown["speed_kmh"] = round(3.6 * row["speed_mps"], 1)
    if measured is None:
        return shown
    known, track, at_m = measured.known, measured.track, measured.chainage_m
    error_m = state.error_m(name, track, at_m, measured.stamp_ns) if known else None
    return shown | {
        "track": track,
        "at_m": _rounded(at_m, 3),
        "sigma_m": _rounded(math.sqrt(measured.variance_m2), 3) if known else None,
        "said_kmh": _rounded(3.6 * measured.speed_mps, 1) if known else None,
        "known": known,
        "age_s": round(max(0.0, (state.now_ns - measured.stamp_ns) * 1e-9), 2),
        "gone": not any(writers(topic) for topic in position_topics(name)),
        "error_m": _rounded(error_m, 3),
    }


def _commanded(topic: str) -> str:
    """Train that a topic carries commands of supervision for, whichever that is; else empty."""
    return COMMAND.parts(topic)["train"] if kind_of(topic) is COMMAND else ""


def _supervised(command: Mapping[str, float]) -> dict[str, Any]:
    """What supervision on board permits and demands."""
    if "permitted_mps" not in command:
        return {}
    return {
        "permitted_kmh": _rounded(3.6 * command["permitted_mps"], 0),
        "brake": next((b for b in _BRAKES if command.get(b, 0.0) > 0.0), ""),
    }


def _states(state: LiveStateStore) -> dict[str, dict[str, list[Any]]]:
    """States of the marks and stretches of the line, by row and name."""
    return {
        row: {name: [each.word, each.active, each.tone] for name, each in elements.items()}
        for view in live_views()
        for row, elements in view.states(state).items()
    }


def _panel(state: LiveStateStore, asked: Asked) -> dict[str, Any] | None:
    view = next(view for view in live_views() if view.panel and view.panel.name == asked.tab)
    contents = view.panel_contents(state, asked.train)
    return None if contents is None else asdict(contents)


def _scope(state: LiveStateStore, asked: Asked, writers: Writers) -> dict[str, Any]:
    raw = state.blocks.get(asked.scope)
    known = {"topic": asked.scope, "writers": writers(asked.scope)}
    if raw is None:
        if asked.scope in state.tables:
            return known | {"problem": "carries a table, not a waveform"}
        return known | {"problem": "nothing received yet"}
    try:
        block = Waveform.from_cdr(raw)
    except ValueError as error:
        return known | {"problem": str(error)}
    return known | scope(block, asked.antenna, asked.zoom, state.symbol_readers)


def _rounded(value: float | None, digits: int) -> float | None:
    return round(value, digits) if value is not None and math.isfinite(value) else None
