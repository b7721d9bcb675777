"""Track codes on the live page: codes on board and in the rails, circuits and their occupancy."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rail_corridor.equipment.column_text import shown_value
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import (
    CardGroup,
    ElementState,
    LineRow,
    Panel,
    PanelSpec,
    Rows,
    TableCard,
    TrackStretch,
)
from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.topics.track_code import CODE_RECEIVED, CODE_SENT, OCCUPANCY
from rail_signals.track_code.scales import SPEEDS_KMH, CodeScales

_ROW = "circuits"
_HEADINGS = (
    *(("circuit", ""), ("", ""), ("level", "dB")),
    *(("permitted", ""), ("at its end", ""), ("block", ""), ("gradient", "")),
)
#: Fields of a code that have columns of their own in the table of circuits.
_FIELDS = 4


class TrackCodeView(LiveView):
    """What track codes show."""

    overview = (OCCUPANCY, CODE_SENT)
    panel = PanelSpec(
        "codes",
        "Track codes",
        "This corridor has no track circuits; “rail run follow_codes --rate 1” is one that has.",
    )

    tables = (
        TableCard(
            CODE_RECEIVED,
            "Track code on board",
            CardGroup.RECEPTION,
            lambda state, _train, row: code_rows(row, state.line),
        ),
    )

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Track circuits."""
        circuits = tuple(
            TrackStretch(each["name"], each["track"], each["start_m"], each["end_m"])
            for each in line.get("circuits", ())
        )
        return (LineRow(_ROW, "track circuit occupied", stretches=circuits),) if circuits else ()

    def states(self, state: LiveState) -> Mapping[str, Mapping[str, ElementState]]:
        """Which circuits are occupied."""
        return {
            _ROW: {
                circuit["name"]: ElementState("occupied")
                for circuit in state.line.get("circuits", ())
                if _occupied(state, circuit["name"])
            }
        }

    def panel_contents(self, state: LiveState, train: str) -> Panel | None:
        """What the train decodes, and what circuits send."""
        names = [circuit["name"] for circuit in state.line.get("circuits", ())]
        if not names:
            return None
        return Panel(
            f"Decoded on board of {train}",
            (CODE_RECEIVED.name(train=train),),
            "Sent by the circuits",
            _HEADINGS,
            tuple(_circuit_row(state, name) for name in names),
            tuple(bool(_occupied(state, name)) for name in names),
        )


def code_rows(row: Mapping[str, float], line: Mapping[str, Any]) -> Rows:
    """A track code in words: what the fields stand for."""
    if not row.get("valid", 1.0) > 0.0 or not math.isfinite(row.get("word", math.nan)):
        rows = [["code", "none that can be read", ""]]
    else:
        fields = {name: int(row[name]) for name in ("speed", "gradient", "block_length")}
        speeds = tuple(line.get("code_speeds_kmh", ())) or SPEEDS_KMH
        code = CodeScales(speeds_kmh=speeds).read(fields)
        rows = [
            ["permitted", f"{3.6 * code.now_mps:.0f}", "km/h"],
            ["at its end", f"{3.6 * code.end_mps:.0f}", "km/h"],
            ["block", f"{code.length_m:.0f}", "m"],
            ["gradient", f"{code.gradient_permil:.0f}".replace("-", "−"), "‰"],
            ["word", f"{int(row['word']):027b}", ""],
        ]
    for column in ("carrier_hz", "level_db"):
        if math.isfinite(row.get(column, math.nan)):
            rows.append(list(shown_value(column, row[column])))
    return rows


def _occupied(state: LiveState, circuit: str) -> bool | None:
    """Whether a circuit is occupied, None if nothing has been received of it."""
    row = state.row(OCCUPANCY.name(circuit=circuit))
    return row["occupied"] > 0.0 if "occupied" in row else None


def _circuit_row(state: LiveState, circuit: str) -> tuple[tuple[str, str], ...]:
    level_db = state.row(OCCUPANCY.name(circuit=circuit)).get("level_db", math.nan)
    sent = state.row(CODE_SENT.name(circuit=circuit))
    code = code_rows(sent, state.line) if sent else []
    fields = [(text, unit) for _, text, unit in code[:_FIELDS]] if len(code) >= _FIELDS else []
    occupied = _occupied(state, circuit)
    return (
        (circuit, ""),
        ("not received" if occupied is None else "occupied" if occupied else "clear", ""),
        (f"{level_db:.1f}".replace("-", "−") if math.isfinite(level_db) else "–", ""),
        *(fields or [("no code sent", "")]),
    )
