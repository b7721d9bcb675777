"""Track circuits: where they lie, what each must know of those ahead, what is refused."""

from __future__ import annotations

import copy
import itertools
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.equipment.track_code.nodes import circuits_ahead
from rail_corridor.equipment.track_code.placement import circuits_of
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario, scenario_from_data
from rail_corridor.plan.plan import make_plan
from rail_corridor.scenario.model import Scenario
from rail_corridor.yaml_file import load_yaml

DATA = load_yaml(builtin_scenarios()["follow_codes"])


def made(**changes: Any) -> Scenario:
    data = copy.deepcopy(DATA)
    for name, value in changes.items():
        data[name] = value
    return scenario_from_data(data, directory=Path())


def test_circuits_cover_the_track_once_with_carriers_in_turn() -> None:
    scenario = made()
    circuits = circuits_of(scenario)
    assert circuits[0].start_m == 0.0
    assert circuits[-1].end_m == scenario.network.tracks["main"].length_m
    for one, other in itertools.pairwise(circuits):
        assert one.end_m == other.start_m
        assert one.carrier_hz != other.carrier_hz
    assert max(circuit.length_m for circuit in circuits) <= 500.0


def test_a_circuit_has_the_worst_limit_and_gradient_in_it() -> None:
    # Falls by 12 permil from 1200 to 2200 m, 80 km/h from 2350 to 3000 m, circuits of 500 m.
    # The rear of a train is still under what its front has left.
    scenario = made()
    circuits = circuits_of(scenario)
    train_m = max(train.vehicle.length_m for train in scenario.trains)
    falling = [c for c in circuits if c.start_m - train_m < 2200.0 and c.end_m > 1200.0]
    assert {c.gradient_permil for c in falling} == {-12.0}
    assert {c.gradient_permil for c in circuits if c not in falling} == {0.0}
    slow = [c for c in circuits if c.start_m - train_m < 3000.0 and c.end_m > 2350.0]
    assert {round(3.6 * c.limit_mps) for c in slow} == {80}
    assert {round(3.6 * c.limit_mps) for c in circuits if c not in slow} == {100}


def test_a_circuit_knows_those_it_takes_to_stop_twice() -> None:
    scenario = made()
    plan = scenario.track_circuits
    assert plan is not None
    ahead = circuits_ahead(scenario, plan, circuits_of(scenario)[0])
    assert [c.name for c in ahead] == [c.name for c in circuits_of(scenario)[1 : 1 + len(ahead)]]
    fastest_mps = max(c.limit_mps for c in circuits_of(scenario))
    assert sum(c.length_m for c in ahead) > fastest_mps**2 / plan.braking_mps2
    assert circuits_ahead(scenario, plan, circuits_of(scenario)[-1]) == []


def test_the_plan_has_a_node_for_every_circuit_and_two_for_every_train(tmp_path: Path) -> None:
    scenario = made()
    plan = make_plan(scenario, tmp_path)
    names = {spec.name for spec in plan.nodes}
    assert {f"/wayside/{c.name}/track_code" for c in circuits_of(scenario)} <= names
    assert {"/leader/track_code", "/follower/code_supervision", "/world/rail_medium"} <= names
    (world,) = (spec for spec in plan.nodes if spec.kind == "world")
    assert world.parameters["supervised"] == ("leader", "follower")
    assert "/world/rail_medium" in world.parameters["sinks"]
    without = make_plan(load_scenario("plain_line"), tmp_path)
    assert not any("track_code" in spec.kind for spec in without.nodes)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"track_circuits": {"length_m": 10}}, "track_circuits.length_m: 10"),
        ({"track_circuits": {"carriers_hz": [1700, 1700]}}, "track_circuits.carriers_hz"),
        ({"track_circuits": {"carriers_hz": [1700, 1800]}}, "track_circuits.carriers_hz.1: 1800"),
        ({"track_circuits": {"sample_rate_hz": 16001}}, "track_circuits.sample_rate_hz: 16001"),
        ({"track_circuits": {"sample_rate_hz": 4096}}, "track_circuits.sample_rate_hz: 4096"),
        (
            {"track_circuits": {"sample_rate_hz": 16128}, "tick_s": 0.23},
            "track_circuits.sample_rate_hz: 16128",
        ),
        ({"faults": [{"kind": "sanding", "train": "nobody"}]}, "faults.0.train: 'nobody'"),
        ({"faults": [{"kind": "dead_transmitter", "circuit": "tc99"}]}, "faults.0.circuit: 'tc99'"),
        (
            {"track_circuits": None, "faults": [{"kind": "sanding", "train": "leader"}]},
            "faults.0.kind: 'sanding'",
        ),
        ({"track_circuits": {"lenght_m": 500}}, "did you mean length_m"),
    ],
)
def test_what_does_not_fit_is_one_line(changes: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError) as found:
        made(**changes)
    assert line in str(found.value)
    assert "\n" not in str(found.value)


def test_junctions_and_reversals_are_refused() -> None:
    with pytest.raises(InputError, match="do not go with junctions"):
        data = load_yaml(builtin_scenarios()["demo"])
        scenario_from_data({**data, "track_circuits": {}}, directory=Path())
    trains = copy.deepcopy(DATA["trains"])
    trains[0]["direction"] = -1
    with pytest.raises(InputError, match="increasing chainage only"):
        made(trains=trains)
