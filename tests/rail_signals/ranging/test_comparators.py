"""Comparators against Jeong et al., Figs 4-6 and eq. 13, with the erratum of the pulse."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.ranging.comparators import (
    and_comparator,
    and_pulse_width_s,
    quadrature_comparator,
)
from rail_signals.ranging.phase_range import phase_to_range_m

TONE_HZ = 375e3
RATE_HZ = 25e6  # the 40 ns grid that explains the printed 1.04 us
T = np.arange(1000) / RATE_HZ  # 15 whole periods


def tone(lag_deg: float) -> np.ndarray:
    return np.sin(2 * math.pi * TONE_HZ * T - math.radians(lag_deg))


@pytest.mark.parametrize("lag_deg", [45.0, 315.0])
def test_figures_5_and_6(lag_deg: float) -> None:
    width_s = float(and_pulse_width_s(tone(0), tone(lag_deg), RATE_HZ))
    assert width_s == pytest.approx(1.000e-6, abs=0.5e-9)
    assert width_s * TONE_HZ == pytest.approx(0.375, abs=2e-4)
    lag = and_comparator(tone(0), tone(lag_deg), RATE_HZ, TONE_HZ)
    assert math.degrees(float(lag)) == pytest.approx(45, abs=0.05)
    assert float(phase_to_range_m(lag, TONE_HZ)) == pytest.approx(50, abs=0.1)


def test_printed_pulse_is_a_sampling_grid() -> None:
    limited = (tone(0) > 0) & (tone(45) > 0)
    edges = np.diff(limited.astype(int))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    widths = ends[ends > starts[0]][: len(starts)] - starts[: len(ends[ends > starts[0]])]
    assert set(widths.tolist()) <= {24, 25, 26}
    printed_lag_deg = 180 - 360 * TONE_HZ * 26 / RATE_HZ
    assert printed_lag_deg == pytest.approx(39.6)
    printed_m = float(phase_to_range_m(math.radians(printed_lag_deg), TONE_HZ))
    assert printed_m == pytest.approx(44, abs=0.1)


@given(st.floats(0.5, 179.5))
def test_and_comparator_folds(lag_deg: float) -> None:
    lag = float(and_comparator(tone(0), tone(lag_deg), RATE_HZ, TONE_HZ))
    lead = float(and_comparator(tone(0), tone(360 - lag_deg), RATE_HZ, TONE_HZ))
    assert math.degrees(lag) == pytest.approx(lag_deg, abs=0.1)
    assert math.degrees(lead) == pytest.approx(lag_deg, abs=0.1)


@given(st.floats(0, 359.99), st.floats(-180, 180))
def test_quadrature_comparator_does_not(lag_deg: float, start_deg: float) -> None:
    lag = float(quadrature_comparator(tone(start_deg), tone(start_deg + lag_deg), RATE_HZ, TONE_HZ))
    assert 0 <= lag < 2 * math.pi
    assert abs(math.remainder(lag - math.radians(lag_deg), 2 * math.pi)) < 1e-9


def test_batches_and_extremes() -> None:
    lags = np.array([0.0, 90.0, 180.0])
    waves = np.stack([tone(lag) for lag in lags])
    found = and_comparator(tone(0), waves, RATE_HZ, TONE_HZ)
    assert np.degrees(found) == pytest.approx(lags, abs=0.1)
    assert math.isnan(float(and_pulse_width_s(np.zeros(32), np.ones(32), RATE_HZ)))
    with pytest.raises(ValueError, match="equal samples"):
        and_pulse_width_s(np.zeros(3), np.zeros(4), RATE_HZ)
