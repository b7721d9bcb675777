"""Faults are named, positions that cannot be trusted are flagged, and none is silently wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory


def told(report: dict[str, Any], name: str, message: str) -> list[float]:
    """Return the times at which a node said something on ``/diagnostics``."""
    return [
        event["time_s"]
        for event in report["events"]
        if event["name"] == name and message in event["message"]
    ]


def misleading(report: dict[str, Any]) -> int:
    return sum(train["phase_ranging"]["misleading_ticks"] for train in report["trains"].values())


def test_dead_station(corridor: CorridorFactory) -> None:
    report = corridor("dead_station").run_to_end().report
    assert misleading(report) == 0
    controller = "/wayside/zone_controller: train_a"
    # The station before it reaches two zones: past the end of its own it still sees the train...
    (beyond_s,) = told(report, controller, "past the end of zone3: wrs4 does not answer")[:1]
    # ... and where it sees nothing either, the train is lost, until the next station takes over.
    (lost_s,) = told(report, controller, "lost past the end of zone3: wrs4 does not answer")
    assert 8.0 < beyond_s < lost_s < 20.0
    ranging = report["trains"]["train_a"]["phase_ranging"]
    # ... and 1.5 s more, until it is confirmed.
    assert 0.93 < ranging["availability"] < 1.0
    # The train behind comes to the station after it is back.
    assert report["trains"]["train_b"]["phase_ranging"]["availability"] == 1.0


def test_jammed_channel(corridor: CorridorFactory) -> None:
    report = corridor("jammed_channel").run_to_end().report
    assert misleading(report) == 0
    assert 8.0 in told(report, "/wayside/wrs3: zone3", "channel jammed on CH2")
    (jammed_s,) = told(report, "/train_a/vrs: ranging", "channel jammed on CH1")[:1]
    assert 30.0 <= jammed_s < 40.0
    assert told(report, "/wayside/zone_controller: train_a", "not received in zone5")
    train = report["trains"]["train_a"]
    assert 0.8 < train["phase_ranging"]["availability"] < 1.0
    # Between the jammers, and after them, it is as good as ever: 95 % are within the jammed 1 m.
    assert train["handovers"]["missed"] == 0


def test_two_trains_in_one_zone(corridor: CorridorFactory) -> None:
    report = corridor("two_trains").run_to_end().report
    assert misleading(report) == 0
    (shared_s,) = told(report, "/wayside/wrs3: zone3", "more than one signal in the zone")
    for train in ("train_a", "train_b"):
        assert told(report, f"/wayside/zone_controller: {train}", "zone3 disturbed") == [shared_s]
        # Not known while both are in it, known before and, by name, after.
        assert 0.4 < report["trains"][train]["phase_ranging"]["availability"] < 0.8
        assert report["trains"][train]["handovers"]["missed"] == 0
