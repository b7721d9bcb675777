"""Moving block: ends by hand, and that trains that obey never meet, whatever they do."""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field
from itertools import pairwise
from math import inf, nan
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_msgs_py.train_radio.movement_authority import MOST_STEPS, LimitStep, MovementAuthority
from rail_msgs_py.train_radio.train_report import LocationReport
from rail_wayside.train_radio.moving_block import (
    IssuedAuthority,
    MovingBlock,
    Segment,
    TrainStart,
    Trouble,
    to_telegram,
)
from rail_wayside.train_radio.speed_profile import SpeedRestriction

LENGTH_M, LIMIT_MPS, TRAIN_M = 5000.0, 20.0, 100.0
MARGIN_M, END_MARGIN_M = 10.0, 20.0
TRACK = Segment(1, "up", LENGTH_M, ((0.0, LIMIT_MPS),))
OTHER = Segment(2, "down", LENGTH_M, ((0.0, LIMIT_MPS),))


def start(number: int, front_m: float | None, direction: int = 1, **more: float) -> TrainStart:
    return TrainStart(number, f"T{number}", TRAIN_M, direction, 1, front_m, **more)


def zone(*trains: TrainStart, segments: tuple[Segment, ...] = (TRACK, OTHER)) -> MovingBlock:
    return MovingBlock(
        segments, trains, margin_m=MARGIN_M, end_margin_m=END_MARGIN_M, overspeed_mps=2.0
    )


def told(number: int, offset_m: float, half_m: float = 0.0, **more: object) -> LocationReport:
    fields: dict[str, object] = {
        "train": number,
        "segment": 1,
        "offset_m": offset_m,
        "direction": 1,
        "speed_mps": 10.0,
        "uncertainty_m": half_m,
        "length_m": TRAIN_M,
        "integrity_confirmed": True,
        "position_valid": True,
    }
    return LocationReport(**{**fields, **more})  # type: ignore[arg-type]


def given_to(block: MovingBlock, train: int, time_s: float) -> IssuedAuthority:
    authority = block.authority(train, time_s)
    assert authority is not None
    return authority


# Ends -------------------------------------------------------------------------------------


def test_the_end_lies_a_margin_behind_the_worst_rear_ahead() -> None:
    block = zone(start(1, 500.0, uncertainty_m=5.0), start(2, 1500.0, uncertainty_m=7.0))
    one, two = given_to(block, 1, 0.0), given_to(block, 2, 0.0)
    assert (one.end_m, one.cause) == (1500.0 - 7.0 - TRAIN_M - MARGIN_M, "rear of T2")
    assert (two.end_m, two.cause) == (LENGTH_M - END_MARGIN_M, "end of the track")
    assert block.occupied(1, 0.0) == (500.0 - 5.0 - TRAIN_M, 505.0)


def test_backwards_is_the_mirror_image() -> None:
    block = zone(start(1, 4500.0, -1), start(2, 3500.0, -1, uncertainty_m=7.0))
    assert given_to(block, 1, 0.0).end_m == 3500.0 + 7.0 + TRAIN_M + MARGIN_M
    assert given_to(block, 2, 0.0).end_m == END_MARGIN_M
    assert block.occupied(2, 0.0) == (3607.0, 3493.0)


def test_who_stands_at_the_same_place_goes_in_the_order_given() -> None:
    for direction in (1, -1):
        block = zone(start(1, 2000.0, direction), start(2, 2000.0, direction))
        assert given_to(block, 1, 0.0).cause == "end of the track"
        assert given_to(block, 2, 0.0).cause == "rear of T1"


def test_oncoming_trains_keep_what_they_were_given() -> None:
    block = zone(start(1, 1000.0), start(2, 4000.0, -1))
    assert given_to(block, 1, 0.0).end_m == 4000.0 - MARGIN_M
    two = given_to(block, 2, 0.0)
    assert (two.end_m, two.cause) == (4000.0, "T1 oncoming")  # not a metre
    assert given_to(block, 1, 0.25).end_m == 4000.0 - MARGIN_M
    # Back to back they do not hinder each other.
    block = zone(start(1, 1000.0, -1), start(2, 2000.0))
    assert given_to(block, 1, 0.0).end_m == END_MARGIN_M
    assert given_to(block, 2, 0.0).end_m == LENGTH_M - END_MARGIN_M


