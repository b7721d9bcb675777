"""Positions on board from all sensors, through the whole graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

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


def one_train(limit_kmh: float, tick_s: float, **more: Any) -> dict[str, Any]:
    """Return a train that runs 550 m to its stop."""
    return {
        "name": "one_train",
        "seed": 1,
        "duration_s": 90.0,
        "tick_s": tick_s,
        "tracks": {
            "main": {
                "elements": [{"straight_m": 1500.0}],
                "speed_limits": [[0, limit_kmh]],
                "stops_m": [1400.0],
            }
        },
        "stations": {"zone_length_m": 350.0},
        "cbtc": {"base_spacing_m": 1000.0},
        "references": {"spacing_m": 500.0},
        "trains": [{"name": "a", "route": ["main"], "start_m": 950.0}],
        **more,
    }


def running_time(corridor: CorridorFactory, data: dict[str, Any]) -> tuple[float, int]:
    """Return when the train has come to 1390 m, and ticks of braking since it was told to go."""
    with corridor(data) as c:
        braked = 0
        while c.truth("a").front_m < 1390.0:
            assert c.step(), f"ended at {c.truth('a').front_m:.0f} m"
            braked += c.time_s > 5.0 and c.topic("/a/atp/command").latest.service_brake > 0.0
        return c.time_s, braked


@pytest.mark.parametrize(("limit_kmh", "tick_s"), [(25.0, 0.5), (80.0, 0.25)])
def test_a_train_on_the_localizer_is_as_fast_as_one_without(
    corridor: CorridorFactory, limit_kmh: float, tick_s: float
) -> None:
    """Each speed is known at a stand too: no brake that is never released, and none at all."""
    without_s, _ = running_time(corridor, one_train(limit_kmh, tick_s))
    with_s, braked = running_time(corridor, one_train(limit_kmh, tick_s, localizer={}))
    assert with_s <= 1.05 * without_s
    assert braked == 0


@pytest.mark.parametrize("ratio", [0.3, 3.0])
def test_wheels_that_deceived_for_long_are_healed_by_ranges(
    corridor: CorridorFactory, ratio: float
) -> None:
    slip = {"kind": "wheel_slip", "train": "a", "ratio": ratio, "from_s": 12.0, "to_s": 42.0}
    data = one_train(80.0, 0.5, localizer={}, faults=[slip])
    data["tracks"]["main"] |= {"elements": [{"straight_m": 3000.0}], "stops_m": [2900.0]}
    with corridor(data) as c:
        c.run_for(42.0)
        stood_m = c.truth("a").front_m
        c.run_until(lambda: c.topic("/a/localizer/state").latest.status == 2.0, within_s=45.0)
        c.run_until(lambda: c.truth("a").front_m > stood_m + 50.0, within_s=45.0)
        assert c.report()["trains"]["a"]["localizer"]["exceeded"] == 0


def test_who_restarts_on_a_long_line_is_located_anew_and_never_a_cycle_off(
    corridor: CorridorFactory,
) -> None:
    """Tones come again after 5 km: a positioner alone could not tell, the localizer tells it."""
    data = one_train(100.0, 0.25, localizer={}, references={"spacing_m": 200.0})
    data["tracks"]["main"] |= {"elements": [{"straight_m": 6000.0}], "stops_m": []}
    nodes = ("/a/localizer", "/a/doppler")
    with corridor(data) as c:
        c.run_for(40.0)
        for node in nodes:
            c.kill(node)
        c.run_for(3.0)
        for node in nodes:
            c.restart(node)
        known = found = 0
        again_ns = round(1e9 * c.time_s)
        for _ in range(60):
            c.step()
            true_m = c.truth("a").front_m
            state = c.topic("/a/localizer/state").latest
            fix = c.topic("/a/doppler/fix").latest
            if state.stamp_ns > again_ns and state.status > 0.0:
                known += 1
                assert state.low_m <= true_m <= state.high_m
            if fix.stamp_ns > again_ns and fix.reason == 0.0:
                found += 1
                assert abs(fix.chainage_m - true_m) < 100.0
        assert known > 40 and found > 10
