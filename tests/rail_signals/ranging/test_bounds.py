"""Bounds against a numerical Fisher information and against hand-worked values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.ranging.bounds import (
    complex_tone_frequency_variance_bound,
    real_tone_phase_variance_bound,
    tone_phase_variance_bound,
    two_way_range_variance_bound,
)
from rail_signals.ranging.signal import RangingSignal, modulate


@pytest.mark.parametrize("deviation_hz", [150e3, 375e3])
def test_phase_bound_is_the_inverse_fisher_information(deviation_hz: float) -> None:
    signal = RangingSignal(deviations_hz=(deviation_hz,))
    snr, step, lag = 3.0, 1e-5, 0.7
    wave = modulate(signal, [lag])
    by_lag = (modulate(signal, [lag + step]) - modulate(signal, [lag - step])) / (2 * step)
    t = np.arange(signal.samples) / signal.sample_rate_hz
    # Unknown besides the lag: amplitude, carrier phase, carrier offset.
    middle = t - t.mean()
    jacobian = np.stack([by_lag, wave, 1j * wave, 2j * math.pi * middle * wave])
    fisher = 2 * snr * (jacobian.conj() @ jacobian.T).real
    bound = np.linalg.inv(fisher)
    index = signal.indices[0]
    expected = float(tone_phase_variance_bound(snr, signal.samples, index))
    assert bound[0, 0] == pytest.approx(expected, rel=1e-3)
    frequency = complex_tone_frequency_variance_bound(snr, signal.samples, 4e6)
    assert bound[3, 3] == pytest.approx(float(frequency), rel=1e-3)


def test_range_bound_adds_both_links() -> None:
    per_radian_m = SPEED_OF_LIGHT_M_PER_S / (4 * math.pi * 375e3)
    assert per_radian_m == pytest.approx(63.62, abs=0.01)
    bound = float(two_way_range_variance_bound(10.0, 40.0, 1000, 1.0, 375e3))
    assert bound == pytest.approx(per_radian_m**2 * (1e-4 + 0.25e-4))


def test_real_tone_bound_is_the_inverse_fisher_information() -> None:
    samples, amplitude, sigma = 960, 1.3, 0.4
    turn = 2 * math.pi * 3 / 32 * np.arange(samples)
    by_phase = amplitude * np.cos(turn)
    snr = amplitude**2 / (2 * sigma**2)
    fisher = (by_phase**2).sum() / sigma**2
    assert float(real_tone_phase_variance_bound(snr, samples)) == pytest.approx(1 / fisher)
