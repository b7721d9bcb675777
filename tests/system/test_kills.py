"""The study of kills in short: equipment dies, and no train is in danger."""

from __future__ import annotations

import pytest

from rail_corridor.loading.schema import parse_scenario
from rail_corridor.run.kills import Kill
from rail_corridor.studies.kills import KillParameters, draw_kill, look_at_kill
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.studies.safety.judgement import judge_safety
from rail_corridor.study.corridor_run import run_corridor
from rail_corridor.study.sources import Drawn, found
from rail_corridor.study.study_file import load_study

DURATION_S, KILLED_S = 22.0, 8.0


@pytest.mark.parametrize("node", ["/wayside/zone_controller", "/second/atp"])
def test_no_train_is_in_danger_when_equipment_dies(node: str) -> None:
    drawn = draw_kill(KillParameters(), 3)
    study, _ = load_study("kills", FOLDER, GENERATORS, CALCULATIONS)
    data = drawn.data | {"duration_s": DURATION_S, "faults": []}
    kills = (Kill(node, KILLED_S),)
    scenario = parse_scenario(data)
    report, truth = run_corridor(scenario, kills=kills)
    killed = Drawn(data, kills, dict(drawn.facts) | {"node": node})
    seen = look_at_kill(killed, report) | judge_safety(killed, scenario, truth)
    figures = found(study.figures, report | {"drawn": seen})
    assert [n for n, figure in study.figures.items() if figure.violated_by(figures[n])] == []
    assert [failed["node"] for failed in report["failures"]] == [node]
    assert (figures["least_gap_m"] or 0.0) > 5.0 and (figures["shortest_way_m"] or 0.0) > 1.0
