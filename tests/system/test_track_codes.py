"""Trains that run on what they understand from the rails, through the whole graph."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def _is_safe(train: dict[str, Any]) -> bool:
    """No wrong message, no overspeed, no block of another train entered."""
    code, atp = train["track_code"], train["atp"]
    return bool(code["wrong"] == 0 and atp["overspeed_s"] == 0.0 and atp["entered_occupied"] == 0)


def test_a_train_follows_another_through_blocks(corridor: CorridorFactory) -> None:
    report = corridor("follow_codes", duration_s=110.0).run_to_end().report
    leader, follower = report["trains"]["leader"], report["trains"]["follower"]
    assert _is_safe(leader)
    assert _is_safe(follower)
    assert report["missing_ticks"] == 0
    # Held until two blocks are free, then on its way: by the codes, without the brake.
    assert 200.0 < follower["distance_m"] < leader["distance_m"]
    assert follower["atp"]["interventions"] == 0
    assert follower["atp"]["margin_min_m"] > 400.0
    assert follower["track_code"]["decoded"] >= 3
    # A code must fill a slot of 1.5625 s before it counts.
    assert 1.5 < follower["track_code"]["latency_p95_s"] < 3.0


def test_a_heedless_driver_is_braked(corridor: CorridorFactory) -> None:
    report = corridor("heedless_driver", duration_s=140.0).run_to_end().report
    follower = report["trains"]["follower"]
    assert _is_safe(follower)
    assert follower["distance_m"] > 300.0
    assert follower["atp"]["interventions"] > 1
    assert follower["atp"]["emergency_brakes"] == 0
    assert follower["atp"]["margin_min_m"] > 400.0


def test_a_train_that_loses_the_codes_stops_and_goes_on(corridor: CorridorFactory) -> None:
    report = corridor("lost_codes").run_to_end().report
    train = report["trains"]["train_a"]
    assert _is_safe(train)
    assert train["atp"]["interventions"] >= 1
    lost = [e for e in report["events"] if e["message"] == "no valid code" and e["time_s"] > 50.0]
    # The sand falls at 55 s; the receiver may answer until its response time is over.
    assert len(lost) == 1
    assert 55.0 < lost[0]["time_s"] < 59.0
    # Without a code from 55 to 95 s it stands; with one again it runs on.
    assert 0.5 < train["track_code"]["availability"] < 0.75
    assert train["distance_m"] > 900.0
