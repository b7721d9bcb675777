"""The kill campaign, short of running it: what is drawn, what is refused, and what is judged."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.train_radio.placement import bases_of
from rail_corridor.errors import InputError
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.plan.plan import WORLD, make_plan
from rail_corridor.run.kills import FaultInjector, Kill, check_kills, parse_kill
from rail_corridor.studies.kill_scenarios import (
    DURATION_S,
    KINDS,
    TICK_S,
    TRAINS,
    draw_case,
    equipment_of,
)
from rail_corridor.studies.kills import row_of

SEEDS = range(40)
WRS = NodeSpec("wrs", "/wayside/wrs1", "wayside")
MEDIUM = NodeSpec("radio_medium", "/world/radio_medium", "world")
GROUPS = {"world": [NodeSpec("world", WORLD, "world"), MEDIUM], "wrs1": [WRS]}


def report_of(**changes: Any) -> dict[str, Any]:
    """Report of a good run; changes go into the sections of the last train."""
    trains = {}
    for name in TRAINS:
        cbtc = {"forged_accepted": 0, "mislocated": 0}
        atp = {
            "interventions": 1,
            "emergency_brakes": 0,
            "overspeed_s": 0.0,
            "passed_authority": 0,
            "margin_min_m": None if name == "first" else 30.0,
        }
        trains[name] = {"distance_m": 500.0, "atp": atp, "cbtc": cbtc}
    for section in ("atp", "cbtc"):
        part = trains["third"][section]
        assert isinstance(part, dict)
        part.update({key: value for key, value in changes.items() if key in part})
    node = changes.get("failed", draw_case(1).kill.node)
    return {
        "complete": True,
        "ticks": round(DURATION_S / TICK_S),
        "failures": [{"node": node}],
        "trains": trains,
    } | {key: value for key, value in changes.items() if key == "ticks"}


def test_a_case_depends_on_its_seed_alone() -> None:
    assert draw_case(7) == draw_case(7)
    assert draw_case(7) != draw_case(8)


def test_every_kind_dies_and_every_case_can_be_run() -> None:
    cases = [draw_case(seed) for seed in SEEDS]
    assert set(Counter(case.kind for case in cases)) == set(KINDS)
    assert 8 < sum("faults" in case.data for case in cases) < 32
    for case in cases:
        scenario = parse_scenario(case.data)
        assert case.kill.node in equipment_of(scenario)[case.kind]
        assert 0.0 < case.kill.time_s < DURATION_S - 20.0
        assert len(bases_of(scenario)) == 3
        starts_m = [train.start_m for train in scenario.trains]
        lengths_m = [train.vehicle.length_m for train in scenario.trains]
        for ahead_m, length_m, behind_m in zip(starts_m, lengths_m, starts_m[1:], strict=False):
            assert ahead_m - length_m - behind_m > 19.0
        assert len({layout_of(scenario).zone_at("main", at_m).name for at_m in starts_m}) == 3


def test_all_equipment_of_the_plan_can_be_drawn(tmp_path: Path) -> None:
    scenario = parse_scenario(draw_case(1).data)
    planned = Counter(spec.name for spec in make_plan(scenario, tmp_path).nodes)
    drawn = Counter(name for names in equipment_of(scenario).values() for name in names)
    assert planned == drawn + Counter([WORLD])


def test_a_good_run_is_no_violation() -> None:
    row = row_of(draw_case(1), report_of())
    assert row.violations == ()
    assert (row.least_gap_m, row.braked, row.touched) == (30.0, 3, False)


@pytest.mark.parametrize(
    ("changes", "violation"),
    [
        ({"passed_authority": 1}, "passed its end of authority"),
        ({"margin_min_m": 0.0}, "touched another train"),
        ({"margin_min_m": -3.0}, "touched another train"),
        ({"overspeed_s": 0.25}, "overspeed"),
        ({"forged_accepted": 1}, "authority that nobody gave"),
        ({"mislocated": 2}, "wrong place believed"),
        ({"ticks": 100}, "did not go on"),
        ({"failed": "/another"}, "the dead node was not missed"),
    ],
)
def test_what_must_not_happen_is_seen(changes: dict[str, Any], violation: str) -> None:
    assert row_of(draw_case(1), report_of(**changes)).violations == (violation,)


@pytest.mark.parametrize("text", ["", "x", "@3", "/a@", "/a@x", "/a@-1", "/a@nan", "/a@inf", "@"])
def test_a_kill_is_a_node_and_a_time(text: str) -> None:
    with pytest.raises(InputError, match=r"--kill: .*: must be NODE@SECONDS"):
        parse_kill(text)


def test_a_kill_is_read() -> None:
    assert parse_kill("/first/atp@12.5") == Kill("/first/atp", 12.5)


@pytest.mark.parametrize(
    ("node", "one", "reason"),
    [
        ("/wayside/wrs9", True, "no such node runs here, did you mean /wayside/wrs1"),
        (WORLD, True, "nothing goes on without the world"),
        (MEDIUM.name, False, "shares a process with the world"),
        (MEDIUM.name, True, ""),
        (WRS.name, False, ""),
    ],
)
def test_what_cannot_be_killed_is_refused(node: str, one: bool, reason: str) -> None:
    if not reason:
        check_kills([Kill(node, 1.0)], GROUPS, WORLD, one=one)
        return
    with pytest.raises(InputError, match=reason):
        check_kills([Kill(node, 1.0)], GROUPS, WORLD, one=one)


def test_each_is_killed_once_in_the_first_tick_that_is_due() -> None:
    dead: list[tuple[str, int]] = []
    now_ns = 0
    executioner = FaultInjector(
        [Kill("b", 1.0), Kill("a", 0.3)], lambda name: dead.append((name, now_ns))
    )
    for now_ns in range(0, 2_000_000_000, 250_000_000):
        executioner.tick(now_ns)
    assert dead == [("a", 500_000_000), ("b", 1_000_000_000)]
