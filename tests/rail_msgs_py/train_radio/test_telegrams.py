"""Location reports and movement authorities: read as written, rounded to the safe side only."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_msgs_py.train_radio.fixed_point import down, nearest, up
from rail_msgs_py.train_radio.movement_authority import (
    AUTHORITY_BYTES,
    LimitStep,
    MovementAuthority,
)
from rail_msgs_py.train_radio.train_report import REPORT_BYTES, LocationReport

IDENTITIES = st.integers(0, 0xFFFF)
CHAINAGES = st.floats(-1e6, 1e6)
SPEEDS = st.floats(0.0, 200.0)
# Neighbours within a step of the resolution, where rounding could change their order.
CLOSE = st.floats(-0.03, 0.03)
REPORT = LocationReport(7, 2, 1234.567, 1, 20.0, 3.0, 160.0, True, True)
AUTHORITY = MovementAuthority(7, 2, 1, 900.0, 20.0, 3.0)

reports = st.builds(
    LocationReport,
    IDENTITIES,
    IDENTITIES,
    CHAINAGES,
    st.sampled_from([1, -1]),
    SPEEDS,
    st.floats(0.0, 6553.5),
    st.floats(0.0, 6000.0, exclude_min=True),
    st.booleans(),
    st.booleans(),
)


@st.composite
def authorities(draw: st.DrawFn) -> MovementAuthority:
    direction = draw(st.sampled_from([1, -1]))
    base_m = draw(st.floats(-1e5, 1e5))
    places = {base_m + x for x in draw(st.lists(CLOSE | st.floats(-2e3, 2e3), max_size=2))}
    limits = SPEEDS | st.sampled_from([10.0, 10.004, 20.0, 30.0])
    return MovementAuthority(
        draw(IDENTITIES),
        draw(IDENTITIES),
        direction,
        draw(CHAINAGES),
        draw(limits),
        draw(st.floats(0.0, 600.0)),
        tuple(LimitStep(x, draw(limits)) for x in sorted(places, key=lambda x: direction * x)),
        draw(st.booleans()),
        draw(st.none() | st.tuples(CHAINAGES, st.floats(0.0, 6553.5))),
    )


@given(st.floats(-1e9, 1e9), st.sampled_from([1, 10, 100]))
def test_rounding_needs_no_tolerance(value: float, per_unit: int) -> None:
    assert down(value, per_unit) / per_unit <= value <= up(value, per_unit) / per_unit
    assert up(value, per_unit) - down(value, per_unit) in (0, 1)
    for count in (down(value, per_unit), nearest(value, per_unit)):
        assert down(count / per_unit, per_unit) == up(count / per_unit, per_unit) == count


@given(reports)
def test_a_report_covers_what_was_measured(report: LocationReport) -> None:
    raw = report.to_bytes()
    assert len(raw) == REPORT_BYTES == 16
    read = LocationReport.from_bytes(raw)
    same = ("train", "segment", "direction", "integrity_confirmed")
    assert [getattr(read, name) for name in same] == [getattr(report, name) for name in same]
    assert report.speed_mps <= read.speed_mps < report.speed_mps + 0.0101
    assert report.length_m <= read.length_m < report.length_m + 0.101
    if read.position_valid:
        assert report.position_valid
        for sign in (1, -1):
            edge = Fraction(report.offset_m) + sign * Fraction(report.uncertainty_m)
            read_edge = Fraction(read.offset_m) + sign * Fraction(read.uncertainty_m)
            assert sign * read_edge >= sign * edge
        assert read.uncertainty_m < report.uncertainty_m + 0.106
    else:
        assert not report.position_valid or report.uncertainty_m > 6553.49


@given(reports)
def test_a_report_that_was_read_is_written_as_it_was(report: LocationReport) -> None:
    raw = report.to_bytes()
    assert LocationReport.from_bytes(raw).to_bytes() == raw


def test_an_uncertainty_too_wide_for_its_field_makes_the_position_invalid() -> None:
    widest = replace(REPORT, uncertainty_m=6553.5)
    assert not LocationReport.from_bytes(widest.to_bytes()).position_valid
    on_a_step = replace(widest, offset_m=1234.5)
    assert LocationReport.from_bytes(on_a_step.to_bytes()) == on_a_step


def test_the_ends_of_a_train_in_both_directions() -> None:
    assert (REPORT.front_m, REPORT.rear_m) == pytest.approx((1237.567, 1071.567))
    back = replace(REPORT, direction=-1)
    assert (back.front_m, back.rear_m) == pytest.approx((1231.567, 1397.567))


@given(authorities())
def test_an_authority_never_allows_more_than_was_computed(authority: MovementAuthority) -> None:
    raw = authority.to_bytes()
    assert len(raw) == AUTHORITY_BYTES == 32
    read = MovementAuthority.from_bytes(raw)
    same = ("train", "segment", "direction", "emergency_stop")
    assert [getattr(read, name) for name in same] == [getattr(authority, name) for name in same]
    shorter_m = authority.direction * (authority.end_of_authority_m - read.end_of_authority_m)
    assert 0.0 <= shorter_m < 0.0101
    assert authority.validity_s - 0.0101 < read.validity_s <= authority.validity_s
    # Limits are constant between steps: both sides of each step, and between, see them all.
    places = {step.from_m for step in (*authority.steps, *read.steps)} | {0.0}
    marks = {y for x in places for y in (x, math.nextafter(x, -2e6), math.nextafter(x, 2e6))}
    marks |= {(a + b) / 2.0 for a, b in itertools.pairwise(sorted(marks))}
    for mark in marks:
        assert read.limit_at(mark) <= authority.limit_at(mark)
    assert read.to_bytes() == raw
    if read.located is not None:
        assert authority.located is not None
        (place_m, half_m), (read_m, read_half_m) = authority.located, read.located
        assert read_m - read_half_m <= place_m - half_m <= place_m + half_m <= read_m + read_half_m
        assert read_half_m < half_m + 0.1051
    else:
        assert authority.located is None or authority.located[1] > 6553.49


def test_what_is_on_a_step_of_the_resolution_is_kept_exactly() -> None:
    steps = (LimitStep(120.01, 30.0), LimitStep(700.29, 15.5))
    authority = replace(AUTHORITY, steps=steps, emergency_stop=True, located=(812.34, 2.5))
    assert MovementAuthority.from_bytes(authority.to_bytes()) == authority
    report = replace(REPORT, offset_m=1234.57, integrity_confirmed=False, position_valid=False)
    assert LocationReport.from_bytes(report.to_bytes()) == report


def test_the_limit_along_the_way() -> None:
    authority = replace(AUTHORITY, steps=(LimitStep(100.0, 30.0), LimitStep(300.0, 10.0)))
    assert [authority.limit_at(x) for x in (0.0, 99.9, 100.0, 299.9, 300.0, 950.0)] == [
        *(20.0, 20.0, 30.0, 30.0, 10.0, 10.0)
    ]


@pytest.mark.parametrize(
    ("base", "change"),
    [
        (REPORT, {"train": -1}),
        (REPORT, {"train": 65536}),
        (REPORT, {"segment": True}),
        (REPORT, {"segment": 1.0}),
        (REPORT, {"offset_m": math.nan}),
        (REPORT, {"offset_m": 1.1e6}),
        (REPORT, {"direction": 0}),
        (REPORT, {"speed_mps": -0.1}),
        (REPORT, {"speed_mps": math.inf}),
        (REPORT, {"uncertainty_m": 6553.6}),
        (REPORT, {"length_m": 0.0}),
        (REPORT, {"length_m": 6000.1}),
        (AUTHORITY, {"direction": True}),
        (AUTHORITY, {"end_of_authority_m": -1.1e6}),
        (AUTHORITY, {"limit_mps": 200.1}),
        (AUTHORITY, {"validity_s": 601.0}),
        (AUTHORITY, {"steps": tuple(LimitStep(float(x), 1.0) for x in range(4))}),
        (AUTHORITY, {"located": (0.0, -1.0)}),
        (AUTHORITY, {"located": (2e6, 1.0)}),
        (AUTHORITY, {"steps": (LimitStep(5.0, 1.0), LimitStep(5.0, 2.0))}),
        (AUTHORITY, {"steps": (LimitStep(1.0, 1.0), LimitStep(2.0, 2.0)), "direction": -1}),
    ],
)
def test_a_bad_value_is_named_and_quoted(base: Any, change: dict[str, Any]) -> None:
    name = next(iter(change))
    with pytest.raises(ValueError, match=f"{name}.*(got|at most)"):
        replace(base, **change)


def test_a_bad_step_is_named_and_quoted() -> None:
    with pytest.raises(ValueError, match=r"from_m .* got 2000000\.0"):
        LimitStep(2e6, 1.0)
    with pytest.raises(ValueError, match=r"limit_mps .* got nan"):
        LimitStep(0.0, math.nan)


@given(st.binary(max_size=40) | st.binary(min_size=16, max_size=16) | st.binary(min_size=32))
def test_any_bytes_are_a_telegram_that_is_written_the_same_or_an_error(raw: bytes) -> None:
    for telegram in (LocationReport, MovementAuthority):
        try:
            read = telegram.from_bytes(raw)
        except ValueError:
            continue
        again = telegram.from_bytes(read.to_bytes())
        # Steps that rise out of order within one step of the resolution may be merged.
        assert again.to_bytes() == read.to_bytes()


def test_bits_that_mean_nothing_are_refused() -> None:
    raw = bytearray(REPORT.to_bytes())
    raw[14] |= 16
    with pytest.raises(ValueError, match="flags 0x17"):
        LocationReport.from_bytes(bytes(raw))
    raw = bytearray(AUTHORITY.to_bytes())
    raw[12] |= 64
    with pytest.raises(ValueError, match="not a movement authority"):
        MovementAuthority.from_bytes(bytes(raw))
    with pytest.raises(ValueError, match="32 bytes, got 31"):
        MovementAuthority.from_bytes(bytes(31))
    with pytest.raises(ValueError, match="16 bytes, got 0"):
        LocationReport.from_bytes(b"")


@pytest.mark.parametrize(("overlap_m", "told_m"), [(0.0, 0.0), (10.4, 10.0), (900.0, 127.5)])
def test_an_overlap_is_told_no_longer_than_it_is(overlap_m: float, told_m: float) -> None:
    authority = MovementAuthority(
        7, 2, 1, 100.0, 20.0, 3.0, overlap_m=overlap_m, release=overlap_m > 0.0
    )
    read = MovementAuthority.from_bytes(authority.to_bytes())
    assert (read.overlap_m, read.release) == (told_m, overlap_m > 0.0)
