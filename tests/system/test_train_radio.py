"""Trains that run on movement authorities received by radio, through the whole graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .conftest import Rail

pytestmark = pytest.mark.system


def _is_safe(train: dict[str, Any]) -> bool:
    """Within its authority and the limits, where it believes to be, with what it was given."""
    link, atp = train["cbtc"], train["atp"]
    kept = atp["passed_authority"] == 0 and atp["overspeed_s"] == 0.0
    return bool(kept and link["forged_accepted"] == 0 and link["mislocated"] == 0)


def test_trains_follow_at_braking_distance_and_stop_behind_one_that_stops(rail: Rail) -> None:
    report = rail.report("moving_block", "--duration", 95)
    trains = report["trains"]
    assert all(_is_safe(train) for train in trains.values())
    assert report["missing_ticks"] == 0
    assert report["failures"] == []
    # The first stops from 70 to 110 s; those behind come close, and stay apart.
    assert trains["first"]["distance_m"] > 600.0
    for name in ("second", "third", "fourth"):
        assert 600.0 < trains[name]["distance_m"] < trains["first"]["distance_m"] + 350.0
        assert 10.0 < trains[name]["atp"]["margin_min_m"] < 250.0
    for train in trains.values():
        assert train["cbtc"]["frames"] > 700
        assert train["cbtc"]["age_p95_s"] < 1.0


def test_the_same_to_the_last_bit_wherever_the_nodes_live(rail: Rail) -> None:
    digests = {
        rail.report("moving_block", "--duration", 6, "--processes", placement)["digest"]
        for placement in ("one", "site")
    }
    assert len(digests) == 1
