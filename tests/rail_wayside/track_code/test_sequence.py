"""A train that came in is held until it went on."""

from __future__ import annotations

from rail_wayside.track_code.sequence import CircuitState, SequenceHold

FREE = CircuitState(False, False, False)
TRAIN = CircuitState(True, True, True)
FAULT = CircuitState(True, True, False)


def tick(
    hold: SequenceHold,
    detected: bool,
    behind: CircuitState | None,
    *ahead: CircuitState | None,
    ticks: int = 8,
) -> CircuitState:
    for _ in range(ticks):
        state = hold.update(detected=detected, shunted=detected, behind=behind, ahead=ahead)
    return state


def entered(*ahead: CircuitState) -> SequenceHold:
    """Return a circuit that a train came into from the one behind."""
    hold = SequenceHold(0.25)
    tick(hold, False, FREE, *ahead)
    tick(hold, False, TRAIN, *ahead)
    assert tick(hold, True, TRAIN, *ahead).holds
    return hold


def test_a_train_that_vanishes_is_held() -> None:
    hold = entered(FREE, FREE)
    tick(hold, True, FREE, FREE, FREE)
    assert tick(hold, False, FREE, FREE, FREE, ticks=400).occupied


def test_a_train_that_goes_on_is_let_go() -> None:
    hold = entered(FREE, FREE)
    tick(hold, True, FREE, TRAIN, FREE)
    assert not tick(hold, False, FREE, TRAIN, FREE, ticks=1).occupied


def test_a_train_in_two_circuits_that_shunts_neither_is_held() -> None:
    hold = entered(FREE, FREE)
    tick(hold, False, FAULT, FREE, FREE, ticks=1)
    assert tick(hold, False, FREE, FREE, FREE, ticks=40).holds


def test_a_fault_ahead_of_a_standing_train_leaves_nothing_behind() -> None:
    hold = entered(FREE, FREE)  # the transmitter was dead, the train never came
    assert not tick(hold, False, TRAIN, FREE, FREE).occupied


def test_a_lost_train_that_appears_farther_ahead_is_let_go() -> None:
    hold = entered(FREE, FREE, FREE)
    tick(hold, True, FREE, FREE, FREE, FREE)
    assert tick(hold, False, FREE, FREE, FREE, FREE).holds
    assert not tick(hold, False, FREE, FREE, FREE, FAULT).occupied


def test_what_befalls_two_circuits_at_once_is_no_train() -> None:
    hold = SequenceHold(0.25)
    tick(hold, False, FREE, FREE)
    tick(hold, True, FAULT, FREE)
    assert not tick(hold, False, FREE, FREE, ticks=1).occupied


def test_the_last_circuit_and_a_started_one_hold_nothing() -> None:
    hold = SequenceHold(0.25)
    assert tick(hold, True, TRAIN, FREE).occupied
    assert not tick(hold, False, FREE, FREE).occupied
    last = SequenceHold(0.25)
    tick(last, False, TRAIN)
    assert tick(last, True, TRAIN).holds
    assert not tick(last, False, FREE, ticks=1).occupied
