"""Axle counters on the live page: a row of the line, with detection points and sections."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from axle_counter.signals.section_counter import Occupancy
from axle_counter.topics import SECTIONS
from rail_corridor.equipment.live import LiveView
from rail_corridor.equipment.live_elements import ElementState, LineRow, Mark, TrackStretch
from rail_corridor.equipment.live_state import LiveState

_ROW: Final = "axle counter"
_STATES: Final = {
    Occupancy.OCCUPIED: ElementState("occupied"),
    Occupancy.NOT_KNOWN: ElementState("not known", tone="warned"),
}


class AxleCounterView(LiveView):
    """What axle counters show."""

    overview = (SECTIONS,)

    def line_rows(self, line: Mapping[str, Any]) -> Sequence[LineRow]:
        """Detection points, and the sections between them."""
        layout = line.get("axle_counter")
        if not layout:
            return ()
        marks = (
            Mark(p["name"], p["track"], p["at_m"], f"/wayside/{p['name']}/wheel_sensor")
            for p in layout["points"]
        )
        stretches = (
            TrackStretch(section["name"], span["track"], span["start_m"], span["end_m"])
            for section in layout["sections"]
            for span in section["spans"]
        )
        return (LineRow(_ROW, "section occupied", tuple(marks), tuple(stretches)),)

    def states(self, state: LiveState) -> Mapping[str, Mapping[str, ElementState]]:
        """Sections that are not free."""
        table = state.tables.get(SECTIONS.name())
        if table is None or table.columns != SECTIONS.columns:
            return {}
        said = table.values[:, SECTIONS.index["occupancy"]].tolist()
        pairs = zip(table.rows, said, strict=True)
        return {_ROW: {name: _STATES[Occupancy(int(s))] for name, s in pairs if s in _STATES}}
