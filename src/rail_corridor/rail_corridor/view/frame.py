"""One message to a browser: everything that has changed since it last asked, and nothing else."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.waveform import Waveform

from . import located
from .live_state import Picture
from .scope import scope
from .sensors import cards, track_code

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
    picture: Picture, asked: Asked, lists: Lists, writers: Callable[[str], int], wall_s: float
) -> dict[str, Any]:
    """The message, ready for JSON; a figure that is not finite is None."""
    health = picture.health
    message: dict[str, Any] = {
        "run": picture.run,
        "status": picture.status(wall_s),
        "t": round(picture.now_s, 3),
        "rate": _rounded(picture.rate(), 2),
        "silent_s": round(picture.silent_s(wall_s), 1),
        "trains": [_train(picture, name, writers) for name in picture.trains],
        "circuits": _circuits(picture, detail=asked.tab == "codes"),
        "off": [node for node in lists.equipment if health.switched_off(node)],
        "failed": sorted(health.failed()),
        "counts": health.counts(),
    }
    if asked.run != picture.run:
        message["line"] = picture.drawn()
    begin, rows = picture.history.since(asked.generation, asked.rows)
    message["history"] = {
        "generation": picture.history.generation,
        "begin": begin,
        "rows": rows,
    }
    if asked.train in picture.trains:
        message["cards"] = cards(picture, asked.train, writers)
        message["diagnostics"] = health.of(f"/{asked.train}")
    if asked.lists != lists.version:
        message["lists"] = {
            "version": lists.version,
            "waveforms": lists.waveforms,
            "equipment": lists.equipment,
        }
    if asked.tab == "health" and asked.health != health.version:
        message["health"] = health.shown()
    if asked.tab == "telegrams":
        message["telegrams"] = picture.telegrams.since(asked.telegrams)
    if asked.tab == "scope" and asked.scope:
        message["scope"] = _scope(picture, asked, writers)
    return message


def _train(picture: Picture, name: str, writers: Callable[[str], int]) -> dict[str, Any]:
    row = picture.true_row(name)
    shown: dict[str, Any] = {"name": name, "on": row is not None and row["on_line"] > 0.0}
    said = picture.positions.get(name)
    if row is not None:
        # Beside an estimate stands the truth of its own tick: a tick is some metres of travel.
        fresh = (
            said is not None and said[0] in picture.truth and said[0] + _FRESH_NS > picture.now_ns
        )
        place = picture.true_place(name, said[0] if fresh and said else picture.now_ns)
        shown["true"] = None if place is None else [place[0], round(place[1], 3)]
        shown["speed_kmh"] = round(3.6 * row["speed_mps"], 1)
    if said is not None:
        stamp_ns, track, (chainage_m, variance_m2, speed_mps, _) = said
        known = math.isfinite(variance_m2)
        shown |= {
            "track": track,
            "at_m": _rounded(chainage_m, 3),
            "sigma_m": _rounded(math.sqrt(variance_m2), 3) if known else None,
            "said_kmh": _rounded(3.6 * speed_mps, 1) if known else None,
            "known": known,
            "age_s": round(max(0.0, (picture.now_ns - stamp_ns) * 1e-9), 2),
            "gone": writers(f"/wayside/zone_controller/{name}/position") == 0,
            "error_m": _rounded(picture.error_m(name, track, chainage_m, stamp_ns), 3)
            if known
            else None,
        }
    channel = _table_row(picture, f"/{name}/vrs/channel")
    if channel:
        shown["down"], shown["up"] = (int(channel.get(c, 0.0)) for c in ("downlink", "uplink"))
    for supervision in ("atp", "code_supervision"):
        command = _table_row(picture, f"/{name}/{supervision}/command")
        if command:
            shown["permitted_kmh"] = _rounded(3.6 * command["permitted_mps"], 0)
            shown["brake"] = next((b for b in _BRAKES if command.get(b, 0.0) > 0.0), "")
    on_board = located.shown(picture, name, gone=writers(LOCALIZER_STATE.name(train=name)) == 0)
    if on_board is not None:
        shown["located"] = on_board
    protection = _table_row(picture, f"/{name}/atp/state")
    if protection:
        shown["end_m"] = _rounded(protection["end_of_authority_m"], 1)
        shown["authority_age_s"] = _rounded(protection["authority_age_s"], 1)
    return shown


def _circuits(picture: Picture, *, detail: bool) -> list[dict[str, Any]]:
    """Track circuits: whether occupied, and with ``detail`` what they send."""
    made = []
    for circuit in picture.line.get("circuits", ()):
        name = circuit["name"]
        sensed = _table_row(picture, f"/wayside/{name}/track_code/occupancy")
        shown: dict[str, Any] = {
            "name": name,
            "occupied": None if not sensed else bool(sensed["occupied"] > 0.0),
        }
        if detail:
            sent = _table_row(picture, f"/wayside/{name}/track_code/message")
            shown["level_db"] = _rounded(sensed.get("level_db"), 1)
            shown["code"] = track_code(sent) if sent else [["code", "not heard of", ""]]
        made.append(shown)
    return made


def _scope(picture: Picture, asked: Asked, writers: Callable[[str], int]) -> dict[str, Any]:
    raw = picture.blocks.get(asked.scope)
    known = {"topic": asked.scope, "writers": writers(asked.scope)}
    if raw is None:
        if asked.scope in picture.tables:
            return known | {"problem": "carries a table, not a waveform"}
        return known | {"problem": "nothing received yet"}
    try:
        block = Waveform.from_cdr(raw)
    except ValueError as error:
        return known | {"problem": str(error)}
    return known | scope(block, asked.antenna, asked.zoom, picture.bursts)


def _table_row(picture: Picture, topic: str) -> Mapping[str, float]:
    table = picture.tables.get(topic)
    return table.row(table.rows[0]) if table is not None and table.rows else {}


def _rounded(value: float | None, digits: int) -> float | None:
    return round(value, digits) if value is not None and math.isfinite(value) else None
