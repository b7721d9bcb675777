"""The backbone: what goes in comes out, by the right base stations, in the right tick."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from rail_msgs_py.topics.train_radio import STRIKES
from rail_msgs_py.train_radio.safe_frame import (
    FRAME_BYTES,
    VERSION,
    FrameKind,
    Header,
    read_header,
    write_header,
)
from rail_msgs_py.train_radio.train_channel import CONTROLLER_IDENTITY
from rail_world.train_radio.backbone import Backbone, Carried
from rail_world.train_radio.frame_threats import Threat, ThreatRates
from rail_world.train_radio.threat_description import ThreatPeriod, rates_at

BASES = ("b1", "b2", "b3")
TICK_NS = 250_000_000
TRAINS = (1, 2)


def frame_of(number: int, train: int, *, upward: bool) -> bytes:
    """A frame that looks like one, told from others by its number."""
    ends = (train, CONTROLLER_IDENTITY) if upward else (CONTROLLER_IDENTITY, train)
    header = Header(VERSION, FrameKind.LOCATION_REPORT, 32, *ends, number, number * TICK_NS, 0, 7)
    return write_header(header).ljust(FRAME_BYTES, b"\0")


def backbone(*periods: ThreatPeriod, seed: int = 1) -> Backbone:
    return Backbone(BASES, periods, np.random.default_rng(seed))


def period(*threats: Threat, rate: float = 1.0, **more: float) -> ThreatPeriod:
    fields = {"from_s": 0.0, "to_s": 1e6, "longest_delay_s": 3.0, **more}
    return ThreatPeriod(threats=threats, rate=rate, **fields)


def traffic(net: Backbone, ticks: int) -> list[tuple[Carried, Carried]]:
    """Two trains at b1 and b2, one frame each way in each tick; what comes out."""
    return [
        (
            net.up(k * TICK_NS, {f"b{n}": [(n, frame_of(k, n, upward=True))] for n in TRAINS}),
            net.down(k * TICK_NS, {f"b{n}": [(n, frame_of(k, n, upward=False))] for n in TRAINS}),
        )
        for k in range(ticks)
    ]


def test_without_threats_all_comes_out_where_and_when_it_went_in() -> None:
    # Threats that begin later only, and none at all.
    for net in (backbone(), backbone(period(*Threat, from_s=100.0))):
        for k, (up, down) in enumerate(traffic(net, 20)):
            for upward, out in ((True, up), (False, down)):
                assert out == {
                    "b1": [(1, frame_of(k, 1, upward=upward))],
                    "b2": [(2, frame_of(k, 2, upward=upward))],
                    "b3": [],
                }
        assert net.frames == 80 and not net.strikes


def test_a_frame_by_several_base_stations_is_one_frame_and_comes_out_at_all_of_them() -> None:
    net = backbone()
    frame = frame_of(0, 1, upward=False)
    ordered = {base: [(1, frame), (2, bytes(FRAME_BYTES))] for base in BASES}
    assert net.down(0, ordered) == ordered
    assert net.frames == 2
    # What two base stations made of one burst need not be the same.
    heard = {"b1": [(1, frame_of(1, 1, upward=True))], "b3": [(1, b"\xff" * FRAME_BYTES)]}
    assert net.up(TICK_NS, heard) == {**heard, "b2": []}


def test_threats_begin_and_end_with_their_period() -> None:
    net = backbone(period(Threat.DELETION, from_s=1.0, to_s=2.0))
    through = [bool(up["b1"]) and bool(down["b2"]) for up, down in traffic(net, 12)]
    assert through == [True] * 4 + [False] * 4 + [True] * 4
    assert net.strikes == {Threat.DELETION: 16} and net.frames == 48


def test_every_threat_strikes_as_often_as_its_rate_both_ways() -> None:
    net = backbone(period(*Threat, rate=0.25))
    traffic(net, 200)
    # Binomial, 800 times 0.25: five sigma is 61.
    assert set(net.strikes) == set(Threat)
    assert all(abs(count - 200) < 61 for count in net.strikes.values())


def test_the_same_seed_does_the_same() -> None:
    runs = [traffic(backbone(period(*Threat, rate=0.3), seed=s), 60) for s in (1, 1, 2)]
    assert runs[0] == runs[1] != runs[2]


def test_a_delayed_frame_comes_in_the_first_tick_that_is_not_before_its_time() -> None:
    net = backbone(period(Threat.DELAY, longest_delay_s=2.0))
    ages = []
    for k, (up, _) in enumerate(traffic(net, 200)):
        ages += [k - read_header(frame).sequence for _, frame in up["b1"]]
    assert min(ages) == 1 and max(ages) == 8
    # A delay is even in 0 to 8 ticks, so each age from 1 to 8 is as likely.
    counts = np.bincount(ages, minlength=9)[1:]
    assert np.all(np.abs(counts - 24) < 5.0 * np.sqrt(24.0))


def test_what_comes_late_goes_by_where_the_train_is_now() -> None:
    net = backbone(period(Threat.DELAY, to_s=0.1, longest_delay_s=0.2))
    first = frame_of(0, 1, upward=False)
    assert not any(net.down(0, {"b1": [(1, first)]}).values())
    second = frame_of(1, 1, upward=False)
    late = net.down(TICK_NS, {"b2": [(1, second)]})
    assert late == {"b1": [], "b2": [(1, first), (1, second)], "b3": []}


def test_frames_thrown_back_are_carried_with_those_of_the_other_way() -> None:
    net = backbone(period(Threat.MASQUERADE))
    back_up, back_down = 0, 0
    for k in range(200):
        up = net.up(k * TICK_NS, {"b2": [(1, frame_of(k, 1, upward=True))]})
        down = net.down(k * TICK_NS, {"b2": [(1, frame_of(k, 1, upward=False))]})
        assert not up["b1"] + up["b3"] + down["b1"] + down["b3"]
        for upward, carried in ((True, up), (False, down)):
            assert {slot for slot, _ in carried["b2"]} == {1}
            for slot, frame in carried["b2"]:
                header = read_header(frame)
                own = frame == frame_of(header.sequence, slot, upward=not upward)
                if own and upward:
                    assert header.sequence == k - 1  # it was sent after the leg of its tick
                    back_up += 1
                elif own:
                    assert header.sequence == k
                    back_down += 1
    # Two of four ways to masquerade: with two links, a frame of another is one of the other way.
    assert abs(back_up - 100) < 36 and abs(back_down - 100) < 36


def test_an_intruder_who_does_not_know_where_a_train_is_goes_by_all_base_stations() -> None:
    net = backbone(period(Threat.MASQUERADE))
    for k in range(20):
        frame = frame_of(k, 1, upward=True)
        net.up(k * TICK_NS, {"b1": [(1, frame)]})
        thrown_back = net.down(k * TICK_NS, {})
        if (1, frame) in thrown_back["b1"]:
            assert thrown_back == {base: [(1, frame)] for base in BASES}
            return
    pytest.fail("nothing was thrown back")


def test_rates_of_overlapping_periods() -> None:
    periods = (
        period(Threat.DELAY, Threat.DELETION, rate=0.2, to_s=10.0),
        period(Threat.DELAY, rate=0.5, from_s=5.0, longest_delay_s=1.0),
        period(Threat.CORRUPTION, rate=0.1, from_s=5.0, to_s=6.0, longest_delay_s=60.0),
    )
    assert rates_at(periods, 0.0) == (ThreatRates(delay=0.2, deletion=0.2), 3.0)
    rates, longest_s = rates_at(periods, 5.0)
    assert (rates.deletion, rates.corruption, longest_s) == (0.2, 0.1, 3.0)
    # To escape both: 0.8 times 0.5.
    assert rates.delay == pytest.approx(0.6, rel=1e-15)
    assert rates_at(periods, 10.0) == (ThreatRates(delay=0.5), 1.0)
    assert rates_at((), 10.0) == (ThreatRates(), 0.0)


@pytest.mark.parametrize(
    ("threats", "rate", "reason"),
    [
        (["delay", "delay"], 0.1, "delay comes twice"),
        (["eavesdropping"], 0.1, "'masquerade'"),
        ([], 0.1, "at least 1 item"),
        (["delay"], 1.1, "less than or equal to 1"),
        (["delay"], float("nan"), "finite"),
    ],
)
def test_bad_periods_are_refused(threats: list[str], rate: float, reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        ThreatPeriod.model_validate({"threats": threats, "rate": rate})


def test_the_table_on_the_wire_names_every_threat() -> None:
    assert ("frames", *(threat.value for threat in Threat)) == STRIKES.columns
