"""Safety and liveness under faults at random times, with the equipment's own pure classes."""

from __future__ import annotations

import pytest

from .pure_corridor import PureCorridor, PureFault, draw_faults

#: Ways that a place was wrong by are below what authorities keep behind a train.
SINGLE, DOUBLE = range(0, 12), range(1000, 1008)


@pytest.mark.parametrize("seed", SINGLE)
def test_after_a_single_fault_every_train_goes_on(seed: int) -> None:
    verdict = PureCorridor(seed=seed, faults=draw_faults(seed, 1)).run()
    assert (verdict.collisions, verdict.passed_ends, verdict.stuck) == (0, 0, [])
    assert verdict.mislocated == 0


@pytest.mark.parametrize("seed", DOUBLE)
def test_after_two_faults_every_train_goes_on(seed: int) -> None:
    verdict = PureCorridor(seed=seed, faults=draw_faults(seed, 2)).run()
    assert (verdict.collisions, verdict.passed_ends, verdict.stuck) == (0, 0, [])
    assert verdict.mislocated == 0


def test_a_fault_that_does_not_end_is_seen_as_stuck() -> None:
    corridor = PureCorridor(faults=[PureFault("atp", 20.0, 30.0, 2)])
    corridor.faults = (*corridor.faults, PureFault("atp", 20.0, 1e6, 1))
    corridor.run_until(100.0)
    before_m = [train.s_m for train in corridor.trains]
    corridor.run_until(200.0)
    assert corridor.trains[0].s_m == before_m[0]
    assert corridor.verdict.collisions == 0


def test_a_train_restarted_in_a_hole_is_told_where_it_is_by_the_controller() -> None:
    faults = [PureFault("atp", 40.0, 45.0, 2), PureFault("vrs", 38.0, 75.0, 2)]
    corridor = PureCorridor(faults=faults)
    corridor.run_until(45.5)
    train = corridor.trains[1]
    assert train.protection is not None
    assert train.protection.state_values(45_000_000_000)[4] == float("inf")
    held_m = train.s_m
    corridor.run_until(60.0)
    assert train.s_m > held_m
    assert corridor.run().stuck == []
    assert (corridor.verdict.collisions, corridor.verdict.mislocated) == (0, 0)


def test_a_controller_restarted_gives_nothing_until_old_authorities_are_over_and_trains_stand() -> (
    None
):
    corridor = PureCorridor(faults=[PureFault("zone_controller", 50.0, 51.0)])
    corridor.run_until(51.0)
    moved_m = [train.s_m for train in corridor.trains]
    corridor.step()
    while (
        corridor.issuer is not None
        and corridor.issuer.authority_state(1, 0)[0] != (corridor.issuer.authority_state(1, 0)[0])
    ):
        corridor.step()
        assert corridor.time_s < 120.0
    assert corridor.time_s > 51.0 + 3.0
    verdict = corridor.run()
    assert verdict.stuck == [] and verdict.collisions == 0
    assert all(t.s_m > m for t, m in zip(corridor.trains, moved_m, strict=True))


def test_a_train_that_nobody_knows_runs_on_sight_when_a_person_releases_it() -> None:
    """Controller and protection were both restarted, and the train cannot be ranged."""
    faults = [
        PureFault("zone_controller", 50.0, 55.0),
        PureFault("atp", 50.0, 55.0, 2),
        PureFault("vrs", 45.0, 160.0, 2),
    ]
    corridor = PureCorridor(faults=faults, releases=[(2, 100.0)])
    corridor.run_until(100.0)
    held_m = corridor.trains[1].s_m
    corridor.run_until(99.0)
    assert all(train.speed_mps == 0.0 for train in corridor.trains)
    corridor.run_until(130.0)
    assert corridor.trains[1].command.on_sight
    assert held_m + 20.0 < corridor.trains[1].s_m <= held_m + 30.0 * 15.0 / 3.6
    assert corridor.verdict.collisions == 0
