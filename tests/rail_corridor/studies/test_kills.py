"""The study of kills, short of running it: what is drawn, and what is refused."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.equipment.ranging.layout import layout_of
from rail_corridor.equipment.train_radio.placement import bases_of
from rail_corridor.errors import InputError
from rail_corridor.loading.schema import parse_scenario
from rail_corridor.plan.plan import WORLD, make_plan
from rail_corridor.run.kills import FaultInjector, Kill, check_kills, parse_kill
from rail_corridor.studies.kills import (
    DURATION_S,
    KINDS,
    KillParameters,
    draw_kill,
    equipment_of,
)
from rail_corridor.study.sources import Drawn

SEEDS = range(40)
WRS = NodeSpec("wrs", "/wayside/wrs1", "wayside")
MEDIUM = NodeSpec("radio_medium", "/world/radio_medium", "world")
GROUPS = {"world": [NodeSpec("world", WORLD, "world"), MEDIUM], "wrs1": [WRS]}


def drawn(seed: int) -> Drawn:
    """Return what is drawn from a seed."""
    return draw_kill(KillParameters(), seed)


def test_a_case_depends_on_its_seed_alone() -> None:
    assert drawn(7) == drawn(7)
    assert drawn(7) != drawn(8)


def test_every_kind_dies_and_every_case_can_be_run() -> None:
    cases = [drawn(seed) for seed in SEEDS]
    assert set(Counter(case.facts["kind"] for case in cases)) == set(KINDS)
    assert 8 < sum("faults" in case.data for case in cases) < 32
    for case in cases:
        scenario = parse_scenario(case.data)
        (kill,) = case.kills
        assert kill.node in equipment_of(scenario)[case.facts["kind"]]
        assert kill.node == case.facts["node"]
        assert 0.0 < kill.time_s < DURATION_S - 20.0
        assert len(bases_of(scenario)) == 3
        starts_m = [train.start_m for train in scenario.trains]
        lengths_m = [train.vehicle.length_m for train in scenario.trains]
        for ahead_m, length_m, behind_m in zip(starts_m, lengths_m, starts_m[1:], strict=False):
            assert ahead_m - length_m - behind_m > 19.0
        assert len({layout_of(scenario).zone_at("main", at_m).name for at_m in starts_m}) == 3


def test_all_equipment_of_the_plan_can_be_drawn(tmp_path: Path) -> None:
    scenario = parse_scenario(drawn(1).data)
    planned = Counter(spec.name for spec in make_plan(scenario, tmp_path).nodes)
    killable = Counter(name for names in equipment_of(scenario).values() for name in names)
    assert planned == killable + Counter([WORLD])


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
