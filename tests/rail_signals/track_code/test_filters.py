"""Filters of the track-code receiver against equation 10 and their own specification."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from rail_signals.track_code.demodulator import PASS_HZ, STOP_HZ, DemodulatorChain
from rail_signals.track_code.filters import (
    DC_PRINTED_DENOMINATOR,
    SectionFilter,
    carrier_band_pass,
    compressor_filter,
    dc_rejecter,
    post_demodulation_filter,
    response,
)
from rail_signals.track_code.profile import load_profile


def decibels(sections: np.ndarray, frequency_hz: object, rate_hz: float) -> np.ndarray:
    return 20 * np.log10(np.abs(response(sections, frequency_hz, rate_hz)))


def test_equation_10() -> None:
    section = dc_rejecter()[0]
    np.testing.assert_allclose(section[3:], DC_PRINTED_DENOMINATOR, rtol=0, atol=1e-12)
    np.testing.assert_allclose(section[:3], np.array([1, -2, 1]) * 0.97842, atol=1e-5)
    # As printed, its pass band has a gain of 1.0221: 4 over the denominator at half the rate.
    printed_gain = 4 / sum(np.abs(DC_PRINTED_DENOMINATOR))
    assert printed_gain == pytest.approx(1.0221, abs=5e-5)
    assert decibels(dc_rejecter(), 63.999, 128.0)[0] == pytest.approx(0, abs=1e-6)
    # The Butterworth design of that cut-off has these coefficients to four decimals.
    design = signal.butter(2, 2 * 0.00491, "highpass")[1]
    np.testing.assert_array_equal(design.round(4), DC_PRINTED_DENOMINATOR)


def test_the_dc_rejecter_at_the_lowest_tones() -> None:
    np.testing.assert_allclose(
        decibels(dc_rejecter(), [0.88, 1.52], 128.0), [-1.06, -0.17], atol=0.005
    )


def test_a_step_settles() -> None:
    step = SectionFilter(dc_rejecter()).filter(np.ones(1280))
    settled = np.flatnonzero(np.abs(step) > 0.01)[-1] + 1
    assert settled / 128 == pytest.approx(1.34, abs=0.005)


@pytest.mark.parametrize("rate_hz", [64.0, 640.0, 16_000.0])
def test_the_dc_rejecter_at_another_rate(rate_hz: float) -> None:
    frequency = np.array([0.3, 0.63, 0.88, 1.52, 5.0])
    np.testing.assert_allclose(
        decibels(dc_rejecter(rate_hz), frequency, rate_hz),
        decibels(dc_rejecter(), frequency, 128.0),
        atol=0.05,
    )
    with pytest.raises(ValueError, match="rate_hz must be finite and 4 Hz or more, got nan"):
        dc_rejecter(math.nan)


@pytest.mark.parametrize("top_hz", [17.52, 29.0, 30.0])
def test_the_compressor_keeps_tones_and_stops_what_folds_onto_them(top_hz: float) -> None:
    sections = compressor_filter(top_hz)
    assert np.abs(decibels(sections, np.linspace(0, top_hz, 500), 128.0)).max() < 0.11
    assert decibels(sections, np.linspace(64 - top_hz, 64, 500), 128.0).max() < -59.9


@pytest.mark.parametrize("rate_hz", [640.0, 1024.0, 5888.0])
def test_the_post_demodulation_filter(rate_hz: float) -> None:
    sections = post_demodulation_filter(rate_hz)
    assert np.abs(decibels(sections, np.linspace(0, 32, 100), rate_hz)).max() < 0.11
    assert decibels(sections, np.linspace(96, rate_hz / 2, 500), rate_hz).max() < -59.9


@pytest.mark.parametrize("rate_hz", [6400.0, 16_000.0, 48_000.0])
@pytest.mark.parametrize("carrier_hz", [1700.0, 2600.0])
def test_the_band_pass(carrier_hz: float, rate_hz: float) -> None:
    sections = carrier_band_pass(carrier_hz, PASS_HZ, STOP_HZ, rate_hz)
    inside = carrier_hz + np.linspace(-PASS_HZ, PASS_HZ, 200)
    assert np.abs(decibels(sections, inside, rate_hz)).max() < 0.11
    outside = np.linspace(1, rate_hz / 2 - 1, 5000)
    outside = outside[np.abs(outside - carrier_hz) > STOP_HZ]
    assert decibels(sections, outside, rate_hz).max() < -59.9


@pytest.mark.parametrize("rate_hz", [6400.0, 7936.0, 16_000.0, 48_000.0])
def test_the_quadrature_filter_stops_the_image(rate_hz: float) -> None:
    chain = DemodulatorChain(load_profile("tones27"), 2600.0, rate_hz)
    time_s = np.arange(chain.analytic_taps.size) / rate_hz
    for offset in (-150.0, 0.0, 150.0):
        frequency = 2600.0 + offset
        kept = chain.analytic_taps @ np.exp(-2j * np.pi * frequency * time_s)
        image = chain.analytic_taps @ np.exp(2j * np.pi * frequency * time_s)
        assert abs(kept) == pytest.approx(2, abs=0.01)
        assert abs(image) < 1e-3


def test_blocks_do_not_show() -> None:
    x = np.random.default_rng(1).normal(size=300)
    stage = SectionFilter(compressor_filter(17.52))
    pieces = [stage.filter(x[at : at + 7]) for at in range(0, 300, 7)]
    whole = SectionFilter(compressor_filter(17.52)).filter(x)
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
