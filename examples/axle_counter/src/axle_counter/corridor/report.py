"""From a run to values: axles counted against axles that passed, sections against the truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from rich.table import Table

from axle_counter.signals.section_counter import Occupancy
from axle_counter.topics import PASSAGES, SECTIONS
from rail_corridor.equipment.tables import new_table
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.world import STATE

from .placement import layout_of
from .section import AXLE_COUNTERS
from .truth import AxlesOfTrain, as_counts

_UNCLEAR: Final = slice(PASSAGES.index["unclear"], PASSAGES.index["unclear"] + 1)


def axle_counter_metrics(scenario: Scenario, data: RunData) -> dict[str, Any]:
    """Section ``axle_counter`` of the report of a run; empty without axle counters.

    ``miscounts`` is the sum over points and ways of the difference between axles counted and axles
    that passed. ``free_while_occupied_ticks`` must be zero: the ticks in which a section was
    reported free while an axle was in it. What nobody reported counts as *not known*.
    """
    plan = AXLE_COUNTERS.of(scenario)
    if plan is None:
        return {}
    layout = layout_of(scenario)
    state = data[STATE].upto(data.ticks)
    occupied = np.zeros((data.ticks, len(layout.sections)), dtype=bool)
    true = np.zeros((len(layout.points), 2), dtype=np.int64)
    for index, train in enumerate(scenario.trains):
        there = state[:, index, STATE.index["on_line"]] > 0.0
        path_m = np.where(there, state[:, index, STATE.index["path_m"]], np.nan)
        axles = AxlesOfTrain(scenario, plan, train)
        occupied |= axles.inside(path_m)
        true += axles.passed(path_m)
    seen = data[PASSAGES].upto(data.ticks)
    points = {
        point.name: _point(true[index].tolist(), as_counts(seen[:, index, :2]))
        | {"unclear": as_counts(seen[:, index, _UNCLEAR])[0]}
        for index, point in enumerate(layout.points)
    }
    said = data[SECTIONS].upto(data.ticks)[:, :, SECTIONS.index["occupancy"]]
    sections = {
        section.name: {
            "free_while_occupied_ticks": _ticks(occupied[:, i] & (said[:, i] == Occupancy.FREE)),
            "occupied_while_free_ticks": _ticks(
                ~occupied[:, i] & (said[:, i] == Occupancy.OCCUPIED)
            ),
            "not_known_ticks": _ticks(
                (said[:, i] != Occupancy.FREE) & (said[:, i] != Occupancy.OCCUPIED)
            ),
        }
        for i, section in enumerate(layout.sections)
    }
    return {
        "axle_counter": {
            **_sums(points, "axles", "counted", "miscounts", "unclear"),
            **_sums(
                sections,
                *("free_while_occupied_ticks", "occupied_while_free_ticks", "not_known_ticks"),
            ),
            "points": points,
            "sections": sections,
        }
    }


def _point(true: list[int], counted: list[int]) -> dict[str, int]:
    return {
        "axles": sum(true),
        "counted": sum(counted),
        "miscounts": sum(abs(one - other) for one, other in zip(true, counted, strict=True)),
    }


def _ticks(which: Any) -> int:
    return int(np.count_nonzero(which))


def _sums(rows: Mapping[str, Mapping[str, int]], *names: str) -> dict[str, int]:
    return {name: sum(row[name] for row in rows.values()) for name in names}


def axle_counter_tables(report: Mapping[str, Any]) -> Iterator[Table]:
    """Tables of detection points and of sections; none without axle counters."""
    found = report.get("axle_counter")
    if found is None:
        return
    points = new_table(
        "axles at detection points", "point", "passed", "counted", "wrong", "unclear"
    )
    for name, row in found["points"].items():
        points.add_row(name, *(str(row[key]) for key in row))
    yield points
    sections = new_table(
        "sections of the axle counter, ticks reported",
        *("section", "free while occupied", "occupied while free", "not known"),
    )
    for name, row in found["sections"].items():
        sections.add_row(name, *(str(row[key]) for key in row))
    yield sections
