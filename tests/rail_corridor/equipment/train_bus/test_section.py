"""The train bus in scenarios: what is planned, what is refused, what the report makes of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rail_corridor.equipment.train_bus.nodes import most_traces
from rail_corridor.equipment.train_bus.report import bus_metrics
from rail_corridor.equipment.train_bus.section import SIZES, BusFault
from rail_corridor.equipment.train_bus.world import bus_description, bus_trains, place_of_fault
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import builtin_scenarios, load_scenario, scenario_from_data
from rail_corridor.plan.plan import Plan, make_plan, run_data_of
from rail_corridor.run_data import RunData
from rail_corridor.scenario.model import Scenario
from rail_msgs_py.topics.train_bus import BUS_LINK, BUS_LINKS, BUS_STATE
from rail_msgs_py.topics.world import STATE
from rail_signals.train_bus.faults import KINDS
from rail_signals.train_bus.frame import bit_error_rate

GOOD: dict[str, Any] = yaml.safe_load(builtin_scenarios()["failing_bus"].read_text())
PLACED = {"at_m": 60.0}


def scenario(**changes: Any) -> Scenario:
    return scenario_from_data({**GOOD, **changes}, directory=Path())


def with_fault(**fields: Any) -> Scenario:
    given = {"kind": "bus_fault", "train": "train_a", "from_s": 1, "to_s": 2, **fields}
    return scenario(faults=[given])


def plan_of(tmp_path: Path, made: Scenario) -> Plan:
    return make_plan(made, tmp_path)


def test_every_train_with_a_bus_has_two_terminals_and_a_monitor(tmp_path: Path) -> None:
    trains = [
        {"name": name, "route": ["main"], "start_m": start_m}
        for name, start_m in (("a", 1500), ("b", 900), ("c", 300))
    ]
    bus = {**GOOD["train_bus"], "trains": ["c", "a"], "period_s": 10.0}
    made = scenario(trains=trains, train_bus=bus, faults=[])
    assert bus_trains(made) == ("a", "c")
    plan = plan_of(tmp_path, made)
    specs = {spec.name: spec for spec in plan.nodes if "bus" in spec.kind}
    assert sorted(specs) == [
        *(f"/a/{name}" for name in ("bus_head", "bus_tail", "train_bus_monitor")),
        *(f"/c/{name}" for name in ("bus_head", "bus_tail", "train_bus_monitor")),
        "/world/bus_medium",
    ]
    # They measure one after the other.
    offsets = [specs[f"/{name}/train_bus_monitor"].parameters["offset_s"] for name in "ac"]
    assert offsets == [0.0, 5.0]
    (world,) = (spec for spec in plan.nodes if spec.kind == "world")
    assert "/world/bus_medium" in world.parameters["sinks"]
    stations = sum(spec.kind == "wrs" for spec in plan.nodes)
    assert world.parameters["clock_readers"] == stations + 1 + len(specs)


def test_without_the_section_there_is_none_of_it(tmp_path: Path) -> None:
    made = scenario(train_bus=None, faults=[])
    assert bus_description(made) is None
    assert bus_trains(made) == ()
    assert not [spec for spec in plan_of(tmp_path, made).nodes if "bus" in spec.kind]


def test_a_long_train_takes_fewer_traces_at_a_time() -> None:
    bus = {**GOOD["train_bus"], "cars": ["CM2"] * 18, "traces": 64}
    made = scenario(train_bus=bus, faults=[])
    assert made.train_bus is not None
    assert 4 <= most_traces(made.train_bus) < 64


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_fault_has_a_place_and_a_size(kind: str) -> None:
    where = {
        "wrong_cable": {"car": 3},
        "missing_shield_ground": {"car": 3},
        "loose_connector": {"coupler": 2},
    }.get(kind, PLACED)
    made = with_fault(fault=kind, **where)
    (fault,) = made.faults
    assert isinstance(fault, BusFault)
    assert fault.full_size == SIZES.get(kind, 1.0)
    assert place_of_fault(made, fault) == (60.0 if where is PLACED else 94.0)
    described = bus_description(made)
    assert described is not None
    assert described.trains[0].fault is not None
    assert described.trains[0].fault.fault == kind


def bus(**changes: Any) -> dict[str, Any]:
    return {"train_bus": {**GOOD["train_bus"], **changes}, "faults": []}


def fault(**fields: Any) -> dict[str, Any]:
    given = {"kind": "bus_fault", "train": "train_a", "from_s": 1, "to_s": 2, **fields}
    return {"faults": [given]}


BAD = {
    "unknown profile": (bus(cars=["CM2", "CM9"]), "train_bus.cars.1: 'CM9': "),
    "no cars": (bus(cars=[]), "train_bus.cars: \\[\\]: "),
    "unknown train": (bus(trains=["x"]), "train_bus.trains.0: 'x': there is no such train"),
    "train twice": (
        bus(trains=["train_a", "train_a"]),
        "train_bus.trains: .*: a train comes twice",
    ),
    "odd samples": (bus(samples_per_bit=7), "train_bus.samples_per_bit: 7: must be even"),
    "slow edges": (bus(rise_time_s=6e-7), "train_bus.rise_time_s: 6e-07: must be from 0 to half"),
    "frames too long": (bus(bit_rate_hz=2000), "train_bus.bit_rate_hz: 2000.0: a frame lasts"),
    "period too short": (bus(period_s=0.1), "train_bus.period_s: 0.1: is shorter than a tick"),
    "NaN": (bus(noise_v=float("nan")), "train_bus.noise_v: nan"),
    "edge too fast": (
        bus(reflectometer_rise_s=1e-12),
        "train_bus.reflectometer_rise_s: 1e-12: makes a trace of this train too long",
    ),
    "no bus": ({"train_bus": None}, "faults.0.kind: 'bus_fault': goes with train_bus"),
    "no such train": (fault(fault="open", at_m=1, train="b"), "faults.0.train: 'b': no such train"),
    "no such kind": (fault(fault="rust", at_m=1), "faults.0.fault: 'rust': must be 'open'"),
    "no place": (fault(fault="short"), "faults.0.at_m: .*: short needs it"),
    "wrong place": (
        fault(fault="short", at_m=1, car=2),
        "faults.0.car: 2: does not go with short",
    ),
    "off the cable": (fault(fault="open", at_m=500), "faults.0.at_m: 500.0: is not inside"),
    "at the very head": (fault(fault="open", at_m=0), "faults.0.at_m: 0.0: is not inside"),
    "no such car": (fault(fault="wrong_cable", car=6), "faults.0.car: 6: the train has 5 cars"),
    "no such coupler": (
        fault(fault="loose_connector", coupler=5),
        "faults.0.coupler: 5: the train has 4 couplers",
    ),
    "no such cable": (fault(fault="wrong_cable", car=2, cable="rope"), "faults.0.cable: 'rope'"),
    "wet beyond the car": (
        fault(fault="water_ingress", at_m=45, length_m=5),
        "faults.0.length_m: 5.0: what is wet must lie in one car, whose cable ends at 47 m",
    ),
    "no duration": (
        fault(fault="open", at_m=1, from_s=2),
        "faults.0.to_s: 2: must be after from_s, 2 s",
    ),
    "nothing": (fault(fault="bad_splice", at_m=1, size=0), "faults.0.size: 0"),
    "two": (
        {
            "faults": [
                *fault(fault="open", at_m=1)["faults"],
                *fault(fault="open", at_m=1)["faults"],
            ]
        },
        "faults.1.train: 'train_a': its bus has another fault already",
    ),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_is_wrong_is_one_line(kind: str) -> None:
    changes, line = BAD[kind]
    with pytest.raises(InputError, match=f"^{line}") as caught:
        scenario(**changes)
    assert str(caught.value).isprintable()


def recorded(made: Scenario) -> RunData:
    """Twenty ticks: a report in tick 6 (confirmed, worse in 10), losses from tick 12 on."""
    recording = run_data_of(made)
    link = dict.fromkeys(BUS_LINK.columns, 0.0)
    state = dict.fromkeys(BUS_STATE.columns, np.nan)
    for tick in range(20):
        lost = max(0, tick - 11)
        known = {"sent": tick + 1, "received": tick + 1 - lost, "lost": lost}
        bits = {"bits": 128.0 * (tick + 1), "bit_errors": 2.0 * lost}
        for end, confirmed in (("head", tick < 15), ("tail", True)):
            row = link | known | bits | {"other_end": float(confirmed)}
            recording[BUS_LINK, end].put(tick, 0, np.array(list(row.values())))
        kind = 7.0 if tick >= 6 else 0.0
        row = state | {"measurements": tick + 1.0, "interpretations": 3.0, "kind": kind}
        row |= {"level": 0.0 if tick < 6 else 1.0 if tick < 10 else 2.0}
        row |= {"place_m": 121.5, "size": 5.0 * tick} if kind else {}
        recording[BUS_STATE].put(tick, 0, np.array(list(row.values())))
        recording[BUS_LINKS].put(tick, 0, np.array([0.1, 8.0, 10.0]))
        recording[STATE].put(tick, 0, np.zeros(10))
    assert len(BUS_LINKS.columns) == 3
    return recording


def test_the_report_counts_frames_and_times_what_the_monitor_said() -> None:
    made = with_fault(fault="loose_connector", coupler=3)
    found = bus_metrics(made, recorded(made), 0)["train_bus"]
    assert (found["frames"], found["lost"]) == (40, 16)
    assert (found["bits"], found["bit_errors"]) == (5120, 32)
    assert found["bit_error_rate"] == 32 / 5120
    expected = bit_error_rate(10.0 ** np.array([0.8, 1.0]))
    assert found["bit_error_rate_bound"] == pytest.approx(float(np.mean(expected)))
    assert found["first_loss_s"] == 12 * 0.25
    assert found["end_not_confirmed_s"] == 5 * 0.25
    assert [(r["time_s"], r["kind"], r["level"]) for r in found["faults"]] == [
        (1.5, "loose_connector", "warn"),
        (2.5, "loose_connector", "error"),
    ]
    assert found["faults"][0]["place_error_m"] == pytest.approx(0.5)
    assert (found["reported_s"], found["reported_before_first_loss_s"]) == (1.5, 1.5)
    assert found["false_reports"] == 0


def test_what_is_said_of_a_healthy_bus_is_false() -> None:
    made = scenario(faults=[])
    found = bus_metrics(made, recorded(made), 0)["train_bus"]
    assert found["false_reports"] == 2
    assert found["reported_s"] is found["reported_before_first_loss_s"] is None
    assert found["faults"][0]["place_error_m"] is None


def test_the_bus_is_part_of_the_digest_its_truth_is_not() -> None:
    made = scenario(faults=[])
    digest = recorded(made).digest()
    other = recorded(made)
    other[BUS_LINKS].put(3, 0, np.zeros(3))
    assert other.digest() == digest
    for record in (other[BUS_LINK, "head"], other[BUS_LINK, "tail"], other[BUS_STATE]):
        record.put(3, 0, np.zeros(record.upto(1).shape[2]))
        assert other.digest() != digest
        digest = other.digest()


def test_the_built_in_scenario_is_good() -> None:
    assert load_scenario("failing_bus").train_bus is not None
