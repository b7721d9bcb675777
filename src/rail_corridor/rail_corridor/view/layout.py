"""What of the page depends on the equipment: rows of the line, columns of trains, tabs, words.

Sent once, and anew with every announcement.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from rail_corridor.equipment.live_elements import LineRow, PanelSpec
from rail_corridor.equipment.registry import live_views

from .history import traced


def layout(line: Mapping[str, Any]) -> dict[str, Any]:
    """Layout of the page for an announced line; empty before there is one."""
    views = live_views()
    panels = [(view, view.panel) for view in views if view.panel is not None]
    return {
        "rows": [_row(row) for view in views for row in view.line_rows(line)],
        "columns": [asdict(column) for view in views for column in view.columns],
        "panels": [asdict(panel) | {"there": view.has_log(line)} for view, panel in panels],
        "traces": [asdict(view.error_trace) for view in traced() if view.error_trace],
        "position_label": next((view.position_label for view in views if view.position_label), ""),
        "introduction": [text for view in views for text in view.introduction],
    }


def panel_of(tab: str) -> PanelSpec | None:
    """Panel of a tab, None if it is one that every corridor has."""
    found = (view.panel for view in live_views() if view.panel is not None)
    return next((panel for panel in found if panel.name == tab), None)


def _row(row: LineRow) -> dict[str, Any]:
    """A row without what it leaves empty, since a long line has many elements."""
    found = asdict(row)
    for key in ("marks", "stretches"):
        found[key] = [{k: v for k, v in each.items() if v not in (None, "")} for each in found[key]]
    return found
