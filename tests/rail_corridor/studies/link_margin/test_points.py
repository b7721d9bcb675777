"""The link-margin sweep: its points, what theory says, and rows from canned reports."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.train_radio.nodes import burst_format
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.studies.link_margin.points import (
    LOSSES_DB,
    SCHEMES,
    Point,
    aggregate,
    points,
    rate_interval,
    scenario_data,
)
from rail_corridor.studies.link_margin.theory import LinkPrediction, line_es_n0_db, theory

TOLD = LinkPrediction(12.0, 0.1, 0.2, 3.0)


def train(passed_s: list[float | None], frames: int, lost: int) -> dict[str, Any]:
    """Sections of a report that the sweep looks at."""
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


def test_every_scheme_has_its_losses() -> None:
    found = points(SCHEMES, LOSSES_DB)
    assert len({point.name for point in found}) == len(found) == sum(map(len, LOSSES_DB.values()))
    assert points(["mrc"], {"mrc": (3.0,)}, quick=True) == [Point("mrc", 3.0, True)]


@pytest.mark.parametrize("quick", [True, False])
def test_the_stretch_is_weak_by_the_loss_and_by_nothing_else(quick: bool) -> None:
    found = (parse_scenario(scenario_data(Point("mrc", x, quick))) for x in (20.0, 33.0))
    lines = [line_es_n0_db(scenario, 0.3, step_m=45.0) for scenario in found]
    # Abeam of a mast the train is within the mast's walls for two metres.
    weaker = np.isclose(lines[0] - lines[1], 13.0)
    assert weaker.mean() > 0.95
    assert np.ptp(lines[0][weaker]) < 11.0


def test_theory_falls_with_the_level_and_follows_diversity() -> None:
    rates = {}
    for scheme in SCHEMES:
        plan = parse_scenario(scenario_data(Point(scheme, 30.0))).cbtc
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
    """Report of a run of two trains."""
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


def test_a_row_counts_frames_in_the_stretch_and_headways_at_its_checkpoints() -> None:
    row = aggregate(Point("mrc", 30.0), [a_run()], TOLD)
    assert row.headway_s == pytest.approx(25.5)
    assert (row.unpassed, row.passings, row.brakings) == (1, 6, 2)
    assert row.train_hours == pytest.approx(140.0 / 3600.0)
    # Sent inside 640 + 480; accepted 660 - 160 and 660 - 320.
    assert row.frame_loss == pytest.approx(1.0 - 840.0 / 1120.0)
    assert row.without_authority_s == 2.0 and row.age_p95_s == 0.5
    assert row.brakings_per_hour == pytest.approx(2.0 * 3600.0 / 140.0)


def test_runs_that_differ_in_their_seeds_are_one_row() -> None:
    one = aggregate(Point("mrc", 30.0), [a_run()], TOLD)
    two = aggregate(Point("mrc", 30.0), [a_run()] * 2, TOLD)
    assert two.brakings == 2 * one.brakings and two.passings == 2 * one.passings
    assert two.train_hours == pytest.approx(2.0 * one.train_hours)
    assert two.frame_loss == one.frame_loss and two.headway_s == one.headway_s


def test_a_run_in_which_nobody_came_to_the_stretch() -> None:
    report = {"sim_time_s": 100.0, "trains": {"a": train([None] * 9, 0, 0)}, "events": []}
    row = aggregate(Point("siso", 60.0), [report], TOLD)
    assert row.frame_loss is None and row.headway_s is None and row.brakings_per_hour is None
    assert row.unpassed == row.passings == 3


def test_rate_interval() -> None:
    assert rate_interval(0, 2.0) == pytest.approx((0.0, 3.689 / 2.0), rel=1e-3)
    low, high = rate_interval(10, 1.0)
    assert (low, high) == pytest.approx((4.795, 18.39), rel=1e-3)
