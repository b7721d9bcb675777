"""The study of safety, short of running it: what is drawn from a seed."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.loading.schema import fault_kinds
from rail_corridor.studies.registry import GENERATORS
from rail_corridor.studies.safety.faults import FAULT_KINDS, LATEST_END_S
from rail_corridor.studies.safety.scenario import GOES_ON_S, SafetyParameters, draw_safety
from rail_corridor.study.sources import Drawn

SEEDS = range(150)
every_kind = pytest.mark.skipif(
    not {*FAULT_KINDS} - {"kill"} <= {*fault_kinds()}, reason="not all kinds of faults are there"
)


def drawn(seed: int) -> Drawn:
    """Return what is drawn from a seed."""
    return draw_safety(SafetyParameters(), seed)


def test_a_run_depends_on_its_seed_alone() -> None:
    assert drawn(7) == drawn(7)
    assert drawn(7) != drawn(8)


@every_kind
def test_every_run_can_be_made_and_everything_that_can_go_wrong_does() -> None:
    kinds: Counter[str] = Counter()
    counts: Counter[int] = Counter()
    off: Counter[str] = Counter()
    lengths_m, gradients = [], []
    for seed in SEEDS:
        case = drawn(seed)
        scenario = scenario_from_data(case.data, directory=Path.cwd())
        faults = case.data.get("faults", [])
        kinds.update({fault["kind"] for fault in faults} | {"kill" for _ in case.kills})
        counts[len(faults) + len(case.kills)] += 1
        off.update(f["node"].rpartition("/")[2] for f in faults if f["kind"] == "equipment_off")
        lengths_m += [train.vehicle.length_m for train in scenario.trains]
        gradients += [slope for _, slope in case.data["tracks"]["main"]["gradients"]]
        last_s = max((fault["to_s"] for fault in faults if "to_s" in fault), default=0.0)
        assert case.facts["last_end_s"] == last_s <= LATEST_END_S
        assert scenario.duration_s >= last_s + GOES_ON_S
        zones = [layout_of(scenario).zone_at("main", t.start_m).name for t in scenario.trains]
        assert len(set(zones)) == len(zones)
        for ahead, behind in zip(scenario.trains, scenario.trains[1:], strict=False):
            assert ahead.start_m - ahead.vehicle.length_m - behind.start_m > 20.0
    assert {*kinds} == {*FAULT_KINDS}
    assert {*counts} == {0, 1, 2, 3} and counts[2] > len(SEEDS) // 4
    assert off["atp"] and off["zone_controller"] and off["vrs"] and len(off) > 6
    assert 20.0 <= min(lengths_m) < 30.0 and 300.0 < max(lengths_m) <= 400.0
    assert -40.0 <= min(gradients) < -35.0 and 35.0 < max(gradients) <= 40.0
    facts = [drawn(seed).facts for seed in SEEDS]
    assert {each["tick_s"] for each in facts} == {0.1, 0.2, 0.25, 0.5, 1.0}
    assert {each["trains"] for each in facts} == {2, 3, 4}
    for name in ("localizer", "heedless"):
        assert {each[name] for each in facts} == {True, False}


@every_kind
def test_brakes_are_no_weaker_than_guaranteed() -> None:
    for seed in SEEDS:
        scenario = scenario_from_data(drawn(seed).data, directory=Path.cwd())
        vehicles = {train.name: train.vehicle for train in scenario.trains}
        for fault in drawn(seed).data.get("faults", []):
            if fault["kind"] == "reduced_braking":
                vehicle = vehicles[fault["train"]]
                service = fault["service"] * vehicle.max_service_brake_mps2
                emergency = fault["emergency"] * vehicle.emergency_brake_mps2
                assert scenario.cbtc.braking_mps2 <= service <= vehicle.max_service_brake_mps2  # type: ignore[attr-defined]
                assert scenario.cbtc.emergency_mps2 <= emergency <= vehicle.emergency_brake_mps2  # type: ignore[attr-defined]


def test_kinds_of_faults_can_be_chosen() -> None:
    chosen = SafetyParameters(kinds=("wheel_slip", "kill"))
    found = {kind for seed in SEEDS for kind in draw_safety(chosen, seed).facts["fault"].split("+")}
    assert found == {"wheel_slip", "kill", "none"}
    source = GENERATORS["safety"]
    for wrong in (["wheel_slip", "wheel_slip"], [], ["rain"]):
        with pytest.raises(InputError, match="kinds"):
            source.drawn({"kinds": wrong}, 1)
