"""The train radio on the live page: links, authorities, reports, base stations, telegrams."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rail_corridor.equipment.live import LiveView, SymbolReader
from rail_corridor.equipment.live_elements import (
    CardGroup,
    LineRow,
    LogEntry,
    Mark,
    PanelSpec,
    Rows,
    TableCard,
    TrainRow,
    Writers,
)
from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.topics.train_radio import (
    ATP_STATE,
    AUTHORITY,
    CBTC_BASE_TX,
    DOWN_TELEGRAMS,
    RADIO_LINK,
    RADIO_TELEGRAMS,
    REPORTS,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)

from .telegram_reader import TelegramReader


class TrainRadioView(LiveView):
    """What the train radio shows."""

    overview = (ATP_STATE, AUTHORITY)
    events = (TRAIN_TELEGRAMS, RADIO_TELEGRAMS, DOWN_TELEGRAMS, UP_TELEGRAMS)
    panel = PanelSpec(
        "telegrams",
        "Telegrams",
        "This corridor has no train radio; “rail run moving_block --rate 1” is one that has.",
        log=True,
        note="Contents as sent, unchecked: the viewer has no keys. One telegram is seen up to four "
        "times on its way.",
    )

    tables = (
        TableCard(RADIO_LINK, "Train radio link", CardGroup.RECEPTION),
        TableCard(
            REPORTS,
            "Location report (taken by the zone controller)",
            CardGroup.SUPERVISION,
            lambda state, _train, row: report_rows(row, state.tracks),
            item="report",
        ),
        TableCard(ATP_STATE, "Train protection (ATP)", CardGroup.SUPERVISION),
        TableCard(AUTHORITY, "Authority given (zone controller)", CardGroup.SUPERVISION),
    )

    def train_row(self, state: LiveState, train: str, writers: Writers) -> TrainRow:
        """End of the authority that the train holds, and its age."""
        row = state.row(ATP_STATE.name(train=train))
        if not row:
            return TrainRow()
        end_m, age_s = row["end_of_authority_m"], row["authority_age_s"]
        return TrainRow(
            authority_end_m=round(end_m, 1) if math.isfinite(end_m) else None,
            values={"authority_age_s": round(age_s, 1) if math.isfinite(age_s) else None},
        )

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Base stations."""
        marks = tuple(
            Mark(each["name"], each["track"], each["at_m"], CBTC_BASE_TX.owner(base=each["name"]))
            for each in line.get("bases", ())
        )
        return (LineRow("bases", "base station", marks, symbol="triangle"),) if marks else ()

    def has_log(self, line: Mapping[str, Any]) -> bool:
        """Whether there are base stations."""
        return bool(line.get("bases"))

    def log_entries(self, line: Mapping[str, Any], name: str, raw: bytes) -> Iterable[LogEntry]:
        """Telegrams of a message in words."""
        trains = [train["name"] for train in line.get("trains", ())]
        tracks = [track["name"] for track in line.get("tracks", ())]
        return TelegramReader(trains, tracks).entries(name, raw)

    def symbol_reader(self, line: Mapping[str, Any]) -> SymbolReader | None:
        """Reader of the bursts."""
        if not line.get("bursts"):
            return None
        from .symbols import BurstReader  # brings much of SciPy, which takes time to load

        return BurstReader(line["bursts"])


def report_rows(row: Mapping[str, float], tracks: Sequence[str]) -> Rows:
    """A location report that the zone controller has taken."""
    if not row["position_valid"] > 0.0:
        return [["position", "not known", ""]]
    segment = int(row["segment"])
    track = tracks[segment] if 0 <= segment < len(tracks) else f"segment {segment}"
    return [
        ["front", f"{row['offset_m']:.2f} ± {row['uncertainty_m']:.2f}", f"m on {track}"],
        ["speed", f"{3.6 * row['speed_mps']:.1f}".replace("-", "−"), "km/h"],
        ["length", f"{row['length_m']:.0f}", "m"],
        ["integrity", "confirmed" if row["integrity_confirmed"] > 0.0 else "not confirmed", ""],
        ["sealed at", f"{row['sealed_s']:.2f}", "s"],
    ]
