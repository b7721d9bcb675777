"""A train that came in is held until it went on: rows of circuits, judged by where axles are."""

from __future__ import annotations

import itertools
import random

import pytest

from rail_wayside.track_code.sequence import CircuitState, SequenceHold

from .row_of_circuits import Row, Train

FREE = CircuitState(False, False, False)
TRAIN = CircuitState(True, True, True, True)


def run(row: Row, until_s: float, *, dead: tuple[int, ...] = ()) -> list[bool]:
    occupied: list[bool] = []
    while row.time_s < until_s - 1e-9:
        occupied = row.tick(dead=dead)
    return occupied


def unguarded_s(row: Row, train: Train, until_s: float) -> float:
    """Seconds in which the train is in a clear circuit, and none behind it is occupied."""
    bad_s = 0.0
    while row.time_s < until_s - 1e-9:
        under = [row.inside(train, index) for index in range(row.count)]
        occupied = row.tick()
        said = [index for index in range(row.count) if under[index] and not occupied[index]]
        bad_s += row.tick_s * any(not any(occupied[: index + 1]) for index in said)
    return bad_s


def test_a_train_that_shunts_leaves_nothing_behind() -> None:
    row = Row(10, 200.0, 0.25, [Train(150.0, 120.0, stops_m=1700.0)])
    assert run(row, 200.0) == [False] * 7 + [True, True, False]


@pytest.mark.parametrize("length_m", [60.0, 250.0, 390.0])
def test_a_train_that_shunts_nothing_for_a_while_is_held_and_let_go(length_m: float) -> None:
    for begin in range(20, 40, 3):
        train = Train(
            length_m + 10.0, length_m, stops_m=1790.0, fails=lambda s, b=begin: b <= s < b + 30
        )
        row = Row(12, 150.0, 0.25, [train])
        run(row, 10.0)
        assert unguarded_s(row, train, 180.0) == 0.0
        occupied = run(row, 181.0)
        assert occupied == [row.inside(train, index) for index in range(12)]


def test_random_trains_that_fail_to_shunt_are_guarded_and_leave_nothing() -> None:
    rng = random.Random(5)
    failed_in_two = 0
    for _ in range(30):
        length_m = rng.uniform(20.0, 400.0)
        begin_s, long_s = rng.uniform(10.0, 60.0), rng.uniform(5.0, 60.0)
        train = Train(
            length_m + rng.uniform(20.0, 80.0),
            length_m,
            speed_mps=rng.uniform(3.0, 22.0),
            fails=lambda s, b=begin_s, e=begin_s + long_s: b <= s < e,
        )
        circuit_m = rng.choice([100.0, 150.0, 300.0, 500.0])
        row = Row(14, circuit_m, rng.choice([0.1, 0.5, 1.0]), [train])
        train.stops_m = 13.0 * circuit_m - 1.0
        run(row, begin_s)
        failed_in_two += sum(row.inside(train, index) for index in range(14)) > 1
        assert unguarded_s(row, train, 130.0) == 0.0
        run(row, 500.0 if train.speed_mps > 12.0 else 1500.0)
        occupied = run(row, row.time_s + 5.0)
        assert occupied == [row.inside(train, index) for index in range(14)]
    assert failed_in_two > 5


def test_a_dead_transmitter_under_a_train_leaves_nothing() -> None:
    train = Train(150.0, 120.0, stops_m=1700.0)
    row = Row(10, 200.0, 0.25, [train])
    run(row, 20.0)
    occupied = run(row, 60.0, dead=(2,))  # the train runs through it
    assert occupied[2]
    assert train.front_m - train.length_m > 600.0
    assert run(row, 200.0) == [False] * 7 + [True, True, False]


def test_two_circuits_that_fail_one_after_the_other_hold_no_train() -> None:
    row = Row(8, 200.0, 0.25)
    run(row, 10.0)
    run(row, 20.0, dead=(3,))
    run(row, 40.0, dead=(3, 4))
    run(row, 50.0, dead=(4,))
    assert run(row, 55.0) == [False] * 8


def test_a_fault_ahead_of_a_standing_train_leaves_nothing() -> None:
    row = Row(8, 200.0, 0.25, [Train(350.0, 100.0, speed_mps=0.0)])
    run(row, 10.0)
    run(row, 30.0, dead=(2,))
    assert run(row, 40.0) == [False, True] + [False] * 6


def test_what_befalls_two_circuits_at_once_is_no_train() -> None:
    row = Row(8, 200.0, 0.25)
    run(row, 10.0)
    run(row, 30.0, dead=(3, 4))
    assert run(row, 40.0) == [False] * 8


def test_a_train_found_past_a_circuit_that_was_switched_off_is_let_go() -> None:
    train = Train(150.0, 120.0, stops_m=1700.0, fails=lambda s: 15.0 <= s < 50.0)
    row = Row(10, 200.0, 0.25, [train])
    run(row, 49.0)
    assert not any(row.inside(train, index) for index in range(3))
    while row.time_s < 60.0:
        row.tick(off=(3,))
    assert run(row, 200.0) == [False] * 7 + [True, True, False]


def test_what_was_switched_on_under_a_train_that_shunts_holds_it() -> None:
    row = Row(6, 200.0, 0.25, [Train(500.0, 80.0, speed_mps=0.0, fails=lambda s: s >= 10.0)])
    run(row, 10.0)
    assert run(row, 100.0) == [False, False, True, False, False, False]


def test_the_last_circuit_holds_nothing() -> None:
    last = SequenceHold(0.25)
    for behind, detected in itertools.chain([(FREE, False)] * 9, [(TRAIN, False)] * 8):
        last.update(detected=detected, shunted=False, behind=behind, ahead=())
    assert last.update(detected=True, shunted=True, behind=TRAIN, ahead=()).holds
    assert not last.update(detected=False, shunted=False, behind=FREE, ahead=()).occupied
