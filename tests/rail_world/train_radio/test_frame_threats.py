"""The seven threats on byte frames: each does what it says, and only that."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_msgs_py.train_radio.safe_frame import FRAME_BYTES
from rail_world.train_radio.frame_threats import Arrival, FrameThreats, Link, Threat, ThreatRates

LINKS: list[Link] = [(1, 101), (101, 1), (1, 102), (102, 1)]
FRAMES = 400
PERIOD_NS = 100_000_000


def frame_of(number: int) -> bytes:
    return number.to_bytes(FRAME_BYTES, "big")


def run(rates: ThreatRates, seed: int = 1) -> tuple[FrameThreats, list[Arrival]]:
    """Send frames over four links in turn, and return everything that arrived."""
    radio = FrameThreats(rates, np.random.default_rng(seed), latency_s=0.02, longest_delay_s=2.0)
    arrived: list[Arrival] = []
    for number in range(FRAMES):
        radio.send(LINKS[number % 4], frame_of(number), number * PERIOD_NS)
        arrived += radio.arrivals(number * PERIOD_NS + PERIOD_NS - 1)
    return radio, arrived + radio.arrivals(10**12)


def only(threat: Threat, rate: float = 0.3) -> tuple[FrameThreats, list[Arrival]]:
    return run(ThreatRates(**{threat.value: rate}))


def split(arrived: list[Arrival]) -> tuple[list[Arrival], list[Arrival]]:
    return [a for a in arrived if a.threat is None], [a for a in arrived if a.threat]


def is_own(arrival: Arrival) -> bool:
    """Whether the bytes were sent on the link on which they came, at the time that it says."""
    number = int.from_bytes(arrival.frame, "big")
    return number * PERIOD_NS == arrival.sent_ns and LINKS[number % 4] == arrival.link


def test_without_threats_all_frames_pass_in_order_after_the_latency() -> None:
    radio, arrived = run(ThreatRates())
    assert [a.frame for a in arrived] == [frame_of(n) for n in range(FRAMES)]
    assert all(is_own(a) and a.time_ns == a.sent_ns + 20_000_000 for a in arrived)
    assert not radio.strikes


@pytest.mark.parametrize("threat", Threat)
def test_the_same_seed_gives_the_same_arrivals(threat: Threat) -> None:
    rates = ThreatRates(**{threat.value: 0.5})
    assert run(rates)[1] == run(rates)[1]
    assert run(rates)[1] != run(rates, seed=2)[1]


@pytest.mark.parametrize("threat", Threat)
def test_a_threat_strikes_as_often_as_its_rate(threat: Threat) -> None:
    radio, arrived = only(threat)
    # Binomial, 400 times 0.3: five sigma is 46.
    assert set(radio.strikes) == {threat}
    assert abs(radio.strikes[threat] - 120) < 46
    genuine, attacks = split(arrived)
    assert all(is_own(a) for a in genuine)
    assert {a.threat for a in attacks} <= {threat}
    assert [a.time_ns for a in arrived] == sorted(a.time_ns for a in arrived)


def test_deleted_frames_do_not_arrive() -> None:
    radio, arrived = only(Threat.DELETION)
    assert len(arrived) == FRAMES - radio.strikes[Threat.DELETION]


def test_repeated_frames_were_sent_on_that_link_some_of_them_long_ago() -> None:
    radio, arrived = only(Threat.REPETITION)
    genuine, repeated = split(arrived)
    assert len(genuine) == FRAMES
    assert len(repeated) == radio.strikes[Threat.REPETITION]
    assert all(is_own(a) for a in repeated)
    ages_s = [(a.time_ns - a.sent_ns) * 1e-9 for a in repeated]
    assert min(ages_s) < 0.1 and max(ages_s) > 20.0


@pytest.mark.parametrize("threat", [Threat.INSERTION, Threat.CORRUPTION])
def test_inserted_and_corrupted_frames_were_never_sent(threat: Threat) -> None:
    radio, arrived = only(threat)
    genuine, attacks = split(arrived)
    assert len(attacks) == radio.strikes[threat]
    assert len(genuine) == FRAMES - (len(attacks) if threat is Threat.CORRUPTION else 0)
    sent = {frame_of(n) for n in range(FRAMES)}
    assert all(len(a.frame) == FRAME_BYTES and a.sent_ns == -1 for a in attacks)
    assert not sent & {a.frame for a in attacks}


def test_corruption_goes_from_one_bit_to_the_whole_frame() -> None:
    radio = FrameThreats(ThreatRates(corruption=1.0), np.random.default_rng(1))
    flips = []
    for number in range(500):
        radio.send((1, 101), bytes(FRAME_BYTES), number)
        (arrival,) = radio.arrivals(number)
        flips.append(int.from_bytes(arrival.frame, "big").bit_count())
    assert min(flips) == 1 and max(flips) > 200


def test_held_frames_come_after_one_to_three_later_ones() -> None:
    _, arrived = only(Threat.RESEQUENCING)
    for link in LINKS:
        numbers = [int.from_bytes(a.frame, "big") // 4 for a in arrived if a.link == link]
        passed = {
            sum(other > number for other in numbers[:place])
            for place, number in enumerate(numbers)
            if any(
                a.threat and a.frame == frame_of(4 * number + LINKS.index(link)) for a in arrived
            )
        }
        assert passed <= {0, 1, 2, 3} and max(passed) > 0
    assert all(is_own(a) for a in arrived)


def test_delayed_frames_are_late_by_at_most_the_longest_delay() -> None:
    radio, arrived = only(Threat.DELAY)
    _, late = split(arrived)
    assert len(late) == radio.strikes[Threat.DELAY] and len(arrived) == FRAMES
    delays_s = [(a.time_ns - a.sent_ns) * 1e-9 - 0.02 for a in late]
    assert 0.0 <= min(delays_s) < 0.1 and 1.8 < max(delays_s) <= 2.0
    assert all(is_own(a) for a in late)


def test_masquerades_are_never_frames_of_their_link() -> None:
    radio, arrived = only(Threat.MASQUERADE)
    genuine, attacks = split(arrived)
    assert len(genuine) == FRAMES and len(attacks) == radio.strikes[Threat.MASQUERADE]
    assert not any(is_own(a) for a in attacks)
    brought = [a for a in attacks if a.sent_ns >= 0]
    assert 0.2 < len(brought) / len(attacks) < 0.8  # as it was sent, to another end


def test_rates_may_change_on_the_way() -> None:
    radio = FrameThreats(ThreatRates(), np.random.default_rng(1))
    for number in range(300):
        if number == 100:
            radio.act(ThreatRates(deletion=1.0), 3.0)
        elif number == 200:
            radio.act(ThreatRates(delay=1.0), 0.5)
        radio.send(LINKS[0], frame_of(number), number * PERIOD_NS)
    arrived = radio.arrivals(10**12)
    assert radio.strikes == {Threat.DELETION: 100, Threat.DELAY: 100}
    numbers = [int.from_bytes(a.frame, "big") for a in arrived]
    assert numbers[:100] == list(range(100)) and sorted(numbers[100:]) == list(range(200, 300))
    assert 0.45 < max(a.time_ns - a.sent_ns for a in arrived) * 1e-9 <= 0.5


def test_to_act_as_before_changes_nothing() -> None:
    rates = ThreatRates(**dict.fromkeys((threat.value for threat in Threat), 0.3))
    arrived = []
    for again in (False, True):
        radio = FrameThreats(rates, np.random.default_rng(1), longest_delay_s=2.0)
        for number in range(FRAMES):
            if again:
                radio.act(rates, 2.0)
            radio.send(LINKS[number % 4], frame_of(number), number * PERIOD_NS)
        arrived.append(radio.arrivals(10**12))
    assert arrived[0] == arrived[1]


def test_memory_is_bounded() -> None:
    rates = ThreatRates(repetition=0.3, resequencing=0.3, delay=0.3)
    radio = FrameThreats(rates, np.random.default_rng(1), longest_delay_s=1.0, memory=8)
    for number in range(2000):
        radio.send((1, 101), frame_of(number), number * PERIOD_NS)
        radio.arrivals(number * PERIOD_NS)
    assert len(radio._archive) == 8
    assert max(map(len, radio._held.values())) <= 4
    assert len(radio._queue) < 30


def test_bad_values_are_quoted() -> None:
    with pytest.raises(ValueError, match=r"delay must be from 0 to 1, got 1\.5"):
        ThreatRates(delay=1.5)
    with pytest.raises(ValueError, match=r"masquerade .* got nan"):
        ThreatRates(masquerade=math.nan)
    with pytest.raises(ValueError, match=r"memory .* got 0"):
        FrameThreats(ThreatRates(), np.random.default_rng(1), memory=0)
    with pytest.raises(ValueError, match=r"longest_delay_s .* got -1"):
        FrameThreats(ThreatRates(), np.random.default_rng(1)).act(ThreatRates(), -1.0)
