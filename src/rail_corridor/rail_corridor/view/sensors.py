"""What each sensor says about one train, as cards: generic for tables, nicer for known ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from rail_msgs_py.stamps import seconds_to_ns
from rail_msgs_py.table import Table
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_signals.track_code.scales import CodeScales

from .live_state import Picture
from .located import Located, located, off_the_truth
from .position_cards import localizer_rows, position_rows
from .units import Figure, figure
from .wanted import kind_of, of_train

#: Ending of a topic's name, title, place in the row of cards.
_TITLES = (
    ("/vrs/channel", "Channel pair (VRS)"),
    ("/track_code/message", "Track code on board"),
    ("/cbtc_radio/link", "Train radio link"),
    ("/doppler/fix", "Doppler positioning"),
    ("/localizer/state", "Localizer (on board, from all sensors)"),
    ("/atp/told_position", "Position told over the radio"),
    ("/reports", "Location report (taken by the zone controller)"),
    ("/atp/state", "Train protection (ATP)"),
    ("/authority", "Authority given (zone controller)"),
    ("/command", "Supervision commands"),
    ("/odometer", "Odometer"),
)
_PLACES = ("chainage_m", "front_m", "position_m", "along_m")
#: Column that says how sure a place is, and what makes it the half-width that is drawn.
_SPREADS: tuple[tuple[str, Callable[[float], float], str], ...] = (
    ("chainage_m2", lambda value: 2.0 * math.sqrt(value) if value >= 0.0 else math.nan, "2σ"),
    ("half_m", lambda value: value, "bound"),
    ("sigma_m", lambda value: 2.0 * value, "2σ"),
    ("variance_m2", lambda value: 2.0 * math.sqrt(value) if value >= 0.0 else math.nan, "2σ"),
    ("uncertainty_m", lambda value: value, "bound"),
)
#: An estimate older than so many ticks, and than a second, is stale.
_STALE_TICKS = 4


def cards(picture: Picture, train: str, writers: Callable[[str], int]) -> list[dict[str, Any]]:
    """Cards of one train.

    Parameters
    ----------
    picture : Picture
    train : str
    writers : callable
        Number of writers of a topic; 0 makes the card say that it has gone.
    """
    made = [_ranging(picture, train, writers), *_ranges(picture, train, writers)]
    names = [name for name in picture.tables if of_train(name) == train]
    for name in sorted(names, key=_order):
        made.append(_table_card(picture, train, name, writers))
    return [card for card in made if card is not None]


def _order(name: str) -> tuple[int, str]:
    places = [index for index, (ending, _) in enumerate(_TITLES) if name.endswith(ending)]
    return (places[0] if places else len(_TITLES), name)


def _ranging(picture: Picture, train: str, writers: Callable[[str], int]) -> dict[str, Any] | None:
    said = picture.positions.get(train)
    if said is None:
        return None
    topic = f"/wayside/zone_controller/{train}/position"
    stamp_ns, track, (chainage_m, variance_m2, speed_mps, _) = said
    card = _card(picture, "Phase ranging (zone controller)", topic, stamp_ns, writers)
    if not math.isfinite(variance_m2):
        card["rows"] = [["position", "not known", ""]]
        if track:
            card["rows"].append(["last known", f"{chainage_m:.1f}", "m"])
        return card
    sigma_m = math.sqrt(variance_m2)
    card["rows"] = [
        ["chainage", f"{chainage_m:.2f}", f"m on {track}"],
        ["sigma", f"{sigma_m:.2f}", "m"],
        ["speed", f"{3.6 * speed_mps:.1f}", "km/h"],
    ]
    card["gauge"] = _gauge(picture.error_m(train, track, chainage_m, stamp_ns), 2.0 * sigma_m, "2σ")
    return card


def _ranges(picture: Picture, train: str, writers: Callable[[str], int]) -> list[dict[str, Any]]:
    made = []
    for name in zone_topics(picture, train):
        reading = picture.ranges.get(name)
        if reading is None:
            continue
        station = name.split("/")[2]
        title = f"Range by {station}, {reading.zone}"
        card = _card(picture, title, name, reading.stamp_ns, writers)
        if reading.usable:
            sigma_m = math.sqrt(reading.variance_m2)
            card["rows"] = [["range", f"{reading.range_m:.2f} ± {sigma_m:.2f}", "m"]]
        else:
            card["rows"] = [["range", "disturbed" if reading.disturbed else "nothing heard", ""]]
        made.append(card)
    return made


def zone_topics(picture: Picture, train: str) -> list[str]:
    """Topics of the ranges that matter to a train: of its zone and of those next to it."""
    said = picture.positions.get(train)
    row = picture.true_row(train)
    if said is not None and math.isfinite(said[2][1]):
        track, chainage_m = said[1], said[2][0]
    elif row is not None and picture.tracks:
        track, chainage_m = picture.tracks[int(row["track_index"])], row["chainage_m"]
    else:
        return []
    zones = [zone for zone in picture.line.get("zones", ()) if zone["track"] == track]
    near = [
        index
        for index, zone in enumerate(zones)
        if zone["start_m"] - 20.0 <= chainage_m < zone["end_m"] + 20.0
    ]
    return [f"/wayside/{zones[i]['station']}/{zones[i]['name']}/range" for i in near]


def _table_card(
    picture: Picture, train: str, name: str, writers: Callable[[str], int]
) -> dict[str, Any]:
    table = picture.tables[name]
    title = next((text for ending, text in _TITLES if name.endswith(ending)), "")
    title = title or " ".join(name.strip("/").split("/")[1:]).replace("_", " ")
    card = _card(picture, title, name, table.stamp_ns, writers)
    row = table.row(train) if train in table.rows else _first(table)
    if name.endswith("/vrs/channel"):
        card["rows"] = _channels(row)
    elif name.endswith("/track_code/message"):
        card["rows"] = track_code(row)
    elif name == LOCALIZER_STATE.name(train=train) and (said := located(picture, train)):
        card["rows"] = localizer_rows(said)
        card["gauge"] = _interval(picture, train, said)
        return card
    elif (rows := position_rows(kind_of(name), table, picture.tracks)) is not None:
        card["rows"] = rows
    else:
        prefix = len(table.rows) > 1 and train not in table.rows
        card["rows"] = [
            [f"{label} {shown.label}" if prefix else shown.label, shown.text, shown.unit]
            for label, values in _rows_of(table, train)
            for shown in (figure(column, value) for column, value in values.items())
        ]
    place = next((row[column] for column in _PLACES if column in row), math.nan)
    for column, half_width, what in _SPREADS:
        if column in row and math.isfinite(place):
            # What is told later is of the time that it tells.
            told_ns = seconds_to_ns(row["time_s"]) if "time_s" in row else table.stamp_ns
            true = picture.true_place(train, told_ns)
            off_m = None if true is None else place - true[1]
            card["gauge"] = _gauge(off_m, half_width(row[column]), what)
            break
    return card


def _interval(picture: Picture, train: str, said: Located) -> dict[str, Any] | None:
    """Gauge of the localizer, whose interval need not be even to both sides."""
    off = off_the_truth(picture, train)
    if off is None:
        return None
    gauge = _gauge(off[0], said.protection_m, "protection level")
    ends = {"low_m": said.low_m - said.front_m, "high_m": said.high_m - said.front_m}
    return gauge and gauge | {name: round(value, 3) for name, value in ends.items()}


def _rows_of(table: Table, train: str) -> list[tuple[str, dict[str, float]]]:
    names = [train] if train in table.rows else list(table.rows)
    return [(name, table.row(name)) for name in names]


def _first(table: Table) -> dict[str, float]:
    return table.row(table.rows[0]) if table.rows else {}


def _channels(row: Mapping[str, float]) -> list[list[str]]:
    down, up = int(row.get("downlink", 0.0)), int(row.get("uplink", 0.0))
    rows = [["in force", f"CH{down} / CH{up}" if down else "none", ""]]
    for column, value in row.items():
        if column.startswith("level_"):
            shown = figure(column, value)
            label = f"heard on CH{column.split('_')[1]}"
            rows.append([label, shown.text if shown.unit else "nothing", shown.unit])
    return rows


def track_code(row: Mapping[str, float]) -> list[list[str]]:
    """A track code in words: what the fields stand for."""
    if not row.get("valid", 1.0) > 0.0 or not math.isfinite(row.get("word", math.nan)):
        shown = [["code", "none that can be read", ""]]
    else:
        fields = {name: int(row[name]) for name in ("speed", "gradient", "block_length")}
        code = CodeScales().read(fields)
        shown = [
            ["permitted", f"{3.6 * code.now_mps:.0f}", "km/h"],
            ["at its end", f"{3.6 * code.end_mps:.0f}", "km/h"],
            ["block", f"{code.length_m:.0f}", "m"],
            ["gradient", f"{code.gradient_permil:.0f}".replace("-", "−"), "‰"],
            ["word", f"{int(row['word']):027b}", ""],
        ]
    for column in ("carrier_hz", "level_db"):
        if math.isfinite(row.get(column, math.nan)):
            item: Figure = figure(column, row[column])
            shown.append([item.label, item.text, item.unit])
    return shown


def _card(
    picture: Picture, title: str, topic: str, stamp_ns: int, writers: Callable[[str], int]
) -> dict[str, Any]:
    age_s = max(0.0, (picture.now_ns - stamp_ns) * 1e-9)
    stale_s = max(1.0, _STALE_TICKS * float(picture.line.get("tick_s", 0.0)))
    state = "ok" if age_s <= stale_s else "stale"
    if writers(topic) == 0:
        state = "gone"
    return {
        "title": title,
        "topic": topic,
        "age_s": round(age_s, 2),
        "state": state,
        "rows": [],
        "gauge": None,
    }


def _gauge(off_m: float | None, half_m: float, what: str) -> dict[str, Any] | None:
    """How far an estimate is from the truth, against how sure it says it is."""
    if off_m is None or not (math.isfinite(off_m) and math.isfinite(half_m)):
        return None
    return {"off_m": round(off_m, 3), "half_m": round(half_m, 3), "what": what}
