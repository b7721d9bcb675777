"""The study of handovers in short: the fastest trains, and trains that stand and turn back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from rail_corridor.studies.handover import HandoverParameters, draw_handover
from rail_corridor.studies.registry import CALCULATIONS, FOLDER, GENERATORS
from rail_corridor.study.sources import found
from rail_corridor.study.study_file import load_study

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


@pytest.mark.parametrize(
    ("situation", "crossings", "options"),
    [
        *(
            (HandoverParameters(corridor=corridor, speed_kmh=500.0, trains=2), 20, {})
            for corridor in ("plain", "branching")
        ),
        *(
            (
                HandoverParameters(corridor=c, manoeuvre=m, speed_kmh=60.0, trains=1),
                2,
                {"duration_s": 75.0},
            )
            for c, m in (("plain", "standing"), ("branching", "reversing"))
        ),
    ],
    ids=lambda value: value.name if isinstance(value, HandoverParameters) else "",
)
def test_no_handover_is_missed_and_no_position_is_false(
    corridor: CorridorFactory,
    situation: HandoverParameters,
    crossings: int,
    options: dict[str, float],
) -> None:
    study, _ = load_study("handover", FOLDER, GENERATORS, CALCULATIONS)
    report = corridor(draw_handover(situation, 3).data | options).run_to_end().report
    figures = {name: value or 0.0 for name, value in found(study.figures, report).items()}
    assert [n for n, figure in study.figures.items() if figure.violated_by(figures[n])] == []
    assert figures["made"] == figures["crossings"] >= crossings
    assert figures["furthest_change_m"] <= 20.0
    assert figures["availability"] > 0.99
