"""The rules of the channel selector, one by one."""

from __future__ import annotations

import numpy as np

from rail_onboard.ranging.channel_selector import HYSTERESIS_DB, LEAD_DB, ChannelSelector

UPLINKS = {1: 2, 3: 4, 5: 6}


def on(channel: int) -> ChannelSelector:
    """Return a selector that is on this channel."""
    selector = ChannelSelector(UPLINKS)
    selector.update({channel: -60.0})
    assert selector.downlink == channel
    return selector


def test_without_anything_heard_there_is_no_channel() -> None:
    selector = ChannelSelector(UPLINKS)
    assert selector.update({}) is None
    assert (selector.downlink, selector.uplink) == (None, None)


def test_the_first_channel_is_the_strongest() -> None:
    selector = ChannelSelector(UPLINKS)
    assert selector.update({1: -70.0, 3: -60.0, 5: -80.0}) == 3
    assert selector.uplink == 4


def test_without_a_lead_the_first_channel_is_not_chosen_yet() -> None:
    selector = ChannelSelector(UPLINKS)
    assert selector.update({1: -60.0, 3: -60.0 - 0.9 * LEAD_DB}) is None
    assert selector.update({1: -60.0, 3: -60.0 - 1.1 * LEAD_DB}) == 1


def test_the_pair_stays_until_another_is_stronger_by_the_hysteresis() -> None:
    selector = on(1)
    assert selector.update({1: -60.0, 3: -60.0 + 0.99 * HYSTERESIS_DB}) == 1
    assert selector.update({1: -60.0, 3: -60.0 + 1.01 * HYSTERESIS_DB}) == 3
    # and it needs as much to go back
    assert selector.update({3: -60.0, 1: -60.0 + 0.99 * HYSTERESIS_DB}) == 3
    assert selector.update({3: -60.0, 1: -60.0 + 1.01 * HYSTERESIS_DB}) == 1


def test_two_candidates_alike_leave_the_pair_in_force() -> None:
    selector = on(1)
    assert selector.update({1: -90.0, 3: -50.0, 5: -50.5}) == 1
    assert selector.update({1: -90.0, 3: -50.0, 5: -51.5}) == 3


def test_the_pair_is_kept_through_silence() -> None:
    selector = on(3)
    assert selector.update({}) == 3
    assert selector.uplink == 4


def test_a_pair_no_longer_heard_gives_way_to_one_that_is() -> None:
    assert on(1).update({3: -110.0}) == 3


def test_a_lost_pair_is_not_given_up_for_two_alike() -> None:
    assert on(1).update({3: -60.0, 5: -60.0}) == 1


def test_the_levels_decide_not_their_order() -> None:
    levels = {5: -70.0, 1: -50.0, 3: -60.0}
    for order in ((1, 3, 5), (5, 3, 1), (3, 1, 5)):
        selector = ChannelSelector(UPLINKS)
        assert selector.update({channel: levels[channel] for channel in order}) == 1


def test_a_train_that_stands_does_not_change_with_the_noise() -> None:
    rng = np.random.default_rng(1)
    selector = on(1)
    for _ in range(2000):
        # Two channels alike, each read with 0.5 dB of noise: the difference is 4.2 sigma away.
        noise_db = 0.5 * rng.standard_normal(2)
        assert selector.update({1: -60.0 + noise_db[0], 3: -60.0 + noise_db[1]}) == 1
