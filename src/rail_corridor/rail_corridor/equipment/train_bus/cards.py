"""The train bus on the live page: its two ends, and what its reflectometer finds."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rail_corridor.equipment.column_text import shown_value
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import CardGroup, Rows, TableCard
from rail_corridor.equipment.live_state import LiveState
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_STATE

_LEVELS = ("well", "a fault that the bus still bears", "failed")


def _link_rows(_state: LiveState, _train: str, row: Mapping[str, float]) -> Rows:
    rows = [
        ["frames sent", f"{row['sent']:.0f}", ""],
        ["frames received", f"{row['received']:.0f}, {row['lost']:.0f} lost", ""],
        ["bit errors", f"{row['bit_errors']:.0f} of {row['bits']:.0f}", ""],
        ["Eb/N0", *shown_value("ebn0_db", row["ebn0_db"])[1:]],
    ]
    if math.isfinite(row["other_end"]):
        confirmed = "confirmed" if row["other_end"] > 0.0 else "not confirmed"
        rows.append(["other end of the train", confirmed, ""])
    return rows


def _state_rows(_state: LiveState, _train: str, row: Mapping[str, float]) -> Rows:
    # What counts the kinds brings SciPy, which takes time to load.
    from rail_signals.train_bus.faults import KINDS

    level, kind = int(row["level"]), int(row["kind"])
    rows = [["cable", _LEVELS[min(max(level, 0), 2)], ""]]
    if 1 <= kind <= len(KINDS):
        rows.append(["fault", KINDS[kind - 1].replace("_", " "), ""])
        place_m, half_m = row["place_m"], 2.0 * row["place_std_m"]
        if math.isfinite(place_m):
            half = f" ± {half_m:.1f}" if math.isfinite(half_m) else ""
            rows.append(["from the head", f"{place_m:.1f}{half}", "m of cable (2σ)"])
    return [
        *rows,
        ["measurements", f"{row['measurements']:.0f}", ""],
        ["interpretations", f"{row['interpretations']:.0f}", ""],
    ]


class TrainBusView(LiveView):
    """What the train bus shows."""

    tables = (
        TableCard(BUS_LINK, "Train bus, {end} end", CardGroup.VEHICLE, _link_rows),
        TableCard(BUS_STATE, "Train bus cable (reflectometer)", CardGroup.VEHICLE, _state_rows),
    )
