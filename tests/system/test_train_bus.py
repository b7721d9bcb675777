"""A bus cable that fails in service, through the whole graph: told before a frame is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import yaml

from rail_corridor.loading.loader import builtin_scenarios

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

#: The fault of `failing_bus` grows in this time [s], on a short line.
_FROM_S, _TO_S = 3.0, 15.0


def test_a_fault_that_grows_is_told_before_the_first_frame_is_lost(
    corridor: CorridorFactory,
) -> None:
    data = yaml.safe_load(builtin_scenarios()["failing_bus"].read_text())
    (fault,) = data["faults"]
    data |= {
        "duration_s": 16.0,
        "tracks": {"main": {"elements": [{"straight_m": 800}], "speed_limits": [[0, 80]]}},
        "train_bus": data["train_bus"] | {"period_s": 2.0},
        "faults": [fault | {"from_s": _FROM_S, "to_s": _TO_S}],
    }
    report = corridor(data).run_to_end().report
    assert report["missing_ticks"] == 0
    assert report["failures"] == []
    bus = report["trains"]["train_a"]["train_bus"]
    assert bus["lost"] > 0
    assert bus["false_reports"] == 0
    assert _FROM_S < bus["reported_s"] < bus["first_loss_s"] < _TO_S
    assert bus["reported_before_first_loss_s"] > 5.0
    first = bus["faults"][0]
    assert (first["kind"], first["level"], first["place_error_m"]) == ("loose_connector", "warn", 0)
    # And on /diagnostics, for people.
    told = [event for event in report["events"] if "loose connector" in event["message"]]
    assert told
    assert told[0]["time_s"] < bus["first_loss_s"]


def test_who_follows_a_train_that_parted_stays_behind_where_it_was_last_whole(
    corridor: CorridorFactory,
) -> None:
    """The head runs on; where its rear was when the bus last confirmed it, the way ends."""
    data = {
        "name": "parted",
        "seed": 3,
        "duration_s": 130.0,
        "tick_s": 0.5,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 3000.0}],
                "speed_limits": [[0, 80]],
                "stops_m": [2800.0],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1000.0},
        "train_bus": {"cars": ["CM2", "CM2", "CM2", "CM2"]},
        "trains": [
            {"name": "a", "route": ["main"], "start_m": 900.0},
            {"name": "b", "route": ["main"], "start_m": 400.0},
        ],
        "faults": [{"kind": "train_parted", "train": "a", "from_s": 30.0, "behind_car": 2}],
    }
    with corridor(data) as c:
        reported = c.topic("/wayside/zone_controller/a/reports")
        c.run_for(29.0)
        assert confirmed(reported) == 1.0
        c.run_for(4.0)
        assert confirmed(reported) == 0.0
        length_m = c.scenario.trains[0].vehicle.length_m
        rear_m = c.truth("a").front_m - length_m
        c.run_for(90.0)
        assert c.truth("a").front_m > rear_m + 500.0
        assert c.truth("b").front_m < rear_m
        assert c.truth("b").speed_mps == 0.0


def confirmed(reports: Any) -> float:
    """Return what the newest report of a train said of its being whole."""
    return float(reports.latest.integrity_confirmed)