def test_authority_follows_within_one_update() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    before = given_to(block, 1, 0.0)
    assert block.report(2, 1.0, told(2, 1520.0))
    after = given_to(block, 1, 1.0)
    assert after.end_m - before.end_m == pytest.approx(20.0)
    assert not after.shortened


def test_a_train_ahead_that_may_have_stopped_counts_where_it_was() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    block.report(2, 1.0, told(2, 1520.0, speed_mps=20.0))
    assert given_to(block, 1, 60.0).end_m == given_to(block, 1, 1.0).end_m == 1410.0


def test_the_front_advances_at_full_speed_to_the_end_of_authority() -> None:
    block = zone(start(1, 500.0), start(2, 1000.0))
    block.report(1, 10.0, told(1, 520.0, 5.0))
    given_to(block, 1, 10.0)  # to 890 m
    fronts = [block.occupied(1, 10.0 + age_s) for age_s in (0.0, 2.0, 100.0)]
    assert fronts == [(415.0, 525.0), (415.0, 525.0 + 2.0 * 22.0), (415.0, 890.0)]


def test_a_train_whose_place_is_unknown_gets_nothing_until_it_reports() -> None:
    block = zone(start(1, None), start(2, 3000.0))
    assert block.authority(1, 0.0) is None
    assert block.occupied(1, 0.0) is None
    assert block.authority(9, 0.0) is None
    assert block.occupied(9, 0.0) is None
    assert block.troubles(9) == ()
    block.report(1, 1.0, told(1, 1000.0))
    assert given_to(block, 1, 1.0).cause == "rear of T2"


def test_an_unknown_train_that_turns_up_shortens_authorities_and_says_so() -> None:
    block = zone(start(1, 500.0), start(2, None))
    assert given_to(block, 1, 0.0).cause == "end of the track"
    block.report(2, 1.0, told(2, 3000.0))
    authority = given_to(block, 1, 1.0)
    assert authority.shortened
    assert (authority.end_m, authority.cause) == (2890.0, "rear of T2")
    assert not given_to(block, 1, 1.25).shortened


# What a report may do ---------------------------------------------------------------------


def test_older_reports_and_those_of_others_are_ignored() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    assert block.report(2, 2.0, told(2, 1530.0))
    before = block.occupied(2, 2.0)
    assert not block.report(2, 2.0, told(2, 1540.0))
    assert not block.report(2, 1.0, told(2, 1540.0))
    assert not block.report(2, 3.0, told(1, 1540.0))
    assert not block.report(7, 3.0, told(7, 1540.0))
    assert block.occupied(2, 2.0) == before


def test_an_invalid_position_leaves_the_rear_where_it_was() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    block.report(2, 1.0, told(2, 1510.0))
    block.report(2, 2.0, told(2, 1530.0, position_valid=False))
    assert block.troubles(2) == (Trouble.INVALID,)
    assert given_to(block, 1, 2.0).end_m == 1400.0
    block.report(2, 3.0, told(2, 1540.0))
    assert block.troubles(2) == ()
    assert given_to(block, 1, 3.0).end_m == 1430.0


def test_without_integrity_the_rear_does_not_advance() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    block.report(2, 1.0, told(2, 1510.0))
    block.report(2, 2.0, told(2, 1530.0, integrity_confirmed=False))
    assert block.occupied(2, 2.0) == (1410.0, 1530.0)
    assert block.troubles(2) == (Trouble.INTEGRITY,)
    block.report(2, 3.0, told(2, 1540.0))
    assert block.occupied(2, 3.0) == (1440.0, 1540.0)


