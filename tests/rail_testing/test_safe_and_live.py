"""Corridors that end badly or stand still, and are said to; whole corridors in one process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rail_corridor.errors import InputError
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.loading.start_checks import climbing_troubles
from rail_testing import Corridor

Make = Callable[..., Corridor]


def scenario(length_m: float = 2500.0, **changes: Any) -> dict[str, Any]:
    track = {
        "elements": [{"straight_m": length_m}],
        "speed_limits": [[0, 80]],
        **changes.pop("track", {}),
    }
    given = {
        "name": "made",
        "seed": 3,
        "tick_s": 0.5,
        "duration_s": 100.0,
        "stations": {"zone_length_m": 350},
        "tracks": {"main": track},
    }
    return given | changes


def train(name: str, start_m: float, **more: Any) -> dict[str, Any]:
    return {"name": name, "route": ["main"], "start_m": start_m, **more}


def kinds(report: dict[str, Any]) -> list[str]:
    return [event["kind"] for event in report["events"] if event.get("kind")]


def checked(data: dict[str, Any]) -> None:
    from pathlib import Path

    scenario_from_data(data, directory=Path())


def test_two_trains_without_control_run_into_each_other_and_that_is_unsafe(corridor: Make) -> None:
    both = [train("up", 300), train("down", 2200, direction=-1)]
    c = corridor(scenario(duration_s=80.0, trains=both))
    outcome = c.run_to_end()
    (event,) = (e for e in outcome.report["events"] if e.get("kind") == "collision")
    assert (event["train"], event["other"], event["track"]) == ("up", "down", "main")
    assert 1100.0 < event["at_m"] < 1400.0
    assert outcome.verdict == outcome.report["verdict"] == "unsafe"
    assert "collision of up and down" in outcome.report["reasons"][0]


def test_a_follower_that_enters_waits_for_one_that_has_stopped_at_the_entrance(
    corridor: Make,
) -> None:
    data = scenario(
        track={"stops_m": [2400]},
        cbtc={},
        duration_s=130.0,
        timetable={"count": 2, "headway_s": 40, "train": {"name": "t", "route": ["main"]}},
        faults=[{"kind": "train_stop", "train": "t1", "from_s": 12, "to_s": 70}],
    )
    c = corridor(data)
    outcome = c.run_to_end()
    assert kinds(outcome.report) == ["entrance"]
    assert outcome.verdict == "safe"
    # It went in when the other had gone, and ran.
    assert outcome.report["trains"]["t2"]["atp"]["margin_min_m"] > 0.0
    assert c.truth("t2").front_m > 100.0


def test_one_that_is_put_in_at_a_platform_waits_until_it_is_free(corridor: Make) -> None:
    data = scenario(
        3000.0,
        track={"stops_m": [200, 2900]},
        cbtc={"base_spacing_m": 1000},
        trains=[
            train("t1", 150, dwell_s=40),
            train("t2", 150, depart_s=40, enters_at_departure=True),
        ],
    )
    outcome = corridor(data).run_to_end()
    assert kinds(outcome.report) == ["entrance"]
    assert outcome.verdict == "safe"


def test_one_that_leaves_among_others_leaves_and_is_in_no_zone_any_more(corridor: Make) -> None:
    data = scenario(
        1500.0,
        cbtc={},
        tick_s=0.25,
        duration_s=125.0,
        trains=[train("a", 700, leaves_on_arrival=True), train("b", 300)],
    )
    c = corridor(data)
    outcome = c.run_to_end()
    assert c.truth("a").front_m == 1500.0 and not c.truth("a").on_line
    said = [e["message"] for e in outcome.report["events"] if e["name"].endswith(": a")]
    assert said[-1].startswith("has left the line past zone5")
    # The other comes up to the end of the track, which is its own.
    assert c.truth("b").front_m == pytest.approx(1500.0, abs=0.1)
    assert outcome.report["trains"]["b"]["atp"]["passed_authority"] == 0


def test_a_line_without_limits_is_run_at_the_speed_of_the_train(corridor: Make) -> None:
    data = scenario(
        1500.0,
        track={"speed_limits": [], "stops_m": [1300]},
        cbtc={},
        end_when_arrived=True,
        trains=[train("a", 700)],
    )
    outcome = corridor(data).run_to_end()
    assert outcome.verdict == "safe" and not outcome.report["failures"]
    assert outcome.report["ticks"] < 200


def test_a_train_that_stalls_is_said_to_by_the_check_and_by_the_run(corridor: Make) -> None:
    data = scenario(
        3000.0,
        track={"gradients": [[0, 0], [600, 60]], "stops_m": [2800]},
        duration_s=240.0,
        trains=[train("a", 130, vehicle={"max_traction_n": 120000})],
    )
    c = corridor(data)
    outcome = c.run_to_end()
    assert kinds(outcome.report) == ["stall", "stuck"]
    assert outcome.verdict == "not live"
    (trouble,) = climbing_troubles(c.scenario)
    assert f"comes to a stand at {c.truth('a').front_m:.0f} m of main" in trouble


def test_a_train_that_has_lost_its_controller_is_stuck_and_the_run_not_live(corridor: Make) -> None:
    c = corridor(
        scenario(cbtc={}, duration_s=120.0, track={"stops_m": [2400]}, trains=[train("a", 400)])
    )
    c.run_for(20.0)
    c.kill("/wayside/zone_controller")
    outcome = c.run_to_end()
    assert outcome.verdict == "not live"
    assert "a is stuck" in outcome.report["reasons"][0]


@pytest.mark.parametrize("cab_signals", [True, False])
def test_supervision_alone_keeps_a_heedless_driver_behind_the_train_ahead(
    corridor: Make, cab_signals: bool
) -> None:
    data = scenario(
        4000.0,
        track={"stops_m": [3900]},
        cbtc={"cab_signals": cab_signals},
        tick_s=0.25,
        duration_s=110.0,
        trains=[train("a", 1500), train("b", 500)],
        faults=[{"kind": "train_stop", "train": "a", "from_s": 5, "to_s": 900}],
    )
    report = corridor(data).run_to_end().report
    assert report["verdict"] == "safe"
    atp = report["trains"]["b"]["atp"]
    assert atp["margin_min_m"] > 0.0 and atp["passed_authority"] == 0
    assert (atp["interventions"] > 1) is not cab_signals


def test_drivers_keep_to_a_restriction_as_a_board(corridor: Make) -> None:
    fault = {
        **{"kind": "speed_restriction", "track": "main", "speed_kmh": 30},
        **{"from_m": 800, "to_m": 1100, "from_s": 0, "to_s": 900},
    }
    c = corridor(scenario(trains=[train("a", 300)], faults=[fault]))
    slow = []
    while not c.finished and c.truth("a").front_m < 1300.0:
        c.step()
        if 800.0 <= c.truth("a").front_m <= 1100.0 + 118.0:
            slow.append(3.6 * c.truth("a").speed_mps)
    assert slow and max(slow) <= 30.0 + 1e-6
    c.run_to_end()


def test_reduced_brakes_within_the_guaranteed_rate_are_safe(corridor: Make) -> None:
    data = scenario(
        4000.0,
        track={"stops_m": [3900]},
        cbtc={"braking_mps2": 0.6, "emergency_mps2": 0.8, "cab_signals": False},
        tick_s=0.25,
        duration_s=110.0,
        trains=[train("a", 1500), train("b", 500)],
        faults=[
            {"kind": "train_stop", "train": "a", "from_s": 5, "to_s": 900},
            {"kind": "reduced_braking", "train": "b", "service": 0.7, "emergency": 0.7},
        ],
    )
    report = corridor(data).run_to_end().report
    assert report["trains"]["b"]["atp"]["margin_min_m"] > 0.0
    assert report["verdict"] == "safe"


@pytest.mark.parametrize(
    ("change", "field", "reason"),
    [
        (
            {"trains": [train("a", 1060), train("b", 930, speed_kmh=80)]},
            "trains.1.speed_kmh",
            "too fast to stop before a",
        ),
        (
            {"trains": [train("a", 1000), train("b", 1100)]},
            "trains.1.start_m",
            "in the same place",
        ),
        (
            {
                "track": {"gradients": [[0, 0], [500, -55]]},
                "cbtc": {"braking_mps2": 0.5},
                "trains": [train("a", 300)],
            },
            "cbtc.braking_mps2",
            "does not stop a train on the fall of 55 per mille of main",
        ),
        (
            {
                "track": {"gradients": [[0, 0], [1000, -60], [1500, 0]]},
                "track_circuits": {"length_m": 500},
                "tick_s": 0.25,
                "trains": [train("a", 300, vehicle={"preset": "regional"})],
            },
            "track_circuits.braking_mps2",
            "holds no train on the fall of 60 per mille",
        ),
        (
            {
                "trains": [train("a", 300)],
                "faults": [{"kind": "reduced_braking", "train": "b", "from_s": 1, "to_s": 2}],
            },
            "faults.0.train",
            "there is no such train",
        ),
        (
            {
                "trains": [train("a", 300)],
                "faults": [
                    {
                        **{"kind": "speed_restriction", "track": "main", "speed_kmh": 30},
                        **{"from_m": 800, "to_m": 2600},
                    }
                ],
            },
            "faults.0.to_m",
            "main ends at 2500 m",
        ),
    ],
)
def test_what_cannot_go_well_is_refused_in_one_line(
    change: dict[str, Any], field: str, reason: str
) -> None:
    with pytest.raises(InputError) as caught:
        checked(scenario(**change))
    assert caught.value.field == field
    assert reason in str(caught.value) and "\n" not in str(caught.value)
