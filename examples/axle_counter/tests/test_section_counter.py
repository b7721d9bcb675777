"""Sections: free, occupied, not known; and what a reset may do."""

from __future__ import annotations

import pytest
from axle_counter.signals.axle_detector import Passages
from axle_counter.signals.section_counter import Occupancy, Reset, Section, SectionCounter

FREE, OCCUPIED, NOT_KNOWN = Occupancy.FREE, Occupancy.OCCUPIED, Occupancy.NOT_KNOWN
QUIET = Passages(0, 0, 0, busy=False, valid=True)
BUSY = Passages(0, 0, 0, busy=True, valid=True)
FORWARD = Passages(1, 0, 0, busy=False, valid=True)
BACKWARD = Passages(0, 1, 0, busy=False, valid=True)
UNCLEAR = Passages(0, 0, 1, busy=False, valid=True)
FAILED = Passages(0, 0, 0, busy=False, valid=False)


def counter(*, reset: Reset | None = Reset.CONDITIONAL) -> SectionCounter:
    """Return the counter of a section from point a to point b, in service unless told otherwise."""
    made = SectionCounter(Section("s", {"a": 1, "b": -1}))
    made.update({"a": QUIET, "b": QUIET})
    assert made.occupancy == NOT_KNOWN  # as on power-up
    if reset is not None:
        assert made.reset(reset)
    return made


def after(
    made: SectionCounter, a: Passages | None = QUIET, b: Passages | None = QUIET
) -> Occupancy:
    seen = {point: each for point, each in (("a", a), ("b", b)) if each is not None}
    made.update(seen)
    return made.occupancy


def test_a_train_through_a_section() -> None:
    made = counter()
    assert made.occupancy == FREE
    assert after(made, BUSY) == OCCUPIED  # before its first axle has been counted
    assert [after(made, FORWARD) for _ in range(4)] == [OCCUPIED] * 4
    assert (made.axles, after(made)) == (4, OCCUPIED)
    assert [after(made, b=FORWARD) for _ in range(3)] == [OCCUPIED] * 3
    last = Passages(1, 0, 0, busy=True, valid=True)
    assert after(made, b=last) == OCCUPIED  # something is still on the sensor
    assert after(made) == FREE


def test_a_train_that_comes_in_and_goes_back_and_one_from_the_other_end() -> None:
    made = counter()
    assert after(made, FORWARD) == OCCUPIED
    assert after(made, BACKWARD) == FREE
    assert after(made, b=BACKWARD) == OCCUPIED
    assert after(made, a=BACKWARD) == FREE


def test_two_trains_in_one_section_are_both_counted() -> None:
    made = counter()
    after(made, FORWARD)
    assert after(made, FORWARD, FORWARD) == OCCUPIED  # one leaves as the other enters
    assert made.axles == 1
    assert after(made, b=FORWARD) == FREE


@pytest.mark.parametrize("doubt", [UNCLEAR, FAILED, None])
def test_a_border_in_doubt_makes_the_section_not_known_until_reset(doubt: Passages | None) -> None:
    made = counter()
    assert after(made, doubt) == NOT_KNOWN
    if doubt is not UNCLEAR:
        assert not made.reset(Reset.CONDITIONAL)  # it still does not work
    assert after(made) == NOT_KNOWN
    assert made.reset(Reset.CONDITIONAL)
    assert made.occupancy == FREE


def test_more_out_than_in_is_not_known() -> None:
    made = counter()
    after(made, FORWARD)
    assert after(made, b=FORWARD) == FREE
    assert after(made, b=FORWARD) == NOT_KNOWN
    assert after(made, a=FORWARD) == NOT_KNOWN  # though the sum is zero again


def test_a_reset_is_refused_with_a_wheel_on_the_border_or_after_an_axle_that_went_in() -> None:
    made = counter(reset=None)
    after(made, BUSY)
    assert not made.reset(Reset.CONDITIONAL)
    after(made, FORWARD)
    after(made)
    assert not made.reset(Reset.CONDITIONAL)
    # In and out in one tick: in which order is not known, so it may have gone in last.
    after(made, FORWARD, FORWARD)
    assert not made.reset(Reset.CONDITIONAL)
    after(made, b=FORWARD)
    assert made.reset(Reset.CONDITIONAL)
    assert (made.axles, made.occupancy) == (0, FREE)


def test_after_a_reset_a_train_must_sweep_the_section() -> None:
    made = counter(reset=Reset.SWEEP)
    assert [after(made) for _ in range(3)] == [NOT_KNOWN] * 3
    assert [after(made, FORWARD), after(made, FORWARD)] == [NOT_KNOWN] * 2
    assert after(made, b=FORWARD) == NOT_KNOWN
    assert after(made, b=FORWARD) == FREE
    assert after(made, FORWARD) == OCCUPIED


def test_a_sweep_that_finds_axles_in_the_section_does_not_count() -> None:
    made = counter(reset=Reset.SWEEP)
    assert after(made, b=FORWARD) == NOT_KNOWN  # was in there all the time
    assert after(made, FORWARD) == NOT_KNOWN  # the sum is zero
    assert after(made, b=FORWARD) == NOT_KNOWN
    assert made.reset(Reset.SWEEP)
    assert after(made, FORWARD) == NOT_KNOWN
    assert after(made, b=FORWARD) == FREE


def test_a_section_with_a_branch_has_three_borders() -> None:
    made = SectionCounter(Section("s", {"a": 1, "b": -1, "c": -1}))
    made.update(dict.fromkeys("abc", QUIET))
    assert made.reset(Reset.CONDITIONAL)
    made.update({"a": FORWARD, "b": QUIET, "c": QUIET})
    assert made.occupancy == OCCUPIED
    made.update({"a": QUIET, "b": QUIET, "c": FORWARD})
    assert made.occupancy == FREE
