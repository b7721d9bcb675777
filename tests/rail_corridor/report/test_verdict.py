"""A verdict: what of a report must be zero, and what a report without it says."""

from __future__ import annotations

from typing import Any

import pytest

from rail_corridor.equipment.registry import subsystems
from rail_corridor.report.verdict import verdict_of

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
