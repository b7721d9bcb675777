"""The recording: ticks in any order, gaps that show, and a digest of the estimates alone."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from rail_corridor.report.run_data import Record, Recording


def test_a_record_grows_and_shows_its_gaps() -> None:
    record = Record(rows=2, columns=3)
    record.put(5000, 1, np.array([1.0, 2.0, 3.0]))
    record.put(0, slice(None), np.ones((2, 3)))
    assert record.ticks == 5001
    values = record.upto(5001)
    assert values.shape == (5001, 2, 3)
    assert np.array_equal(values[5000, 1], [1.0, 2.0, 3.0])
    assert np.isnan(values[5000, 0]).all()
    assert np.isnan(values[1:5000]).all()
    assert record.upto(9000).shape == (9000, 2, 3)


def recording(order: tuple[int, ...] = (0, 1, 2, 3), change: float = 0.0) -> Recording:
    made = Recording(("a", "b"), ("main",), channels=2)
    for tick in order:
        made.state.put(tick, slice(None), np.full((2, 10), float(tick)))
        made.links.put(tick, slice(None), np.full((2, 4), float(tick)))
        for train in range(2):
            made.position.put(tick, train, np.array([0.0, 10.0 * tick + train, 0.04, 20.0]))
            made.channel.put(tick, train, np.array([1.0, 2.0, -50.0, np.nan]))
    made.position.put(2, 1, np.array([0.0, 21.0 + change, 0.04, 20.0]))
    return made


def test_the_digest_does_not_depend_on_the_order_of_arrival() -> None:
    digests = {recording(order).digest() for order in itertools.permutations(range(4))}
    assert len(digests) == 1
    (digest,) = digests
    assert len(digest) == 64


def test_the_digest_changes_with_the_last_bit_of_any_estimate() -> None:
    assert recording(change=4e-15).digest() != recording().digest()
    other = recording()
    other.channel.put(3, 0, np.array([3.0, 4.0, -50.0, np.nan]))
    assert other.digest() != recording().digest()


def test_every_nan_is_the_same_to_the_digest() -> None:
    other = recording()
    negative = np.array([1.0, 2.0, -50.0, np.copysign(np.nan, -1.0)])
    other.channel.put(0, 0, negative)
    assert other.digest() == recording().digest()


def test_the_digest_is_of_the_estimates_not_of_the_truth() -> None:
    other = recording()
    other.state.put(1, slice(None), np.zeros((2, 10)))
    assert other.digest() == recording().digest()


@pytest.mark.parametrize("part", ["links", "channel", "position"])
def test_what_did_not_arrive_is_counted(part: str) -> None:
    whole = recording()
    assert (whole.ticks, whole.missing_ticks) == (4, 0)
    broken = recording()
    getattr(broken, part).put(2, 1, np.nan)
    assert broken.missing_ticks == 1
