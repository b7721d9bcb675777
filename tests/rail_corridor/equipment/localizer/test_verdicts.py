"""Verdicts on the position from all sensors: each says no where it must, and not before."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from ...run_builder import RunBuilder

TICKS = 10
AT_M = 500.0


def located(low_m: Any, high_m: Any, **more: Any) -> dict[str, Any]:
    """Return the figures of a train at 500 m whose localizer told these intervals."""
    run = RunBuilder("sensors", TICKS).moves("train_a", AT_M)
    values: dict[str, Any] = run.located("train_a", low_m, high_m, **more).train("train_a")[
        "localizer"
    ]
    return values


def some(ticks: tuple[int, ...], value: float, otherwise: float) -> Any:
    found = np.full(TICKS, otherwise)
    found[list(ticks)] = value
    return found


@pytest.mark.parametrize(("beyond_m", "exceeded"), [(0.0, 0), (1e-9, 3)])
def test_a_level_is_exceeded_at_either_end(beyond_m: float, exceeded: int) -> None:
    ticks = (1, 2, 8)
    assert located(some(ticks, AT_M + beyond_m, AT_M - 5.0), AT_M + 5.0)["exceeded"] == exceeded
    assert located(AT_M - 5.0, some(ticks, AT_M - beyond_m, AT_M + 5.0))["exceeded"] == exceeded


def test_an_unmonitored_position_counts_and_an_unavailable_one_does_not() -> None:
    status = some((0, 1, 2), 1.0, 0.0)
    values = located(AT_M + 1.0, AT_M + 2.0, status=status)
    assert values["exceeded"] == 3
    assert (values["availability"], values["protected"]) == (0.3, 0.0)


@pytest.mark.parametrize("which", ["low", "high", "both"])
def test_an_interval_that_is_no_number_holds_nothing(which: str) -> None:
    bad = some((4, 5), math.nan, 0.0)
    low_m = AT_M - 5.0 + (bad if which != "high" else 0.0)
    high_m = AT_M + 5.0 + (bad if which != "low" else 0.0)
    values = located(low_m, high_m)
    assert values["exceeded"] == 2
    assert values["protection_level_m"] == values["protection_level_p95_m"] == 5.0
    assert values["max_m"] == 0.0


def test_off_the_line_nothing_is_exceeded() -> None:
    run = RunBuilder("sensors", TICKS).moves("train_a", AT_M, on_line=some((3,), 1.0, 0.0))
    assert run.located("train_a", 0.0, 1.0).train("train_a")["localizer"]["exceeded"] == 1


def test_excluded_sensors_are_counted_while_there_is_a_position() -> None:
    values = located(AT_M - 1.0, AT_M + 1.0, excluded=some((2, 3), 1.0, 0.0))
    assert (values["excluded_ticks"], values["exceeded"]) == (2, 0)