def test_a_wider_report_does_not_move_the_rear_back_but_a_longer_train_does() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    given_to(block, 1, 0.0)
    block.report(2, 1.0, told(2, 1500.0, 30.0))
    assert not given_to(block, 1, 1.0).shortened
    block.report(2, 2.0, told(2, 1500.0, 30.0, length_m=150.0))
    assert block.troubles(2) == (Trouble.LENGTH,)
    authority = given_to(block, 1, 2.0)
    assert (authority.end_m, authority.shortened) == (1340.0, True)


@pytest.mark.parametrize("wrong", [{"segment": 2}, {"direction": -1}, {"segment": 9}])
def test_a_train_that_reports_another_track_gets_nothing(wrong: dict[str, int]) -> None:
    block = zone(start(1, 500.0), start(2, 1500.0), TrainStart(3, "T3", TRAIN_M, 1, 2, 500.0))
    assert given_to(block, 3, 0.0).cause == "end of the track"
    block.report(2, 1.0, told(2, 1510.0, **wrong))
    assert block.authority(2, 1.0) is None
    assert block.troubles(2) == (Trouble.SEGMENT,)
    assert given_to(block, 1, 1.0).end_m == 1390.0  # it still blocks where it was
    if wrong.get("segment") == 2:  # and where it says it is
        authority = given_to(block, 3, 1.0)
        assert (authority.end_m, authority.cause) == (1400.0, "stray T2")
        assert authority.shortened
    block.report(2, 2.0, told(2, 1520.0))
    assert given_to(block, 3, 2.0).cause == "end of the track"
    assert block.authority(2, 2.0) is not None


def test_a_leap_is_not_believed_until_it_is_possible_or_ranged() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    block.report(2, 1.0, told(2, 1510.0))
    block.report(2, 2.0, told(2, 1600.0))
    assert block.troubles(2) == (Trouble.LEAP,)
    assert block.occupied(2, 2.0) == (1410.0, 1600.0)
    block.report(2, 5.5, told(2, 1605.0))  # 95 m in 4.5 s at 22 m/s: possible
    assert block.troubles(2) == ()
    assert block.occupied(2, 5.5) == (1505.0, 1605.0)
    block.report(2, 6.0, told(2, 1900.0))
    assert block.ranged(2, 6.1, 1, 1902.0, 1.0)
    assert block.troubles(2) == ()
    assert block.occupied(2, 6.0) == (1800.0, 1900.0)


def test_a_train_that_turns_up_further_back_occupies_both_and_is_told_less() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    far_m = given_to(block, 2, 0.0).end_m
    near_m = given_to(block, 1, 0.0).end_m
    block.report(2, 1.0, told(2, 1450.0))
    assert block.troubles(2) == (Trouble.LEAP,)
    assert block.occupied(2, 1.0) == (1350.0, 1522.0)  # 22 m/s for 1 s
    one, two = given_to(block, 1, 1.0), given_to(block, 2, 1.0)
    assert (one.end_m, one.shortened) == (near_m - 50.0, True)
    assert (two.end_m, two.shortened) == (far_m - 72.0, True)
    block.report(2, 4.0, told(2, 1495.0))
    assert block.troubles(2) == ()
    assert given_to(block, 2, 4.0).end_m == far_m


# Ranging ----------------------------------------------------------------------------------


def test_a_range_that_disagrees_makes_the_hull_until_a_new_one_agrees() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0))
    block.report(2, 1.0, told(2, 1510.0, 5.0))
    near_m, far_m = given_to(block, 1, 1.0).end_m, given_to(block, 2, 1.0).end_m
    assert block.ranged(2, 1.0, 1, 1510.0 - 5.0 - 12.0, 2.0)  # 6 sigma are 12 m: just agrees
    assert block.troubles(2) == ()
    assert block.ranged(2, 1.1, 1, 1400.0, 2.0)
    assert block.troubles(2) == (Trouble.RANGE,)
    assert block.occupied(2, 1.0) == (1400.0 - 12.0 - TRAIN_M, 1515.0)
    one = given_to(block, 1, 1.1)
    assert (one.end_m, one.shortened) == (1288.0 - MARGIN_M, True)
    assert given_to(block, 2, 1.1).end_m == far_m  # it cannot be further ahead than it thinks
    block.report(2, 1.5, told(2, 1512.0, 5.0))  # no new range: not cleared
    assert block.troubles(2) == (Trouble.RANGE,)
    block.ranged(2, 2.0, 1, 1514.0, 2.0)
    assert block.troubles(2) == ()
    assert given_to(block, 1, 2.0).end_m == near_m + 2.0


