"""The study of the link margin: its line, what theory says, and figures of canned reports."""

from __future__ import annotations

from typing import Any, get_args

import numpy as np
import pytest

from rail_corridor.equipment.train_radio.nodes import burst_format
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.studies.link_margin.runs import (
    LinkMarginParameters,
    SchemeName,
    draw_link_margin,
    look_at_link_margin,
    scenario_data,
)
from rail_corridor.studies.link_margin.theory import line_es_n0_db, theory
from rail_corridor.study.sources import Drawn


def train(passed_s: list[float | None], frames: int, lost: int) -> dict[str, Any]:
    """Return sections of a report that the study looks at."""
    return {
        "cbtc": {
            "frames": frames,
            "lost": lost,
            "age_p95_s": 0.5,
            "without_authority_s": 1.0,
            "passed_s": passed_s,
        },
        "atp": {"interventions": 5, "passed_authority": 0},
    }


@pytest.mark.parametrize("more", [{}, {"length_m": 4000.0, "trains": 3}])
def test_the_stretch_is_weak_by_the_loss_and_by_nothing_else(more: dict[str, Any]) -> None:
    given = (LinkMarginParameters(scheme="mrc", loss_db=x, **more) for x in (20.0, 33.0))
    lines = [line_es_n0_db(parse_scenario(scenario_data(g)), 0.3, step_m=45.0) for g in given]
    # Abeam of a mast the train is within the mast's walls for two metres.
    weaker = np.isclose(lines[0] - lines[1], 13.0)
    assert weaker.mean() > 0.95
    assert np.ptp(lines[0][weaker]) < 11.0


def test_what_is_drawn_tells_of_theory_and_differs_by_its_seed_alone() -> None:
    parameters = LinkMarginParameters(scheme="siso", loss_db=28.0)
    one, two = (draw_link_margin(parameters, seed) for seed in (1, 2))
    assert one.data | {"seed": 2} == two.data and one.facts == two.facts
    assert 0.0 < one.facts["frame_loss_at_rest_told"] < one.facts["frame_loss_told"] < 1.0
    weaker = draw_link_margin(LinkMarginParameters(scheme="siso", loss_db=34.0), 1)
    assert weaker.facts["es_n0_db"] == pytest.approx(one.facts["es_n0_db"] - 6.0, abs=0.11)


def test_theory_falls_with_the_level_and_follows_diversity() -> None:
    rates = {}
    for scheme in get_args(SchemeName):
        plan = parse_scenario(scenario_data(LinkMarginParameters(scheme=scheme))).cbtc
        assert plan is not None
        burst = burst_format(plan)
        told = [theory(scheme, np.full(3, level), burst, 12, 0.25) for level in range(6, 27, 3)]
        # Rarer than this the drawn channels say too little.
        common = [t for t in told if t.frame_loss_at_rest > 0.02]
        assert common and all(t.frame_loss_at_rest < t.frame_loss for t in common)
        for name in ("frame_loss", "frame_loss_at_rest", "brakings_per_hour"):
            assert (np.diff([getattr(t, name) for t in told]) < 0.0).all()
        rates[scheme] = told[3].frame_loss
    assert rates["siso"] > rates["alamouti_2x1"] > rates["mrc"] > rates["alamouti_2x2"]


def a_run() -> dict[str, object]:
    """Return the report of a run of two trains."""
    # On the line for 100 s at 0.25 s; the stretch begins at the third tenth.
    first = train([1.0, 2.0, 20.0, 30.0, 40.0, 50.0, None, None, None], 760, 100)
    second = train([1.0, 2.0, 40.0, 55.0, 66.0, None, None, None, None], 780, 120)
    events = [
        {"name": f"/{name}/atp: supervision", "message": message, "time_s": time_s}
        for name, message, time_s in (
            ("a", "no authority", 0.0),
            ("a", "no authority", 21.0),
            ("a", "too fast", 30.0),
            ("b", "no authority", 39.0),
            ("b", "no authority", 70.0),
        )
    ]
    return {"sim_time_s": 100.0, "trains": {"a": first, "b": second}, "events": events}


def test_frames_in_the_stretch_and_headways_at_its_checkpoints_are_counted() -> None:
    seen = look_at_link_margin(Drawn({}), a_run())
    # 25 s and 26 s; the second train has let 50 s pass at the third place when the run ends.
    assert seen["headway_s"] == pytest.approx((25.0 + 26.0 + 50.0) / 3.0)
    assert (seen["cut_off"], seen["passed"], seen["brakings"]) == (1, 5 / 6, 2)
    assert seen["train_hours"] == pytest.approx(140.0 / 3600.0)
    # Sent inside 640 + 480; accepted 660 - 160 and 660 - 320.
    assert seen["frame_loss"] == pytest.approx(1.0 - 840.0 / 1120.0)


def test_a_run_in_which_nobody_came_to_the_stretch() -> None:
    report = {"sim_time_s": 100.0, "trains": {"a": train([None] * 9, 0, 0)}, "events": []}
    seen = look_at_link_margin(Drawn({}), report)
    assert seen["frame_loss"] is None and seen["headway_s"] is None
    assert seen["train_hours"] == seen["passed"] == seen["cut_off"] == 0.0


def test_a_headway_counts_from_the_passing_of_the_train_ahead_alone() -> None:
    ahead = train([1.0, 2.0, 20.0, None, None, None, None, None, None], 1, 0)
    after = train([1.0, 2.0, 40.0, None, None, None, None, None, None], 1, 0)
    report = {"sim_time_s": 100.0, "trains": {"a": ahead, "b": after}, "events": []}
    seen = look_at_link_margin(Drawn({}), report)
    assert (seen["headway_s"], seen["cut_off"], seen["passed"]) == (None, 0, 0.0)
