"""Phase ranging on the live page: measured positions, ranges, channels, zones and stations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rail_corridor.equipment.column_text import shown_value
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import (
    Card,
    CardGroup,
    LineRow,
    Mark,
    Rows,
    TableCard,
    TrackStretch,
    TrainCell,
    TrainColumn,
    TrainRow,
    Writers,
    gauge,
)
from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.topics.ranging import POSITION, RANGE, VRS_CHANNEL

#: Ranges are shown of a zone from this far before it until this far behind it.
_AROUND_M: Final = 20.0


class RangingView(LiveView):
    """What phase ranging shows."""

    overview = (POSITION, VRS_CHANNEL)
    position_topic = POSITION
    position_label = "phase ranging"
    columns = (TrainColumn("channels", "channels", always=True),)
    introduction = (
        "A railway line whose trains are located by radio. Wayside stations (wrs) stand along it; "
        "each watches the zone up to the next one and talks with the train in it on the zone’s "
        "pair of channels. Neighbouring zones use different pairs, so a train changes its channels "
        "as it goes.",
        "The position of a train is measured, from the phase of a tone that goes to the train and "
        "back. The page shows what was measured and how sure the equipment says it is (± 2σ: the "
        "truth should lie inside 95 % of the time), and beside it the truth, which only the "
        "simulation knows. “off the truth” is the measured position minus the true one.",
    )

    tables = (
        TableCard(
            VRS_CHANNEL,
            "Channel pair (VRS)",
            CardGroup.RECEPTION,
            lambda _state, _train, row: channel_rows(row),
        ),
    )

    def details(self, state: LiveState, train: str) -> Iterable[str]:
        """Ranges of the zone of a train and of those next to it."""
        return near_ranges(state, train)

    def cards(self, state: LiveState, train: str) -> Iterable[Card]:
        """The measured position, and the ranges near it."""
        card = _position_card(state, train)
        return [*([] if card is None else [card]), *_range_cards(state, train)]

    def train_row(self, state: LiveState, train: str, writers: Writers) -> TrainRow:
        """Channels in force."""
        row = state.row(VRS_CHANNEL.name(train=train))
        down, up = (int(row.get(column, 0.0)) for column in ("downlink", "uplink"))
        if not down:
            return TrainRow()
        return TrainRow({"channels": TrainCell(f"CH{down}/{up}", group=down)})

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Zones in the colours of their channel pairs, and the stations that watch them."""
        zones = line.get("zones", ())
        stretches = tuple(
            TrackStretch(
                zone["name"],
                zone["track"],
                zone["start_m"],
                zone["end_m"],
                zone["downlink"],
                f"CH{zone['downlink']}/{zone['uplink']}",
            )
            for zone in zones
        )
        return (LineRow("zones", "zone on", _marks(line), stretches, on_track=True),)


def near_ranges(state: LiveState, train: str) -> list[str]:
    """Topics of the ranges that matter to a train: of its zone and of those next to it."""
    measured = state.position(train)
    if measured is not None and measured.known:
        track, chainage_m = measured.track, measured.chainage_m
    else:
        true = state.true_row(train)
        if true is None or not state.tracks:
            return []
        track, chainage_m = state.tracks[int(true["track_index"])], true["chainage_m"]
    return [
        RANGE.name(site=zone["station"], zone=zone["name"])
        for zone in state.line.get("zones", ())
        if zone["track"] == track
        and zone["start_m"] - _AROUND_M <= chainage_m < zone["end_m"] + _AROUND_M
    ]


def channel_rows(row: Mapping[str, float]) -> Rows:
    """Channels in force, and what is received on each."""
    down, up = int(row.get("downlink", 0.0)), int(row.get("uplink", 0.0))
    rows = [["in force", f"CH{down} / CH{up}" if down else "none", ""]]
    for column, value in row.items():
        if column.startswith("level_"):
            shown = shown_value(column, value)
            label = f"heard on CH{column.split('_')[1]}"
            rows.append([label, shown.text if shown.unit else "nothing", shown.unit])
    return rows


def _position_card(state: LiveState, train: str) -> Card | None:
    measured = state.position(train)
    if measured is None:
        return None
    rows = [["position", "not known", ""]]
    shown = None
    track, chainage_m = measured.track, measured.chainage_m
    if measured.known:
        sigma_m = math.sqrt(measured.variance_m2)
        rows = [
            ["chainage", f"{chainage_m:.2f}", f"m on {track}"],
            ["sigma", f"{sigma_m:.2f}", "m"],
            ["speed", f"{3.6 * measured.speed_mps:.1f}", "km/h"],
        ]
        off_m = state.error_m(train, track, chainage_m, measured.stamp_ns)
        shown = gauge(off_m, 2.0 * sigma_m, "2σ")
    elif track:
        rows.append(["last known", f"{chainage_m:.1f}", "m"])
    return Card(
        "Phase ranging (zone controller)",
        POSITION.name(train=train),
        measured.stamp_ns,
        CardGroup.WAYSIDE_POSITION,
        rows,
        shown,
    )


def _range_cards(state: LiveState, train: str) -> Iterable[Card]:
    for name in near_ranges(state, train):
        reading = state.reading(name, RangeReading)
        if reading is None:
            continue
        if reading.usable:
            sigma_m = math.sqrt(reading.variance_m2)
            rows = [["range", f"{reading.range_m:.2f} ± {sigma_m:.2f}", "m"]]
        else:
            rows = [["range", "disturbed" if reading.disturbed else "no signal", ""]]
        title = f"Range by {RANGE.parts(name)['site']}, {reading.zone}"
        yield Card(title, name, reading.stamp_ns, CardGroup.WAYSIDE_POSITION, rows)


def _marks(line: Mapping[str, Any]) -> tuple[Mark, ...]:
    """Stations on the track they stand at, and where they begin to watch another one."""
    starts: dict[tuple[str, str], float] = {}
    for zone in line.get("zones", ()):
        starts.setdefault((zone["station"], zone["track"]), zone["start_m"])
    marks = []
    for track in line.get("tracks", ()):
        for station in line.get("stations", ()):
            name, node = station["name"], f"/wayside/{station['name']}"
            if station["track"] == track["name"]:
                x_m, y_m = station["position_m"][:2]
                marks.append(Mark(name, track["name"], station["at_m"], node, (x_m, y_m)))
            elif (name, track["name"]) in starts:
                marks.append(Mark(name, track["name"], starts[name, track["name"]], node))
    return tuple(marks)