def test_a_train_ranged_ahead_of_its_report_is_told_less_and_occupies_more() -> None:
    block = zone(start(1, 1000.0), start(2, 4000.0, -1))
    mine_m = given_to(block, 1, 0.0).end_m
    block.report(1, 1.0, told(1, 1010.0))
    block.ranged(1, 1.0, 1, 1310.0, 0.0)
    assert block.occupied(1, 1.0) == (910.0, 1310.0)
    authority = given_to(block, 1, 1.0)
    assert (authority.end_m, authority.shortened) == (mine_m - 300.0, True)
    # It may obey the longer one, from further ahead than it thinks.
    assert given_to(block, 2, 1.0).end_m == mine_m + 300.0 + MARGIN_M


def test_a_range_on_another_track_blocks_there() -> None:
    block = zone(start(1, 500.0), TrainStart(3, "T3", TRAIN_M, 1, 2, 500.0))
    assert block.ranged(1, 1.0, 2, 2000.0, 1.0)
    assert block.troubles(1) == (Trouble.RANGE_SEGMENT,)
    assert given_to(block, 3, 1.0).end_m == 2000.0 - 6.0 - TRAIN_M - MARGIN_M
    assert not block.ranged(1, 1.0, 2, 2100.0, 1.0)
    assert block.ranged(1, 2.0, 1, 500.0, 1.0)
    assert block.troubles(1) == ()
    block.ranged(1, 3.0, 2, 2000.0, 1.0)
    block.remove(1)
    assert given_to(block, 3, 3.0).cause == "end of the track"


def test_ranges_that_say_nothing_are_ignored() -> None:
    block = zone(start(1, 500.0))
    assert not block.ranged(1, 1.0, 1, 3000.0, inf)
    assert not block.ranged(1, 1.0, 1, nan, 1.0)
    assert not block.ranged(9, 1.0, 1, 3000.0, 1.0)
    assert not block.ranged(1, 1.0, 9, 3000.0, 1.0)
    assert block.ranged(1, 1.0, 1, 500.0, 1.0)
    assert not block.ranged(1, 1.0, 1, 600.0, 1.0)
    assert block.troubles(1) == ()
    with pytest.raises(ValueError, match=r"sigma_m: -1\.0"):
        block.ranged(1, 2.0, 1, 500.0, -1.0)


# Order, leaving, shortening ---------------------------------------------------------------


def test_trains_in_the_wrong_order_must_stop() -> None:
    block = zone(start(1, 500.0), start(2, 1500.0), start(3, 3000.0))
    for train in (1, 2):
        given_to(block, train, 0.0)
    block.report(1, 60.0, told(1, 1600.0, 5.0))
    for train in (1, 2):
        authority = given_to(block, train, 60.0)
        assert authority.emergency_stop
        assert to_telegram(authority).emergency_stop
        assert Trouble.ORDER in block.troubles(train)
    assert not given_to(block, 3, 60.0).emergency_stop
    assert Trouble.OVERRUN in block.troubles(1)
    block.report(2, 100.0, told(2, 2000.0, 5.0))
    assert not given_to(block, 1, 100.0).emergency_stop
    assert not given_to(block, 2, 100.0).emergency_stop


