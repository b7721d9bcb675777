"""Joints passed, from the carriers that the receiver holds on to."""

from __future__ import annotations

from math import inf, nan

import pytest

from rail_onboard.localizer.block_entries import BlockEntries

JOINTS_M = (500.0, 1000.0, 1030.0)
CARRIERS_HZ = (2300.0, 1700.0, 1700.0)


def entries(first_hz: float = 2000.0) -> BlockEntries:
    """Return what has received a first carrier, far from any joint."""
    made = BlockEntries(JOINTS_M, CARRIERS_HZ)
    assert made.entered(first_hz, 0.0) is None
    return made


@pytest.mark.parametrize("believed_m", [440.0, 500.0, 560.0])
def test_a_new_carrier_near_its_joint_is_an_entry(believed_m: float) -> None:
    assert entries().entered(2300.0, believed_m) == 500.0


@pytest.mark.parametrize("believed_m", [439.9, 560.1, -500.0, nan, inf])
def test_far_from_its_joint_or_nowhere_it_is_none(believed_m: float) -> None:
    assert entries().entered(2300.0, believed_m) is None


def test_the_nearness_is_an_argument() -> None:
    for within_m, expected in ((9.9, None), (10.0, 500.0)):
        made = BlockEntries(JOINTS_M, CARRIERS_HZ, within_m)
        made.entered(2000.0, 0.0)
        assert made.entered(2300.0, 510.0) == expected


def test_of_two_joints_that_fit_none_is_named() -> None:
    assert entries().entered(1700.0, 1015.0) is None
    assert entries().entered(1700.0, 950.0) == 1000.0


def test_the_same_carrier_is_the_same_block() -> None:
    assert entries(2300.0).entered(2300.0, 500.0) is None


@pytest.mark.parametrize("nothing_hz", [0.0, -2300.0, nan, inf])
def test_after_a_gap_the_carrier_is_no_entry(nothing_hz: float) -> None:
    """It may be that of the block of before; a carrier that is not a number is a gap too."""
    made = entries(2300.0)
    assert made.entered(nothing_hz, 500.0) is None
    assert made.entered(2300.0, 500.0) is None
    assert made.entered(1700.0, 950.0) == 1000.0


def test_reset_it_has_received_nothing() -> None:
    made = entries()
    made.reset()
    assert made.entered(2300.0, 500.0) is None


def test_joints_and_carriers_belong_together() -> None:
    with pytest.raises(ValueError, match="joints_m: 2 for 1 carriers"):
        BlockEntries((1.0, 2.0), (1700.0,))
