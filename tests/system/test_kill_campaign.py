"""The kill campaign in short: equipment dies, and no train is in danger."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import pytest

from rail_corridor.run.kills import Kill
from rail_corridor.studies.kill_scenarios import draw_case
from rail_corridor.studies.kills import row_of

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

DURATION_S, KILLED_S = 22.0, 8.0


@pytest.mark.parametrize("node", ["/wayside/zone_controller", "/second/atp"])
def test_no_train_is_in_danger_when_equipment_dies(corridor: CorridorFactory, node: str) -> None:
    case = dataclasses.replace(draw_case(3), kill=Kill(node, KILLED_S))
    c = corridor(case.data | {"duration_s": DURATION_S, "faults": []})
    c.run_for(KILLED_S)
    c.kill(node)
    report = c.run_to_end().report
    row = row_of(case, report)
    # This run is shorter than those of the campaign; it went on to its own end.
    assert report["complete"] and report["ticks"] == round(DURATION_S / 0.25)
    assert set(row.violations) <= {"did not go on"}
    assert row.given_up == (node,)
    assert row.least_gap_m > 5.0 and row.shortest_m > 1.0
