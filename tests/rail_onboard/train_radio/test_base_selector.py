"""The choice among base stations."""

import itertools

import numpy as np
import pytest

from rail_onboard.train_radio.base_selector import BaseSelector


def test_the_first_one_heard_is_taken_at_once() -> None:
    selector = BaseSelector()
    assert selector.update({}) is None
    assert selector.update({3: 5.0}) == 3


def test_a_better_one_wins_when_it_is_better_by_the_hysteresis() -> None:
    selector = BaseSelector(3.0)
    selector.update({1: 100.0, 2: 1.0})
    for _ in range(50):
        assert selector.update({1: 100.0, 2: 190.0}) == 1
    for _ in range(50):
        channel = selector.update({1: 100.0, 2: 210.0})
    assert channel == 2


def test_one_that_is_not_heard_any_more_loses() -> None:
    selector = BaseSelector()
    selector.update({1: 100.0, 2: 20.0})
    channels = [selector.update({2: 20.0}) for _ in range(12)]
    assert channels[0] == 1 and channels[-1] == 2


def test_in_silence_the_last_one_stays() -> None:
    selector = BaseSelector()
    selector.update({1: 10.0})
    assert [selector.update({}) for _ in range(20)] == [1] * 20


def test_fading_alone_seldom_changes_it() -> None:
    rng = np.random.default_rng(4)
    selector = BaseSelector()
    # Four branches of diversity, 6 dB between the means.
    levels = rng.gamma(4.0, 0.25, (2000, 2)) * [4.0, 1.0]
    taken = [selector.update({1: one, 2: two}) for one, two in levels.tolist()]
    changes = sum(a != b for a, b in itertools.pairwise(taken))
    assert changes <= 2


def test_the_hysteresis_is_checked() -> None:
    with pytest.raises(ValueError, match="hysteresis_db: -1"):
        BaseSelector(-1.0)
