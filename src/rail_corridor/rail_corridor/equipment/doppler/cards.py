"""Doppler positioning on the live page: positions by Doppler shifts, reference stations."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rail_corridor.equipment.column_text import shown_value
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import CardGroup, LineRow, Mark, Rows, TableCard
from rail_msgs_py.topics.doppler import DOPPLER_FIX, REFERENCE_TX


class DopplerView(LiveView):
    """What Doppler positioning shows."""

    tables = (
        TableCard(
            DOPPLER_FIX,
            "Doppler positioning",
            CardGroup.ONBOARD_POSITION,
            lambda _state, _train, row: fix_rows(row),
        ),
    )

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Reference stations."""
        marks = tuple(
            Mark(
                each["name"],
                each["track"],
                each["at_m"],
                REFERENCE_TX.owner(station=each["name"]),
            )
            for each in line.get("references", ())
        )
        row = LineRow("references", "reference station (Doppler)", marks, symbol="diamond")
        return (row,) if marks else ()


def fix_rows(row: Mapping[str, float]) -> Rows:
    """A position by Doppler shifts, or why there is none."""
    reason, tones = int(row["reason"]), ["tones found", f"{row['tones']:.0f}", ""]
    if reason or not math.isfinite(row["chainage_m"]):
        from rail_signals.doppler.solver import (
            NoFixReason,
        )  # brings SciPy, which takes time to load

        names = {int(member): member.name for member in NoFixReason}
        why = names.get(reason, f"reason {reason}").lower().replace("_", " ")
        return [["position", f"none: {why}", ""], tones]
    sigma_m, sigma_mps = (math.sqrt(row[column]) for column in ("chainage_m2", "speed_m2ps2"))
    offset = shown_value("offset_hz", row["offset_hz"])
    return [
        ["position", f"{row['chainage_m']:.2f} ± {2.0 * sigma_m:.2f}", "m (2σ)"],
        [
            "speed",
            f"{3.6 * row['speed_mps']:.2f} ± {7.2 * sigma_mps:.2f}".replace("-", "−"),
            "km/h",
        ],
        tones,
        ["offset of the receiver", offset.text, offset.unit],
    ]
