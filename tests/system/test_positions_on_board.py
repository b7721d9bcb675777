"""Positions on board from all sensors, through the whole graph."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import yaml

from rail_corridor.loading.loader import builtin_scenarios

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def test_a_position_from_all_sensors_keeps_what_it_promises(corridor: CorridorFactory) -> None:
    data = yaml.safe_load(builtin_scenarios()["sensors"].read_text())
    slip = {"kind": "wheel_slip", "train": "train_a", "ratio": 0.6, "from_s": 12.0, "to_s": 15.0}
    report = corridor(data | {"duration_s": 26.0, "faults": [slip]}).run_to_end().report
    assert report["missing_ticks"] == 0 and report["failures"] == []
    train = report["trains"]["train_a"]
    doppler, located = train["doppler"], train["localizer"]
    assert located["exceeded"] == 0
    assert located["availability"] == 1.0 and located["rmse_m"] < 0.3
    # Better than any of its sources, though the wheels slide.
    assert located["rmse_m"] < min(train["phase_ranging"]["rmse_m"], doppler["rmse_m"])
    assert doppler["availability"] > 0.2 and doppler["normalised_error"] < 1.5


@pytest.mark.system
def test_the_same_wherever_the_nodes_live(corridor: CorridorFactory) -> None:
    data = yaml.safe_load(builtin_scenarios()["sensors"].read_text())
    short = {
        "tracks": {"main": {"elements": [{"straight_m": 700}], "speed_limits": [[0, 120]]}},
        "faults": [],
        "duration_s": 5.0,
    }
    here = corridor(data | short).run_to_end()
    there = corridor(data | short, placement="site").run_to_end()
    assert here.digest == there.digest
    assert {"doppler", "localizer"} <= here.report["trains"]["train_a"].keys()
