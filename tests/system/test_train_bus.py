"""A bus cable that fails in service, through the whole graph: told before a frame is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
