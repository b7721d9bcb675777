"""Equipment that a scenario switches off: every kind of node, in every placement."""

from __future__ import annotations

from typing import Any

import pytest

from rail_corridor.equipment.off_times import off_times
from rail_corridor.errors import InputError
from rail_corridor.loading.loader import scenario_from_data
from rail_corridor.plan.plan import WORLD, make_plan
from rail_msgs_py.topics.ranging import POSITION
from rail_testing.plugin import CorridorFactory as Make

TRACK = {
    "elements": [{"straight_m": 3000}],
    "speed_limits": [[0, 80]],
    "stops_m": [2900],
}
BUS = {"cars": [{"count": 4}]}
BY_RADIO: dict[str, Any] = {
    "name": "by_radio",
    "seed": 5,
    "duration_s": 9.0,
    "tick_s": 0.25,
    "tracks": {"main": TRACK},
    "stations": {"zone_length_m": 350.0},
    "cbtc": {"base_spacing_m": 1000},
    "references": {"spacing_m": 500},
    "localizer": {},
    "train_bus": {},
    "trains": [{"name": "b", "route": ["main"], "start_m": 700}],
    "faults": [{"kind": "threat", "threats": ["delay"], "rate": 0.1}],
}
BY_CODES: dict[str, Any] = {
    **{key: value for key, value in BY_RADIO.items() if key not in ("cbtc", "faults")},
    "name": "by_codes",
    "track_circuits": {"length_m": 500},
}


def with_off_times(data: dict[str, Any], tmp_path: Any) -> dict[str, Any]:
    """The scenario in which one node of every kind is switched off, one after the other."""
    plan = make_plan(scenario_from_data(data, directory=tmp_path), tmp_path)
    kinds = {spec.kind: spec.name for spec in plan.nodes if spec.name != WORLD}
    off = [
        # At edges of ticks and between them.
        {"kind": "equipment_off", "node": name, "from_s": 1.0 + 0.3 * n, "to_s": 2.05 + 0.3 * n}
        for n, name in enumerate(kinds.values())
    ]
    return {**data, "faults": [*data.get("faults", ()), *off]}


@pytest.mark.parametrize("data", [BY_RADIO, BY_CODES], ids=lambda data: data["name"])
def test_every_kind_of_node_is_switched_off_alike_in_every_placement(
    corridor: Make, tmp_path: Any, data: dict[str, Any]
) -> None:
    scenario = with_off_times(data, tmp_path)
    outcomes = {p: corridor(scenario, placement=p).run_to_end() for p in ("one", "site")}
    undisturbed = corridor(data).run_to_end()
    digests = {outcome.digest for outcome in outcomes.values()}
    assert len(digests) == 1
    assert undisturbed.digest not in digests
    for outcome in outcomes.values():
        report = outcome.report
        assert report["failures"] == [] and report["missing_ticks"] == 0
        said = {
            event["name"].removesuffix(": equipment")
            for event in report["events"]
            if event["message"].startswith("switched off from ")
        }
        assert said == {f["node"] for f in scenario["faults"] if f["kind"] == "equipment_off"}


def test_off_times_that_overlap_or_touch_are_one(tmp_path: Any) -> None:
    times = [(5, 6), (1, 3), (2, 4), (4, 4.5), (7, 9), (7.5, 8)]
    faults = [{"kind": "equipment_off", "node": "/b/atp", "from_s": a, "to_s": b} for a, b in times]
    scenario = scenario_from_data({**BY_RADIO, "faults": faults}, directory=tmp_path)
    assert off_times(scenario) == {"/b/atp": [(1.0, 4.5), (5.0, 6.0), (7.0, 9.0)]}


@pytest.mark.parametrize(
    ("node", "reason"),
    [
        ("/b/apt", "no such node, did you mean /b/atp"),
        ("/world", "is no equipment that could be switched off"),
        ("/report", "is no equipment that could be switched off"),
    ],
)
def test_what_cannot_be_switched_off_is_refused(tmp_path: Any, node: str, reason: str) -> None:
    fault = {"kind": "equipment_off", "node": node, "from_s": 1, "to_s": 2}
    with pytest.raises(InputError) as caught:
        scenario_from_data({**BY_RADIO, "faults": [fault]}, directory=tmp_path)
    assert caught.value.field == "faults.0.node"
    assert reason in str(caught.value)


def test_an_off_time_is_injected(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    c.run_for(3.0)
    ranges = c.topic("/wayside/wrs1/zone1/range")
    assert ranges.latest.usable
    c.inject({"kind": "equipment_off", "node": "/wayside/wrs1", "to_s": 4.0})
    c.step(2)
    assert not ranges.latest.usable
    c.run_for(1.0)
    assert ranges.latest.usable


def test_a_zone_controller_forgets_its_trains(corridor: Make) -> None:
    fault = {"kind": "equipment_off", "node": "/wayside/zone_controller", "from_s": 4, "to_s": 5}
    c = corridor({**BY_RADIO, "faults": [fault]})
    position = c.topic(POSITION.name(train="b"))
    known = []
    for _ in range(24):
        c.step()
        known.append(position.latest.variance_m2 < 1e3)
    assert known[8:16] == [True] * 8
    assert known[16:20] == [False] * 4
    authority = c.topic("/wayside/zone_controller/b/authority")
    assert authority.count == 24


def test_a_restarted_zone_controller_takes_no_train_for_another(corridor: Make) -> None:
    """All have run on from where they entered: they are who they say they are."""
    trains = [{"name": n, "route": ["main"], "start_m": m} for n, m in (("a", 1100), ("b", 700))]
    fault = {"kind": "equipment_off", "node": "/wayside/zone_controller", "from_s": 22, "to_s": 23}
    data = {**BY_RADIO, "trains": trains, "faults": [fault], "duration_s": 30.0}
    for name in ("localizer", "references", "train_bus"):
        data.pop(name)
    c = corridor(data)
    c.run_for(23.0)
    known = dict.fromkeys("ab", 0)
    for _ in range(28):
        c.step()
        for train in known:
            position = c.topic(POSITION.name(train=train)).latest
            if position.variance_m2 < 1e3:
                known[train] += 1
                truth = c.truth(train)
                error_m = abs(position.chainage_m - truth.front_m)
                assert error_m < 3.0, (train, position, truth)
    assert min(known.values()) > 10