def test_a_train_at_the_very_end_of_its_authority_is_not_past_it() -> None:
    block = zone(start(1, 1000.0), start(2, 4000.0, -1))
    end_m = given_to(block, 1, 0.0).end_m
    given_to(block, 2, 0.0)
    block.report(1, 200.0, told(1, end_m + 2.0 + 1e-9, 2.0))
    assert block.troubles(1) == ()
    assert not given_to(block, 2, 200.0).shortened  # the front cannot be in the part beyond
    block.report(1, 201.0, told(1, end_m + 3.0, 2.0))
    assert block.troubles(1) == (Trouble.OVERRUN,)
    assert given_to(block, 2, 201.0).shortened


def test_a_train_past_the_end_of_the_track_is_gone() -> None:
    block = zone(start(1, 500.0), start(2, 4900.0))
    block.report(2, 60.0, told(2, LENGTH_M + TRAIN_M))
    assert 2 in block.trains
    block.report(2, 61.0, told(2, LENGTH_M + TRAIN_M + 1.0))
    assert 2 not in block.trains
    assert given_to(block, 1, 61.0).cause == "end of the track"
    assert not block.report(2, 62.0, told(2, LENGTH_M + 200.0))
    block.remove(2)  # no matter
    block.add(start(2, 1500.0))
    assert given_to(block, 1, 63.0).cause == "rear of T2"


def test_a_shortened_authority_stays_reserved_until_the_train_stands_without_it() -> None:
    block = zone(start(1, 1000.0), start(2, 4900.0, -1), start(3, None))
    assert given_to(block, 1, 0.0).end_m == 4890.0
    block.report(3, 1.0, told(3, 2000.0))
    block.remove(3)
    block.add(start(3, 2000.0))
    assert given_to(block, 1, 1.0).shortened  # to 1890 m
    block.remove(3)
    block.add(start(4, 1950.0, -1))  # the track is free again but for T4
    block.remove(4)
    # What T1 was given first holds for 4 s after it was given last, and until it stands.
    for time_s, speed_mps, free in ((2.0, 0.0, False), (4.5, 5.0, False), (5.0, 0.0, True)):
        block.report(1, time_s, told(1, 1000.0, speed_mps=speed_mps))
        end_m = given_to(block, 2, time_s).end_m
        assert end_m == (1890.0 if free else 4890.0) + MARGIN_M


# Speed limits and telegrams ---------------------------------------------------------------

STEPPED = Segment(
    1, "up", LENGTH_M, ((0.0, 10.0), (1000.0, 20.0), (2000.0, 15.0), (3000.0, 25.0), (4000.0, 5.0))
)


@pytest.mark.parametrize(
    ("front_m", "direction", "limit_mps", "steps"),
    [
        (500.0, 1, 10.0, [(1110.0, 20.0), (2000.0, 15.0), (3110.0, 25.0), (4000.0, 5.0)]),
        (1104.0, 1, 10.0, [(1110.0, 20.0), (2000.0, 15.0), (3110.0, 25.0), (4000.0, 5.0)]),
        (1115.0, 1, 20.0, [(2000.0, 15.0), (3110.0, 25.0), (4000.0, 5.0)]),
        (1995.0, 1, 15.0, [(3110.0, 25.0), (4000.0, 5.0)]),
        (4500.0, -1, 5.0, [(3890.0, 25.0), (3000.0, 15.0), (1890.0, 20.0), (1000.0, 10.0)]),
        (1500.0, -1, 20.0, [(1000.0, 10.0)]),
    ],
)
def test_limits_hold_for_the_whole_train_and_steps_up_wait_for_its_rear(
    front_m: float, direction: int, limit_mps: float, steps: list[tuple[float, float]]
) -> None:
    block = zone(start(1, front_m, direction, uncertainty_m=5.0), segments=(STEPPED,))
    authority = given_to(block, 1, 0.0)
    assert authority.limit_mps == limit_mps
    if len(steps) > MOST_STEPS:  # the last that fits stands for the rest
        lowest_mps = min(mps for _, mps in steps[MOST_STEPS - 1 :])
        steps = [*steps[: MOST_STEPS - 1], (steps[MOST_STEPS - 1][0], lowest_mps)]
    assert authority.steps == tuple(LimitStep(*step) for step in steps)
    telegram = to_telegram(authority)
    assert MovementAuthority.from_bytes(telegram.to_bytes()) == telegram
    assert to_telegram(authority, (front_m, 2.5)).located == (front_m, 2.5)


