"""Runs against the truth: counts are exact, no section with an axle in it is called free, and each
figure of the report that must be zero is not zero where it should not be.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from axle_counter.corridor.report import axle_counter_metrics, axle_counter_tables
from axle_counter.signals.axles import Cars
from axle_counter.signals.section_counter import Reset, SectionCounter
from axle_counter.topics import PASSAGES, SECTIONS
from simulated_run import judged, simulate

from rail_msgs_py.topics.world import STATE

Make = Callable[..., Any]


def track(length_m: float, limit_kmh: float) -> dict[str, Any]:
    return {"elements": [{"straight_m": length_m}], "speed_limits": [[0, limit_kmh]]}


def is_right(report: dict[str, Any], axles: int) -> None:
    """All axles that passed were counted, and nothing else; nothing was wrongly called free."""
    assert report["axles"] == report["counted"] == axles
    assert report["miscounts"] == report["unclear"] == 0
    assert report["free_while_occupied_ticks"] == 0


@pytest.mark.parametrize("speed_kmh", [5.0, 40.0, 160.0, 300.0])
def test_counts_are_exact_at_every_speed(scenario: Make, speed_kmh: float) -> None:
    speed_mps = speed_kmh / 3.6
    start_m, end_m = 2895.0, 3240.0  # the heads are at 2900, 3000 and 3100 m
    made = scenario(
        tracks={"main": track(6000.0, 300.0)},
        duration_s=round((end_m - start_m) / speed_mps, 1),
        axle_counters={"length_m": 100.0, "margin_m": 2900.0},
        trains=[
            {
                "name": "a",
                "route": ["main"],
                "start_m": start_m,
                "speed_kmh": speed_kmh,
                "target_speed_kmh": speed_kmh,
                "leaves_on_arrival": True,
                "vehicle": {"preset": "high_speed", "length_m": 118.0},
            }
        ],
    )
    report = judged(made)
    is_right(report, 3 * 24)
    assert report["not_known_ticks"] == 0
    # Held occupied for no longer than a wheel takes to come near a sensor, or to leave it.
    least = np.ceil(0.4 / speed_mps / made.tick_s) + 1
    assert report["occupied_while_free_ticks"] <= 4 * least


def test_a_train_that_stands_on_a_head(scenario: Make) -> None:
    first_m = float(Cars().axles_m(118.0)[0])
    for beyond_m in (-0.12, 0.0, 0.12):
        stop_m = 650.0 + first_m + beyond_m  # so far is its first axle beyond the head
        made = scenario(
            duration_s=100.0,
            trains=[
                {
                    "name": "a",
                    "route": ["main"],
                    "start_m": 500.0,
                    "speed_kmh": 50,
                    "stop_at_m": [stop_m],
                    "dwell_s": 20.0,
                    "leaves_on_arrival": True,
                }
            ],
        )
        data = simulate(made)
        report = axle_counter_metrics(made, data)["axle_counter"]
        busy = data[PASSAGES].upto(data.ticks)[:, 1, PASSAGES.index["busy"]]
        assert busy.sum() > made.trains[0].dwell_s / made.tick_s
        # It began inside acs1: what leaves that is counted, the section stays not known.
        is_right(report, 2 * 24)
        assert report["sections"]["acs1"]["not_known_ticks"] == made.ticks
        assert report["sections"]["acs2"]["not_known_ticks"] == 0


def test_a_train_that_turns_back_over_a_head(scenario: Make) -> None:
    for turn_m in np.linspace(700.0, 702.5, 6):  # with an axle at, before and behind it
        made = scenario(
            duration_s=160.0,
            trains=[
                {
                    "name": "a",
                    "route": ["main"],
                    "start_m": 130.0,
                    "speed_kmh": 60,
                    "reverse_at": [{"at_m": float(turn_m), "dwell_s": 5.0}],
                }
            ],
        )
        report = judged(made)
        point = report["points"]["dp2"]
        assert point["axles"] == point["counted"] > 0
        assert report["miscounts"] == report["unclear"] == 0
        assert report["free_while_occupied_ticks"] == report["not_known_ticks"] == 0


def test_a_train_the_other_way(scenario: Make) -> None:
    made = scenario(
        duration_s=60.0,
        trains=[
            {"name": "a", "route": ["main"], "start_m": 1170, "speed_kmh": 80, "direction": -1}
        ],
    )
    data = simulate(made)
    report = axle_counter_metrics(made, data)["axle_counter"]
    is_right(report, 3 * 24)
    seen = data[PASSAGES].upto(data.ticks)
    assert seen[:, :, PASSAGES.index["backward"]].sum() == 72
    assert seen[:, :, PASSAGES.index["forward"]].sum() == 0
    assert report["not_known_ticks"] == 0


def test_two_trains_one_of_which_follows_into_the_same_section(scenario: Make) -> None:
    common = {"route": ["main"], "leaves_on_arrival": True}
    made = scenario(
        duration_s=180.0,
        tracks={"main": track(1600.0, 80)},
        axle_counters={"length_m": 450, "margin_m": 300},
        trains=[
            {"name": "a", "start_m": 290, "stop_at_m": [940], "dwell_s": 30.0, **common},
            {"name": "b", "start_m": 150, "stop_at_m": [800], "dwell_s": 40.0, **common},
        ],
    )
    data = simulate(made)
    report = axle_counter_metrics(made, data)["axle_counter"]
    is_right(report, 2 * 4 * 24)
    assert report["not_known_ticks"] == 0
    # Both were in one section at a time.
    assert data[SECTIONS].upto(data.ticks)[:, :, SECTIONS.index["axles"]].max() == 48


def test_trains_over_a_junction_enter_one_section_and_leave_by_two_points(scenario: Make) -> None:
    made = scenario(
        duration_s=130.0,
        tracks={
            "main": track(1500.0, 80),
            "branch": {
                "elements": [{"arc_m": 100, "radius_m": 300}, {"straight_m": 500}],
                "speed_limits": [[0, 50]],
            },
        },
        junctions=[{"track": "main", "at_m": 760, "branch": "branch"}],
        axle_counters={"length_m": 400, "margin_m": 150},
        trains=[
            {"name": "a", "route": ["main"], "start_m": 140, "leaves_on_arrival": True},
            {
                "name": "b",
                "route": ["main", "branch"],
                "start_m": 145,
                "depart_s": 60.0,
                "enters_at_departure": True,
            },
        ],
    )
    report = judged(made)
    assert report["miscounts"] == report["unclear"] == report["free_while_occupied_ticks"] == 0
    assert report["not_known_ticks"] == 0
    passed = {name: point["counted"] for name, point in report["points"].items()}
    assert passed["dp1"] == passed["dp2"] == 48  # both trains before the junction
    assert passed["dp3"] == 24  # one of them behind it on the main track
    assert passed["dp5"] == 24  # and one on the branch


MISSED = {"kind": "missed_axles", "point": "dp1", "every": 3}


def test_a_head_that_misses_axles_on_the_way_in_calls_an_occupied_section_free(
    scenario: Make,
) -> None:
    report = judged(scenario(duration_s=60.0, faults=[MISSED]))
    assert report["points"]["dp1"] == {"axles": 24, "counted": 16, "miscounts": 8, "unclear": 0}
    assert report["miscounts"] == 8
    assert report["free_while_occupied_ticks"] > 0
    # The last 8 axles make more than have come in.
    assert report["sections"]["acs1"]["not_known_ticks"] > 0
    assert report["sections"]["acs2"] == {
        "free_while_occupied_ticks": 0,
        "occupied_while_free_ticks": report["sections"]["acs2"]["occupied_while_free_ticks"],
        "not_known_ticks": 0,
    }


def test_a_head_that_misses_axles_on_the_way_out_leaves_the_section_occupied(
    scenario: Make,
) -> None:
    report = judged(scenario(duration_s=60.0, faults=[{**MISSED, "point": "dp3"}]))
    assert report["miscounts"] == 8
    assert report["free_while_occupied_ticks"] == 0
    assert report["sections"]["acs2"]["occupied_while_free_ticks"] > 50


def test_a_rail_brake_between_the_axles_is_counted_as_axles(scenario: Make) -> None:
    # Down while the train passes dp2 alone: 12 bogies.
    brake = {"kind": "rail_brake", "train": "a", "from_s": 20.0, "to_s": 31.0}
    report = judged(scenario(duration_s=60.0, faults=[brake]))
    assert report["points"]["dp2"] == {"axles": 24, "counted": 36, "miscounts": 12, "unclear": 0}
    assert report["points"]["dp1"]["miscounts"] == report["points"]["dp3"]["miscounts"] == 0
    assert report["sections"]["acs1"]["not_known_ticks"] > 0  # 36 out, 24 in
    assert report["free_while_occupied_ticks"] > 0  # at 24 out, with axles still to come


def test_a_fault_acts_only_while_it_lasts(scenario: Make) -> None:
    for fault in ({**MISSED, "to_s": 1.0}, {**MISSED, "from_s": 30.0}):
        is_right(judged(scenario(duration_s=60.0, faults=[fault])), 72)


def restart(at: int, reset: Reset | None = None) -> Callable[[int, dict[str, Any]], None]:
    """Return an evaluator that starts anew after a tick, and a reset of everything a tick later."""

    def incident(tick: int, sections: dict[str, SectionCounter]) -> None:
        if tick == at:
            for name, each in sections.items():
                sections[name] = SectionCounter(each.section)
        if tick == at + 1 and reset is not None:
            for each in sections.values():
                each.reset(reset)

    return incident


def test_after_a_restart_nothing_is_known(scenario: Make) -> None:
    made = scenario(duration_s=60.0)
    report = judged(made, incident=restart(100))
    assert report["miscounts"] == report["free_while_occupied_ticks"] == 0
    assert report["not_known_ticks"] == 2 * (made.ticks - 100)


def test_who_resets_a_section_with_a_train_in_it_makes_it_free(scenario: Make) -> None:
    """Why a reset asks for a sweep: at 16 s the train is in the section, and nobody knows."""
    made = scenario(duration_s=60.0)
    report = judged(made, incident=restart(160, Reset.CONDITIONAL))
    assert report["sections"]["acs1"]["free_while_occupied_ticks"] > 30
    swept = judged(made, incident=restart(160, Reset.SWEEP))
    assert swept["free_while_occupied_ticks"] == 0


def test_what_nobody_reported_is_not_known(scenario: Make) -> None:
    made = scenario(duration_s=30.0)
    data = simulate(made)
    data[SECTIONS].upto(data.ticks)[100:, 0] = np.nan
    data[PASSAGES].upto(data.ticks)[:, 0] = np.nan
    report = axle_counter_metrics(made, data)["axle_counter"]
    assert report["sections"]["acs1"]["not_known_ticks"] == 200
    assert report["points"]["dp1"] == {"axles": 24, "counted": 0, "miscounts": 24, "unclear": 0}


def test_an_unclear_passage_is_in_the_report(scenario: Make) -> None:
    made = scenario(duration_s=30.0)
    data = simulate(made)
    data[PASSAGES].upto(data.ticks)[7, 1, PASSAGES.index["unclear"]] = 1.0
    report = axle_counter_metrics(made, data)["axle_counter"]
    assert report["unclear"] == report["points"]["dp2"]["unclear"] == 1


def test_the_tables_show_every_point_and_section(scenario: Make) -> None:
    report = {"axle_counter": judged(scenario(duration_s=5.0)), "trains": {}}
    points, sections = axle_counter_tables(report)
    assert points.row_count == 3
    assert sections.row_count == 2
    assert list(axle_counter_tables({"trains": {}})) == []


def test_the_digest_holds_what_was_counted(scenario: Make) -> None:
    one, other = simulate(scenario(duration_s=5.0)), simulate(scenario(duration_s=5.0))
    assert one.digest() == other.digest()
    other[SECTIONS].upto(other.ticks)[3, 0, 0] = 1.0
    assert one.digest() != other.digest()
    assert other[STATE].ticks == 50
