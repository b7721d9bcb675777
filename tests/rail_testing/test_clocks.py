"""Trains whose clocks are wrong, drift and jump, and units that are started anew under attack."""

from __future__ import annotations

from typing import Any

import pytest

from rail_testing.plugin import CorridorFactory as Make

CONTROLLER = "/wayside/zone_controller"
ALL = ["repetition", "insertion", "resequencing", "corruption", "delay", "masquerade"]


def scenario(*faults: dict[str, Any], duration_s: float = 30.0) -> dict[str, Any]:
    return {
        "name": "clocks",
        "seed": 8,
        "duration_s": duration_s,
        "tick_s": 0.25,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 3000}],
                "speed_limits": [[0, 80]],
                "stops_m": [2900],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1000},
        "trains": [
            {"name": "a", "route": ["main"], "start_m": 900},
            {"name": "b", "route": ["main"], "start_m": 500},
        ],
        "faults": [*faults],
    }


def clock(node: str, offset_s: float, drift_ppm: float, from_s: float = 0.0) -> dict[str, Any]:
    wrong = {"offset_s": offset_s, "drift_ppm": drift_ppm, "from_s": from_s}
    return {"kind": "clock", "node": node, **wrong}


def test_with_clocks_that_drift_the_corridor_runs_as_before(corridor: Make) -> None:
    right = corridor(scenario()).run_to_end().report
    wrong = corridor(
        scenario(
            clock("/a/atp", 10.0, 200.0),
            clock("/b/atp", -10.0, -200.0),
            clock(CONTROLLER, -3.0, -200.0),
        )
    ).run_to_end()
    for name, train in right["trains"].items():
        other = wrong.report["trains"][name]
        assert other["distance_m"] == pytest.approx(train["distance_m"], abs=0.5)
        assert other["atp"]["interventions"] == train["atp"]["interventions"]
        for key in ("frames", "lost", "rejected"):
            assert other["cbtc"][key] == train["cbtc"][key]
        assert other["cbtc"]["age_p95_s"] == pytest.approx(train["cbtc"]["age_p95_s"], abs=1e-3)
        assert other["cbtc"]["mislocated"] == other["cbtc"]["forged_accepted"] == 0


@pytest.mark.parametrize("node", ["/b/atp", CONTROLLER])
@pytest.mark.parametrize("jump_s", [-20.0, 20.0])
def test_after_a_clock_has_jumped_the_trains_go_on(
    corridor: Make, node: str, jump_s: float
) -> None:
    report = corridor(scenario(clock(node, jump_s, 0.0, from_s=8.0))).run_to_end().report
    train = report["trains"]["b"]
    assert train["cbtc"]["mislocated"] == train["cbtc"]["forged_accepted"] == 0
    assert train["cbtc"]["rejected"] > 0
    assert train["distance_m"] > 200.0


def test_under_attack_and_started_anew_nobody_believes_a_forgery(corridor: Make) -> None:
    threats = {"kind": "threat", "threats": ALL, "rate": 0.1, "longest_delay_s": 5.0}
    off = [
        {"kind": "equipment_off", "node": node, "from_s": at_s, "to_s": at_s + 0.5}
        for at_s in (6.0, 14.0)
        for node in ("/b/atp", CONTROLLER)
    ]
    clocks = clock("/b/atp", 4.0, 150.0), clock(CONTROLLER, -4.0, -150.0)
    outcomes = [
        corridor(scenario(threats, *off, *clocks, duration_s=25.0), placement=placement)
        .run_to_end()
        .report
        for placement in ("one", "site")
    ]
    assert outcomes[0]["digest"] == outcomes[1]["digest"]
    for name in ("a", "b"):
        link = outcomes[0]["trains"][name]["cbtc"]
        assert link["frames"] > 30
        assert link["forged_accepted"] == link["forged_reports"] == 0
