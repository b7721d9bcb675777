"""Selection of the spectral components, and the detector's threshold."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import beta as beta_law

from rail_signals.ranging.detector import detection_threshold, false_alarm_probability
from rail_signals.ranging.fm_spectrum import LOST_INFORMATION, fm_spectrum
from rail_signals.ranging.signal import RangingSignal, modulate


@settings(max_examples=25)
@given(st.floats(0.05, 1.2), st.floats(0.05, 0.9))
def test_lines_are_the_transform_of_the_wave(high: float, low: float) -> None:
    signal = RangingSignal(
        tones_hz=(375e3, 37.5e3), deviations_hz=(375e3 * high, 37.5e3 * low), samples=320
    )
    lines = fm_spectrum(signal)
    lag = np.array([0.3, 2.0])
    spectrum = np.fft.fft(modulate(signal, lag)) / signal.samples
    expected = lines.amplitudes * np.exp(-1j * (lines.orders @ lag))
    np.testing.assert_allclose(spectrum[lines.bins], expected, atol=4e-4)
    enough = (1 - LOST_INFORMATION) * np.array(signal.indices) ** 2 / 2
    assert (lines.information >= enough * (1 - 1e-6)).all()
    # The normal matrix of the fit is diagonal because the lines mirror each other.
    power = lines.amplitudes**2
    assert np.abs(lines.orders.T @ power).max() < 1e-12
    assert abs((lines.orders[:, 0] * lines.orders[:, 1]) @ power) < 1e-12


def test_lines_that_fall_onto_each_other_are_refused() -> None:
    with pytest.raises(ValueError, match="spectral components onto each other"):
        fm_spectrum(RangingSignal(tones_hz=(200e3, 100e3), deviations_hz=(200e3, 100e3)))


def test_strongest_lines_carry_the_share() -> None:
    lines = fm_spectrum(RangingSignal())
    strong = lines.strongest(0.92)
    assert strong.orders.ravel().tolist() == [-1, 0, 1]
    assert strong.power >= 0.92 * lines.power


@pytest.mark.parametrize("false_alarm", [1e-2, 1e-6, 1e-12])
def test_threshold_without_a_search_is_the_beta_quantile(false_alarm: float) -> None:
    share = detection_threshold(false_alarm, 3, 960, 0.0, 240e-6)
    assert share == pytest.approx(beta_law.isf(false_alarm, 3, 957), rel=1e-6)


def test_search_raises_the_threshold() -> None:
    quiet = detection_threshold(1e-6, 3, 960, 0.0, 240e-6)
    searched = detection_threshold(1e-6, 3, 960, 1e4, 240e-6)
    assert quiet < searched < 1.5 * quiet
    assert false_alarm_probability(searched, 3, 960, 1e4, 240e-6) == pytest.approx(1e-6)


@pytest.mark.parametrize("false_alarm", [0.0, 0.5, math.nan])
def test_false_alarm_out_of_range(false_alarm: float) -> None:
    with pytest.raises(ValueError, match="false_alarm must lie between"):
        detection_threshold(false_alarm, 3, 960, 0.0, 240e-6)
