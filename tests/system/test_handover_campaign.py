"""The handover campaign in short: the fastest trains, and trains that stand and turn back."""

from __future__ import annotations

import json
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
    from .conftest import Rail

pytestmark = pytest.mark.system


@pytest.mark.parametrize(
    ("situation", "trains", "crossings", "options"),
    [
        *((Situation(corridor, "running", 500.0), 2, 20, ()) for corridor in CORRIDORS),
        (Situation("plain", "standing", MANOEUVRE_KMH), 1, 2, ("--duration", 75)),
        (Situation("branching", "reversing", MANOEUVRE_KMH), 1, 2, ("--duration", 75)),
    ],
    ids=lambda value: value.name if isinstance(value, Situation) else "",
)
def test_no_handover_is_missed_and_no_position_is_false(
    rail: Rail, situation: Situation, trains: int, crossings: int, options: tuple[object, ...]
) -> None:
    path = rail.directory / "run.yaml"
    path.write_text(json.dumps(scenario_data(situation, trains, seed=3)))
    row = HandoverRow(situation)
    row.add(rail.report(path, "--processes", "one", *options))
    assert row.crossings >= crossings
    assert row.made == row.crossings
    assert row.violations == 0
    assert row.furthest_m <= 20.0
    assert row.availability > 0.99