@settings(max_examples=40, deadline=None)
@given(st.data(), st.sampled_from([1, -1]))
def test_no_part_of_a_train_is_ever_told_more_than_its_limit(
    data: st.DataObject, direction: int
) -> None:
    places = data.draw(st.lists(st.integers(0, 4999), min_size=1, max_size=9, unique=True))
    speeds = st.sampled_from([5.0, 10.0, 15.0, 20.0])
    limits = tuple((float(at), data.draw(speeds)) for at in sorted(places))
    track = Segment(1, "up", LENGTH_M, limits)
    front_m = data.draw(st.floats(200.0, 4800.0))
    half_m = data.draw(st.floats(0.0, 30.0))
    authority = given_to(
        zone(start(1, front_m, direction, uncertainty_m=half_m), segments=(track,)), 1, 0.0
    )
    telegram = to_telegram(authority)
    assert len(telegram.steps) <= MOST_STEPS

    def limit_mps(chainage_m: float) -> float:
        before = [mps for from_m, mps in limits if from_m <= chainage_m]
        return before[-1] if before else limits[0][1]

    worst_m = front_m + direction * half_m
    way_m = max(direction * (authority.end_m - worst_m), 0.0)
    for part in range(60):
        place_m = worst_m + direction * way_m * part / 60.0
        body = (place_m - direction * (TRAIN_M + 2.0 * half_m) * k / 40.0 for k in range(41))
        assert telegram.limit_at(place_m) <= min(map(limit_mps, body))


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (lambda: Segment(1, "up", 0.0, ((0.0, 1.0),)), r"length_m: 0\.0"),
        (lambda: Segment(1, "up", 10.0, ()), "limits: there is none on up"),
        (lambda: Segment(1, "up", 10.0, ((5.0, 1.0), (5.0, 2.0))), r"5\.0 m after 5\.0 m"),
        (lambda: Segment(1, "up", 10.0, ((0.0, 201.0),)), r"limit_mps .* got 201\.0"),
        (lambda: start(70000, 0.0), "number .* got 70000"),
        (lambda: start(1, 0.0, 2), "direction .* got 2"),
        (lambda: start(1, nan), "front_m .* got nan"),
        (lambda: start(1, 0.0, uncertainty_m=-1.0), r"uncertainty_m .* got -1\.0"),
        (lambda: TrainStart(1, "T1", 0.0, 1, 1), r"length_m: 0\.0"),
        (lambda: zone(start(1, 0.0), start(1, 9.0)), "train 1 is in service already"),
        (lambda: zone(TrainStart(1, "T1", 9.0, 1, 9)), "segment: 9 of train 1"),
        (lambda: zone(segments=(TRACK, TRACK)), "segments: number 1 is given twice"),
        (lambda: MovingBlock([TRACK], margin_m=-1.0), r"margin_m: -1\.0"),
        (lambda: MovingBlock([TRACK], validity_s=nan), "validity_s: nan"),
    ],
)
def test_what_makes_no_sense_is_refused(wrong: object, what: str) -> None:
    with pytest.raises(ValueError, match=what):
        wrong()  # type: ignore[operator]


# Trains that obey -------------------------------------------------------------------------

TICK_S = 0.25
ROLL_BACK_M = 2.0


