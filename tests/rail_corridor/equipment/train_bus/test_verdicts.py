"""Verdicts on the train bus: what its monitor said too early, and what was lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rail_signals.train_bus.faults import KINDS

from ...run_builder import RunBuilder, built_in

SCENARIO = built_in("failing_bus")
TICK_S = SCENARIO.tick_s
FROM = 80  # the tick in which the contact begins to fret, 20 s
LOOSE = KINDS.index("loose_connector") + 1.0
TICKS = 100


def bus(**more: Any) -> dict[str, Any]:
    run = RunBuilder("failing_bus", TICKS).bus("train_a", **more)
    values: dict[str, Any] = run.train("train_a")["train_bus"]
    return values


def test_the_fault_begins_when_counted_on() -> None:
    assert [(f.kind, f.from_s) for f in SCENARIO.faults] == [("bus_fault", FROM * TICK_S)]


@pytest.mark.parametrize(("tick", "false"), [(FROM - 1, 1), (FROM, 0)])
def test_a_fault_that_is_reported_before_there_is_one_is_false(tick: int, false: int) -> None:
    values = bus(kind=np.where(np.arange(TICKS) >= tick, LOOSE, 0.0), place_m=141.0)
    assert len(values["faults"]) == 1
    assert values["false_reports"] == false
    assert values["reported_s"] == (None if false else FROM * TICK_S)


def test_each_change_of_mind_before_the_fault_is_one_more() -> None:
    kinds = np.zeros(TICKS)
    kinds[10:20], kinds[20:30], kinds[40:50], kinds[90:] = 1.0, 2.0, 1.0, LOOSE
    values = bus(kind=kinds, place_m=141.0)
    assert (len(values["faults"]), values["false_reports"]) == (4, 3)
    assert values["reported_s"] == 90 * TICK_S


def test_lost_frames_and_wrong_bits_of_both_ends_are_counted() -> None:
    values = bus(lost=np.arange(TICKS) // 50, bit_errors=np.arange(TICKS) // 10)
    assert (values["lost"], values["bit_errors"]) == (2, 18)
    assert values["first_loss_s"] == 50 * TICK_S
    good = bus()
    assert (good["lost"], good["bit_errors"], good["first_loss_s"]) == (0, 0, None)
