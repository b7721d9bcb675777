"""Verdicts on positions by Doppler shifts: errors are those put in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ...run_builder import RunBuilder

TICKS = 10
AT_M = 500.0


def some(ticks: tuple[int, ...], value: float, otherwise: float) -> np.ndarray:
    found = np.full(TICKS, otherwise)
    found[list(ticks)] = value
    return found


def test_errors_of_doppler_positions_are_those_put_in() -> None:
    run = RunBuilder("sensors", TICKS).moves("train_a", AT_M, 20.0)
    reason = some((0, 1), 3.0, 0.0)
    run.fixed("train_a", some((0, 9), AT_M + 8.0, AT_M + 2.0), 1.0, reason)
    values = run.train("train_a")["doppler"]
    assert values["availability"] == 0.8
    assert values["max_m"] == 8.0
    assert values["rmse_m"] == pytest.approx(math.sqrt((7 * 4.0 + 64.0) / 8))
    # Far more than what is stated: the mean of the squares of errors over sigmas is 1 when honest.
    assert values["normalised_error"] == pytest.approx((7 * 4.0 + 64.0) / 8)
    assert values["stated_m"] == 1.0