@dataclass
class Sim:
    """A train that does as it likes within the authority that it last got."""

    number: int
    direction: int
    at_m: float  # true front, along its direction
    half_m: float
    error_m: float
    speed_mps: float = 0.0
    end_m: float = -inf
    valid_s: float = -inf
    issued_s: float = -inf
    rolled: bool = False
    fronts_m: list[float] = field(default_factory=list)

    def step(self, time_s: float, dice: Random) -> None:
        mood = dice.random()
        if mood < 0.1:
            self.speed_mps = 0.0
        elif mood < 0.2:
            self.speed_mps = dice.uniform(0.2, 3.0)
        elif mood < 0.45:
            self.speed_mps = LIMIT_MPS + 2.0
        if time_s >= self.valid_s:
            self.speed_mps = 0.0
        # It knows its front as well as it reports it, and keeps the worst of it inside.
        free_m = self.end_m - (self.at_m + self.error_m + self.half_m)
        way_m = min(self.speed_mps * TICK_S, max(free_m, 0.0))
        if mood > 0.995 and not self.rolled:
            self.rolled, way_m = True, -ROLL_BACK_M
        self.at_m += way_m

    def told(self, dice: Random) -> LocationReport:
        self.error_m = min(max(self.error_m + dice.uniform(-1, 1), -self.half_m), self.half_m)
        return told(
            self.number,
            self.direction * (self.at_m + self.error_m),
            self.half_m,
            direction=self.direction,
            speed_mps=self.speed_mps,
            integrity_confirmed=dice.random() > 0.1,
            position_valid=dice.random() > 0.05,
        )


def run(dice: Random, trains: list[Sim], loss: float, late_s: float, ticks: int) -> None:
    block = zone(
        *(
            start(sim.number, sim.direction * sim.at_m, sim.direction, uncertainty_m=sim.half_m)
            for sim in trains
        )
    )
    mail: list[tuple[float, int, int, float, object]] = []
    count = 0
    for tick in range(1, ticks):
        time_s = tick * TICK_S
        for sim in trains:
            sim.step(time_s, dice)
            due_s = time_s + dice.uniform(0.0, late_s)
            if tick % 2 == 0 and dice.random() > loss:
                count += 1
                heapq.heappush(mail, (due_s, count, sim.number, time_s, sim.told(dice)))
            if dice.random() < 0.5:
                sigma_m = dice.choice([0.5, 3.0])
                at_m = sim.direction * sim.at_m + min(max(dice.gauss(0, sigma_m), -9), 9)
                block.ranged(sim.number, time_s, 1, at_m, sigma_m + 1.0)
            authority = given_to(block, sim.number, time_s)
            assert not authority.shortened
            assert not authority.emergency_stop
            if dice.random() > loss:
                count += 1
                heapq.heappush(mail, (due_s, count, sim.number, time_s, authority))
        while mail and mail[0][0] <= time_s:
            _, _, number, made_s, what = heapq.heappop(mail)
            sim = next(sim for sim in trains if sim.number == number)
            if isinstance(what, LocationReport):
                block.report(number, made_s, what)
            elif isinstance(what, IssuedAuthority) and made_s > sim.issued_s:
                sim.issued_s, sim.valid_s = made_s, made_s + what.validity_s
                sim.end_m = sim.direction * to_telegram(what).end_of_authority_m
        for sim in trains:
            assert block.troubles(sim.number) in ((), (Trouble.INTEGRITY,), (Trouble.INVALID,)) or (
                block.troubles(sim.number) == (Trouble.INVALID, Trouble.INTEGRITY)
            )
            occupied = block.occupied(sim.number, time_s)
            assert occupied is not None
            rear_m, front_m = (sim.direction * place_m for place_m in occupied)
            assert rear_m - ROLL_BACK_M <= sim.at_m - TRAIN_M + 1e-6
            assert front_m >= sim.at_m - 1e-6
        bodies = sorted(
            sorted((sim.direction * sim.at_m, sim.direction * (sim.at_m - TRAIN_M)))
            for sim in trains
        )
        for below, above in pairwise(bodies):
            assert below[1] <= above[0]


