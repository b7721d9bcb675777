"""Giving readings to trains: nobody is swapped, nothing is guessed."""

from __future__ import annotations

import itertools

import pytest

from rail_wayside.ranging.association import RunningOrder, TrainCandidate, associate


def ways(*places_m: float) -> dict[tuple[int, int], float | None]:
    """Return the way from each reading to each other on one track."""
    pairs = itertools.permutations(range(len(places_m)), 2)
    return {(one, other): places_m[other] - places_m[one] for one, other in pairs}


def lost(train: int, *readings: int) -> TrainCandidate:
    return TrainCandidate(train, False, dict.fromkeys(readings, 0.5))


def followed(train: int, **misses: float) -> TrainCandidate:
    return TrainCandidate(train, True, {int(name[1:]): miss for name, miss in misses.items()})


def order_of(*trains: int) -> RunningOrder:
    """Return what is known when the trains were once seen in this order, the rear one first."""
    order = RunningOrder()
    for place, rear in enumerate(trains):
        for ahead, front in enumerate(trains[place + 1 :], start=1):
            order.learn(rear, front, 100.0 * ahead)
    return order


def test_a_followed_train_keeps_its_reading() -> None:
    candidates = [lost(0, 0), followed(1, r0=0.2)]
    assert associate(candidates, {}, RunningOrder()) == {1: 0}


def test_the_nearer_of_two_readings_is_that_of_a_followed_train() -> None:
    candidates = [followed(0, r0=0.7, r1=0.1)]
    assert associate(candidates, ways(0.0, 9.0), RunningOrder()) == {0: 1}


def test_a_lost_train_alone_is_found() -> None:
    assert associate([lost(0, 0)], {}, RunningOrder()) == {0: 0}


def test_one_reading_for_two_lost_trains_is_nobodys() -> None:
    assert associate([lost(0, 0), lost(1, 0)], {}, order_of(0, 1)) == {}


def test_two_readings_for_one_lost_train_are_not_its_own() -> None:
    assert associate([lost(0, 0, 1)], ways(0.0, 50.0), RunningOrder()) == {}


@pytest.mark.parametrize(("rear", "front"), [(0, 1), (1, 0)])
def test_two_lost_trains_are_found_in_the_order_they_were_in(rear: int, front: int) -> None:
    candidates = [lost(0, 0, 1), lost(1, 0, 1)]
    found = associate(candidates, ways(100.0, 300.0), order_of(rear, front))
    assert found == {rear: 0, front: 1}


def test_two_lost_trains_in_no_known_order_stay_lost() -> None:
    assert associate([lost(0, 0, 1), lost(1, 0, 1)], ways(0.0, 200.0), RunningOrder()) == {}


def test_a_lost_train_does_not_pass_one_that_is_followed() -> None:
    candidates = [followed(0, r0=0.1), lost(1, 1)]
    assert associate(candidates, ways(500.0, 300.0), order_of(0, 1)) == {0: 0}
    assert associate(candidates, ways(500.0, 700.0), order_of(0, 1)) == {0: 0, 1: 1}


def test_readings_on_different_branches_are_in_no_order() -> None:
    candidates = [followed(0, r0=0.1), lost(1, 1)]
    apart: dict[tuple[int, int], float | None] = {(0, 1): None, (1, 0): None}
    assert associate(candidates, apart, order_of(0, 1)) == {0: 0, 1: 1}


def test_an_order_is_forgotten_when_trains_part_at_a_junction() -> None:
    order = order_of(0, 1)
    order.learn(0, 1, None)
    assert order.allows(0, 1, -50.0) and order.allows(1, 0, -50.0)


def test_groups_that_share_no_reading_do_not_disturb_each_other() -> None:
    candidates = [lost(0, 0), lost(1, 1, 2), lost(2, 1, 2), lost(3, 3), lost(4, 3)]
    found = associate(candidates, ways(0.0, 300.0, 600.0, 900.0), order_of(0, 1, 2, 3, 4))
    assert found == {0: 0, 1: 1, 2: 2}


def test_a_chain_of_shared_readings_is_one_group() -> None:
    candidates = [lost(0, 0, 1), lost(1, 1, 2), lost(2, 2)]
    assert associate(candidates, ways(0.0, 300.0, 600.0), RunningOrder()) == {0: 0, 1: 1, 2: 2}
