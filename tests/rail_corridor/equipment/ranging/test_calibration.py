"""The bench: what calibration finds, and what it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from rail_corridor.equipment.ranging.calibration import RIG_SNR, calibrate
from rail_corridor.equipment.ranging.section import TransponderPlan
from rail_signals.ranging.bounds import tone_phase_variance_bound
from rail_signals.ranging.phase_range import range_per_radian_m
from rail_signals.ranging.signal import RangingSignal

SIGNAL = RangingSignal()
UNITS = [
    calibrate(TransponderPlan(calibration_bursts=20), SIGNAL, np.random.default_rng(seed))
    for seed in range(120)
]


def test_units_spread_about_their_nominal_delay() -> None:
    delays_s = np.array([unit.delay_s for unit in UNITS])
    # 120 units: the mean to 0.09 sigma, the spread to 6.5 %; four times that.
    assert np.mean(delays_s) == pytest.approx(1e-6, abs=4 * 5e-9 / np.sqrt(120))
    assert np.std(delays_s) == pytest.approx(5e-9, rel=0.26)


def test_the_trim_brings_every_unit_to_the_delay_of_the_fleet() -> None:
    for unit in UNITS:
        rest_m = (unit.delay_s + unit.trim_s - 1e-6) * 299_792_458.0 / 2.0
        assert rest_m == pytest.approx(unit.residual_m, abs=1e-9)
        assert abs(rest_m) < 5.0 * unit.sigma_m


def test_the_residual_is_what_the_noise_of_the_bench_leaves() -> None:
    bound_rad2 = tone_phase_variance_bound(RIG_SNR, SIGNAL.samples * 20, SIGNAL.indices[0])
    sigma_m = np.sqrt(float(bound_rad2)) * range_per_radian_m(SIGNAL.tones_hz[0])
    residuals_m = np.array([unit.residual_m for unit in UNITS])
    assert [unit.sigma_m for unit in UNITS] == pytest.approx(np.full(120, sigma_m), rel=0.05)
    assert np.std(residuals_m) == pytest.approx(sigma_m, rel=0.26)


def test_a_unit_without_spread_has_the_nominal_delay() -> None:
    unit = calibrate(TransponderPlan(spread_s=0.0), SIGNAL, np.random.default_rng(1))
    assert unit.delay_s == 1e-6


def test_a_delay_is_never_negative() -> None:
    plan = TransponderPlan(delay_s=0.0, spread_s=1e-6, calibration_bursts=1)
    units = [calibrate(plan, SIGNAL, np.random.default_rng(seed)) for seed in range(20)]
    assert min(unit.delay_s for unit in units) == 0.0