@settings(max_examples=16, deadline=None)
@given(
    st.integers(0, 2**32),
    st.lists(st.integers(0, 400), min_size=2, max_size=5),
    st.integers(0, 2),
    st.sampled_from([0.0, 0.1, 0.5]),
    st.sampled_from([0.0, 0.6, 3.0]),
)
def test_trains_that_obey_never_meet(
    seed: int, gaps: list[int], oncoming: int, loss: float, late_s: float
) -> None:
    dice = Random(seed)
    trains = []
    at_m = 200.0
    for number, gap_m in enumerate(gaps):
        half_m = dice.uniform(0.0, 15.0)
        backwards = number >= len(gaps) - oncoming
        front_m = -(at_m - TRAIN_M) if backwards else at_m
        at_m += TRAIN_M + 31.0 + MARGIN_M + gap_m
        error_m = dice.uniform(-half_m, half_m)
        trains.append(Sim(number, -1 if backwards else 1, front_m, half_m, error_m))
    run(dice, trains, loss, late_s, 100)


@pytest.mark.parametrize("delay_s", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("half_m", [0.0, 4.0])
def test_headway_closes_to_the_analytic_minimum(delay_s: float, half_m: float) -> None:
    """Front to front: L + margin + both uncertainties + v (age of report + way of authority)."""
    block = zone(start(1, 1300.0, uncertainty_m=half_m), start(2, 1500.0, uncertainty_m=half_m))
    late = round(delay_s / TICK_S)
    speed_mps, follower_m = 20.0, 1300.0
    sent: list[tuple[float, float]] = []
    ends_m: list[float] = []
    distance_m = inf
    for tick in range(1, 520):
        time_s = tick * TICK_S
        leader_m = 1500.0 + min(speed_mps * time_s, 2500.0)
        sent.append((time_s, leader_m))
        if tick > late:
            made_s, at_m = sent[tick - 1 - late]
            block.report(2, made_s, told(2, at_m, half_m, speed_mps=speed_mps))
        authority = given_to(block, 1, time_s)
        ends_m.append(authority.end_m)
        assert not authority.shortened
        if tick > late:
            reach_m = ends_m[tick - 1 - late] - half_m
            follower_m = min(max(reach_m, follower_m), follower_m + 22.0 * TICK_S)
        if leader_m < 4000.0:
            distance_m = leader_m - follower_m
            if tick == 499:
                expected_m = TRAIN_M + MARGIN_M + 2 * half_m + speed_mps * 2 * late * TICK_S
                assert distance_m == pytest.approx(expected_m, abs=1e-6)
    # The leader has stopped: the delays do not count any more.
    assert leader_m - follower_m == pytest.approx(TRAIN_M + MARGIN_M + 2 * half_m, abs=1e-6)


def test_for_a_train_that_leaves_the_track_does_not_end_and_for_others_it_does() -> None:
    block = MovingBlock(
        (TRACK,),
        (start(1, 3000.0), start(2, 1000.0)),
        margin_m=MARGIN_M,
        end_margin_m=END_MARGIN_M,
        leaving=(1,),
    )
    assert given_to(block, 1, 0.0).end_m > LENGTH_M + 1000.0
    assert given_to(block, 2, 0.0).end_m < 3000.0 - TRAIN_M
    block.remove(1)
    assert given_to(block, 2, 1.0).end_m == LENGTH_M - END_MARGIN_M


def test_a_temporary_restriction_is_told_while_it_holds() -> None:
    track = Segment(1, "up", 5000.0, ((0.0, 20.0),))
    block = MovingBlock(
        [track],
        [TrainStart(7, "T7", 100.0, 1, 1, 500.0)],
        end_margin_m=0.0,
        buffer_m=30.0,
        restrictions=[SpeedRestriction(1, 1000.0, 1500.0, 8.0, 10.0, 60.0)],
    )
    for time_s, expected in ((5.0, []), (10.0, [8.0, 20.0]), (59.0, [8.0, 20.0]), (60.0, [])):
        authority = block.authority(7, time_s)
        assert authority is not None
        assert [step.limit_mps for step in authority.steps] == expected
        assert (authority.overlap_m, authority.release) == (30.0, True)
