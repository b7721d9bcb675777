"""A verdict: what of a report must be zero, and what a report without it says."""

from __future__ import annotations

from typing import Any

import pytest

from rail_corridor.equipment.registry import subsystems
from rail_corridor.report.verdict import NOT_LIVE, UNSAFE, event_counts, verdict_of

SAFE: dict[str, Any] = {
    "trains": {
        "first": {"atp": {"passed_authority": 0, "overspeed_s": 0.0}, "cbtc": {"mislocated": 0}},
        "second": {"atp": {"passed_authority": 0, "overspeed_s": 0.0}},
    }
}


def test_nothing_that_must_be_zero_is_safe() -> None:
    verdict = verdict_of(SAFE)
    assert verdict == "safe" and verdict.safe and str(verdict) == "safe"
    # Figures of equipment that the scenario has not are left out.
    assert verdict.counters == {
        "trains.first.atp.passed_authority": 0.0,
        "trains.first.atp.overspeed_s": 0.0,
        "trains.first.cbtc.mislocated": 0.0,
        "trains.second.atp.passed_authority": 0.0,
        "trains.second.atp.overspeed_s": 0.0,
    }


@pytest.mark.parametrize("path", [path for each in subsystems() for path in each.hazards])
def test_each_of_them_alone_makes_it_unsafe(path: str) -> None:
    report: dict[str, Any] = {}
    *folders, name = path.replace("*", "train_x").split(".")
    inner = report
    for folder in folders:
        inner = inner.setdefault(folder, {})
    inner[name] = 3
    verdict = verdict_of(report)
    assert verdict == "unsafe" and verdict != "safe"
    assert verdict.violations == {path.replace("*", "train_x"): 3.0}
    assert str(verdict) == f"unsafe: {path.replace('*', 'train_x')} 3"


def test_a_figure_that_is_not_there_is_no_violation() -> None:
    assert verdict_of({"trains": {"a": {"atp": {"passed_authority": None}}}}) == "safe"
    assert verdict_of({}).counters == {}


def event(kind: str, level: str = "error") -> dict[str, Any]:
    return {"kind": kind, "level": level, "time_s": 12.0, "name": "x", "message": f"{kind} of a"}


@pytest.mark.parametrize("kind", UNSAFE)
def test_an_event_that_must_not_happen_makes_it_unsafe(kind: str) -> None:
    verdict = verdict_of({"events": [event(kind), event("stuck")]})
    assert verdict == "unsafe" and not verdict.safe
    assert verdict.reasons == (f"{kind} of a (12.0 s)", "stuck of a (12.0 s)")
    assert verdict.violations == {f"events.{kind}": 1.0}


@pytest.mark.parametrize("kind", NOT_LIVE)
def test_who_stands_for_too_long_makes_it_not_live(kind: str) -> None:
    verdict = verdict_of({"events": [event(kind)]})
    assert verdict == "not live" and verdict != "safe" and not verdict.violations
    assert str(verdict) == f"not live: {kind} of a (12.0 s)"
    # What is over is no error any more.
    assert verdict_of({"events": [event(kind, "ok")]}) == "safe"


def test_who_waits_at_an_entrance_and_what_nodes_say_is_no_verdict() -> None:
    said = {"level": "error", "time_s": 1.0, "name": "/a/b: c", "message": "no answer"}
    assert verdict_of({"events": [event("entrance", "warn"), said]}) == "safe"


def test_every_kind_is_counted_also_where_there_is_none() -> None:
    counts = event_counts([event("collision"), event("collision"), event("stuck"), {}])
    assert {key for key, count in counts.items() if not count} == counts.keys() - {
        "collision",
        "stuck",
    }
    assert (counts["collision"], counts["stuck"]) == (2, 1)
    assert "occupied_block_entered" in counts
