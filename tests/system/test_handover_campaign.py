"""The handover campaign in short: the fastest trains, and trains that stand and turn back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rail_corridor.studies.handover import HandoverRow
from rail_corridor.studies.handover_scenarios import (
    CORRIDORS,
    MANOEUVRE_KMH,
    Situation,
    scenario_data,
)

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


@pytest.mark.parametrize(
    ("situation", "trains", "crossings", "options"),
    [
        *((Situation(corridor, "running", 500.0), 2, 20, {}) for corridor in CORRIDORS),
        (Situation("plain", "standing", MANOEUVRE_KMH), 1, 2, {"duration_s": 75.0}),
        (Situation("branching", "reversing", MANOEUVRE_KMH), 1, 2, {"duration_s": 75.0}),
    ],
    ids=lambda value: value.name if isinstance(value, Situation) else "",
)
def test_no_handover_is_missed_and_no_position_is_false(
    corridor: CorridorFactory,
    situation: Situation,
    trains: int,
    crossings: int,
    options: dict[str, float],
) -> None:
    data = scenario_data(situation, trains, seed=3) | options
    row = HandoverRow(situation)
    row.add(corridor(data).run_to_end().report)
    assert row.crossings >= crossings
    assert row.made == row.crossings
    assert row.violations == 0
    assert row.furthest_m <= 20.0
    assert row.availability > 0.99
