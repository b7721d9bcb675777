"""The kill campaign in short: equipment dies, and no train is in danger."""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING

import pytest

from rail_corridor.run.kills import Kill
from rail_corridor.studies.kill_scenarios import draw_case
from rail_corridor.studies.kills import row_of

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system

DURATION_S, KILLED_S = 22.0, 8.0


@pytest.mark.parametrize("node", ["/wayside/zone_controller", "/second/atp"])
def test_no_train_is_in_danger_when_equipment_dies(rail: Rail, node: str) -> None:
    case = dataclasses.replace(draw_case(3), kill=Kill(node, KILLED_S))
    path = rail.directory / "run.yaml"
    path.write_text(json.dumps(case.data | {"duration_s": DURATION_S, "faults": []}))
    report = rail.report(path, "--processes", "one", "--timeout", 5, "--kill", f"{node}@{KILLED_S}")
    row = row_of(case, report)
    # This run is shorter than those of the campaign; it went on to its own end.
    assert report["complete"] and report["ticks"] == round(DURATION_S / 0.25)
    assert set(row.violations) <= {"did not go on"}
    assert row.given_up == (node,)
    assert row.least_gap_m > 5.0 and row.shortest_m > 1.0
