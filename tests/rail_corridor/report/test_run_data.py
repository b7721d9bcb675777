"""The recording: ticks in any order, gaps that show, and a digest of the estimates alone."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import run_data_of
from rail_corridor.run_data import Record, RunData
from rail_msgs_py.topics.ranging import LINKS, POSITION, VRS_CHANNEL
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE


def test_a_record_grows_and_shows_its_gaps() -> None:
    record = Record(rows=("a", "b"), columns=3)
    record.put(5000, 1, np.array([1.0, 2.0, 3.0]))
    record.put(0, slice(None), np.ones((2, 3)))
    assert record.ticks == 5001
    values = record.upto(5001)
    assert values.shape == (5001, 2, 3)
    assert np.array_equal(values[5000, 1], [1.0, 2.0, 3.0])
    assert np.isnan(values[5000, 0]).all()
    assert np.isnan(values[1:5000]).all()
    assert record.upto(9000).shape == (9000, 2, 3)


def recording(
    order: tuple[int, ...] = (0, 1, 2, 3), change: float = 0.0, without: Topic | None = None
) -> RunData:
    """Four ticks of two trains, without one topic of the last train in the last one."""
    made = run_data_of(load_scenario("two_trains"))
    for tick in order:
        made[STATE].put(tick, slice(None), np.full((2, 10), float(tick)))
        if not (tick == 3 and without is LINKS):
            made[LINKS].put(tick, slice(None), np.full((2, 4), float(tick)))
        for train in range(2):
            lost = without if (tick, train) == (3, 1) else None
            if lost is not POSITION:
                made[POSITION].put(tick, train, np.array([0.0, 10.0 * tick + train, 0.04, 20.0]))
            if lost is not VRS_CHANNEL:
                made[VRS_CHANNEL].put(tick, train, np.array([1.0, 2.0, -50.0, np.nan]))
    made[POSITION].put(2, 1, np.array([0.0, 21.0 + change, 0.04, 20.0]))
    return made


def test_the_digest_does_not_depend_on_the_order_of_arrival() -> None:
    digests = {recording(order).digest() for order in itertools.permutations(range(4))}
    assert len(digests) == 1
    (digest,) = digests
    assert len(digest) == 64


def test_the_digest_changes_with_the_last_bit_of_any_estimate() -> None:
    assert recording(change=4e-15).digest() != recording().digest()
    other = recording()
    other[VRS_CHANNEL].put(3, 0, np.array([3.0, 4.0, -50.0, np.nan]))
    assert other.digest() != recording().digest()


def test_every_nan_is_the_same_to_the_digest() -> None:
    other = recording()
    negative = np.array([1.0, 2.0, -50.0, np.copysign(np.nan, -1.0)])
    other[VRS_CHANNEL].put(0, 0, negative)
    assert other.digest() == recording().digest()


def test_the_digest_is_of_the_estimates_not_of_the_truth() -> None:
    other = recording()
    other[STATE].put(1, slice(None), np.zeros((2, 10)))
    assert other.digest() == recording().digest()


@pytest.mark.parametrize("part", [LINKS, VRS_CHANNEL, POSITION], ids=lambda t: t.pattern)
def test_what_did_not_arrive_is_counted(part: Topic) -> None:
    whole = recording()
    assert (whole.ticks, whole.missing_ticks) == (4, 0)
    broken = recording(without=part)
    assert (broken.ticks, broken.missing_ticks) == (4, 1)


def test_what_arrived_may_say_that_nothing_is_known() -> None:
    unknown = recording()
    unknown[POSITION].put(2, 1, np.nan)
    assert unknown.missing_ticks == 0
