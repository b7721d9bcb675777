"""Phases to ranges and back, against the numbers of Jeong et al., section 3."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.ranging.phase_range import (
    phase_to_range_m,
    range_per_radian_m,
    range_to_phase_rad,
    two_tone_range_m,
    unambiguous_range_m,
    wrong_cycle_probability,
)

TONES_HZ = (375e3, 37.5e3)


def test_section_3() -> None:
    wavelength_m = SPEED_OF_LIGHT_M_PER_S / 375e3
    assert wavelength_m == pytest.approx(800, rel=1e-3)
    assert unambiguous_range_m(375e3, "and") == pytest.approx(199.8616, abs=1e-3)
    assert unambiguous_range_m(375e3, "quadrature") == pytest.approx(399.7233, abs=1e-3)
    assert unambiguous_range_m(37.5e3) == pytest.approx(3997, abs=1)
    # 63.66 m/rad with c rounded to 3e8 m/s.
    assert range_per_radian_m(375e3) * 3e8 / SPEED_OF_LIGHT_M_PER_S == pytest.approx(
        63.66, abs=0.005
    )
    assert math.radians(1) * range_per_radian_m(375e3) == pytest.approx(1.111, abs=1e-3)


def test_equation_12_and_the_delay_it_leaves_out() -> None:
    one_way_s = 50 / SPEED_OF_LIGHT_M_PER_S
    lag = float(range_to_phase_rad(50, 375e3))
    assert lag == pytest.approx(2 * (2 * math.pi * 375e3 * one_way_s))
    delayed = float(range_to_phase_rad(50, 375e3, delay_s=1e-6))
    assert math.degrees(delayed - lag) == pytest.approx(135)
    assert float(phase_to_range_m(delayed, 375e3)) - 50 == pytest.approx(150, abs=0.2)
    assert float(phase_to_range_m(delayed, 375e3, delay_s=1e-6)) == pytest.approx(50)
    assert math.degrees(float(range_to_phase_rad(1, 375e3))) == pytest.approx(0.9, abs=1e-3)
    round_trip_s = 2 / SPEED_OF_LIGHT_M_PER_S
    assert round_trip_s == pytest.approx(6.67e-9, rel=1e-3)


@given(st.floats(-19, 379), st.floats(0, 1e-4))
def test_round_trip(range_m: float, delay_s: float) -> None:
    lag = range_to_phase_rad(range_m, 375e3, delay_s=delay_s)
    assert float(phase_to_range_m(lag, 375e3, delay_s=delay_s)) == pytest.approx(range_m, abs=1e-6)


@given(st.floats(-50, 50), st.floats(0, 300))
def test_margin_is_the_lower_end(lag: float, margin_m: float) -> None:
    range_m = float(phase_to_range_m(lag, 375e3, margin_m=margin_m))
    assert -margin_m - 1e-9 <= range_m < unambiguous_range_m(375e3) - margin_m + 1e-9


@given(st.floats(-100, 3700), st.floats(0, 1e-4), st.floats(-0.3, 0.3), st.floats(-0.2, 0.2))
def test_two_tones_reach_past_two_kilometres(
    range_m: float, delay_s: float, high_error: float, low_error: float
) -> None:
    lag = [float(range_to_phase_rad(range_m, f, delay_s=delay_s)) for f in TONES_HZ]
    lag[0] += high_error
    lag[1] += low_error
    found, _, resolved = two_tone_range_m(lag, [1e-4, 1e-4], TONES_HZ, delay_s=delay_s)
    assert float(found) == pytest.approx(
        range_m + high_error * range_per_radian_m(TONES_HZ[0]), abs=1e-6
    )
    assert bool(resolved)


@pytest.mark.parametrize("variance", [0.006, 0.01, 0.02])
def test_wrong_cycle_probability(variance: float) -> None:
    rng = np.random.default_rng(5)
    trials, range_m = 100_000, 1234.0
    lag = np.array([float(range_to_phase_rad(range_m, f)) for f in TONES_HZ])
    noisy = lag + rng.normal(0, math.sqrt(variance), (trials, 2))
    found, variance_m2, resolved = two_tone_range_m(noisy, np.full((trials, 2), variance), TONES_HZ)
    wrong = abs(found - range_m) > unambiguous_range_m(TONES_HZ[0]) / 2
    predicted = float(wrong_cycle_probability([variance, variance], TONES_HZ))
    spread = math.sqrt(trials * predicted * (1 - predicted))
    assert wrong.sum() == pytest.approx(trials * predicted, abs=4 * spread)
    assert not resolved.any()
    right = found[~wrong] - range_m
    assert right.var() == pytest.approx(float(variance_m2[0]), rel=0.03)


def test_unusable_input_is_not_resolved() -> None:
    _, _, resolved = two_tone_range_m(
        [[math.nan, 1.0], [1.0, 1.0], [1.0, 1.0]],
        [[1e-4, 1e-4], [math.inf, math.inf], [math.nan, 1e-4]],
        TONES_HZ,
    )
    assert not resolved.any()
    with pytest.raises(ValueError, match="highest first"):
        two_tone_range_m([1.0, 1.0], [1e-4, 1e-4], (37.5e3, 375e3))
    with pytest.raises(ValueError, match="variance_rad2 must have two tones last"):
        two_tone_range_m([1.0, 1.0], [1e-4], TONES_HZ)
    with pytest.raises(ValueError, match="comparator must be"):
        unambiguous_range_m(375e3, "or")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="tone_hz must be finite"):
        unambiguous_range_m(math.nan)
