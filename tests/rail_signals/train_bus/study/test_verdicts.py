"""What the campaign of the train bus calls located: an interpretation by the script."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rail_signals.train_bus.faults import place_of
from rail_signals.train_bus.study import campaign
from rail_signals.train_bus.study.campaign import HEALTHY, Case, CaseResult, draw_case, examine


def outcome(monkeypatch: pytest.MonkeyPatch, case: Case, kind: str, error_m: float) -> CaseResult:
    """Return what is made of a case whose fault is reported so far from where it is."""
    found: Any = None
    if kind != HEALTHY:
        at_m = 0.0 if case.fault is None else place_of(case.fault, case.consist.bus_line())
        found = SimpleNamespace(kind=kind, place_m=at_m + error_m)
    monkeypatch.setattr(campaign, "measure_consist", lambda *_: None)
    monkeypatch.setattr(campaign, "interpret", lambda *_: SimpleNamespace(finding=found))
    return examine(case, np.random.default_rng(1))


def short_and_long() -> tuple[Case, Case]:
    """Return a train with less than 50 m of bus per half metre allowed, and one with more."""
    cases = [draw_case("open", np.random.default_rng(seed)) for seed in range(40)]
    lengths_m = [case.consist.length_m for case in cases]
    assert min(lengths_m) < 50.0 * 1.3 and max(lengths_m) > 400.0
    return cases[int(np.argmin(lengths_m))], cases[int(np.argmax(lengths_m))]


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("which", [0, 1])
def test_a_fault_is_located_within_half_a_metre_or_a_hundredth_of_the_bus(
    monkeypatch: pytest.MonkeyPatch, side: float, which: int
) -> None:
    case = short_and_long()[which]
    allowed_m = max(0.5, 0.01 * case.consist.length_m)
    for beyond_m, located in ((-1e-6, True), (1e-6, False)):
        error_m = side * (allowed_m + beyond_m)
        told = outcome(monkeypatch, case, "open", error_m)
        assert told.is_located is located
        assert told.error_m == pytest.approx(error_m)


def test_the_kind_that_is_reported_is_the_one_that_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    case = short_and_long()[0]
    assert outcome(monkeypatch, case, "short", 0.0).reported == "short"
    missed = outcome(monkeypatch, case, HEALTHY, 0.0)
    assert (missed.reported, missed.is_located) == (HEALTHY, False)


def test_a_fault_of_a_healthy_train_is_never_located(monkeypatch: pytest.MonkeyPatch) -> None:
    case = draw_case(HEALTHY, np.random.default_rng(2))
    told = outcome(monkeypatch, case, "open", 0.0)
    assert (told.reported, told.is_located) == ("open", False)
    assert np.isnan(told.error_m)
