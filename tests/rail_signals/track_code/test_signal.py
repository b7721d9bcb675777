"""The track-code transmitter against equations 1-3 and Bessel's lines."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.special import jv

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.signal import FmTransmitter

TONES27 = load_profile("tones27")


def test_equation_3_is_the_integral_of_equation_1() -> None:
    # Trapezoidal sum of s(t) at 48 kHz: error of order (F / fs)^2.
    rate = 48_000.0
    bits = np.random.default_rng(1).random(27) < 0.5
    time_s = np.arange(48_000) / rate
    tones, deviations = np.array(TONES27.tones_hz), np.array(TONES27.deviations_hz)
    modulating = np.sin(2 * np.pi * time_s[:, None] * tones) @ (2 * np.pi * bits * deviations)
    steps = (modulating[1:] + modulating[:-1]) / 2 / rate
    phase = 2 * np.pi * 1700 * time_s + np.concatenate([[0], np.cumsum(steps)])
    wave = FmTransmitter(TONES27, 1700.0, rate).block(bits, time_s.size)
    np.testing.assert_allclose(wave, np.sin(phase), atol=1e-5)


def test_one_tone_has_the_lines_of_bessel() -> None:
    profile = load_profile("three_tones")
    transmitter = FmTransmitter(profile, 2000.0, 8000.0)
    wave = transmitter.block([False, True, False], 8000)
    lines = np.abs(np.fft.rfft(wave)) / 4000
    for order in range(-3, 4):
        assert lines[2000 + 25 * order] == pytest.approx(abs(jv(order, 20 / 25)), abs=1e-4)


@pytest.mark.parametrize("size", [1, 37, 999])
def test_blocks_do_not_show(size: int) -> None:
    bits = [np.arange(27) % 3 == 0, np.arange(27) % 2 == 0]
    whole, cut = (FmTransmitter(TONES27, 2600.0, 6400.0) for _ in range(2))
    for word in bits:
        expected = whole.block(word, 1998)
        pieces = [cut.block(word, min(size, 1998 - at)) for at in range(0, 1998, size)]
        np.testing.assert_allclose(np.concatenate(pieces), expected, rtol=0, atol=1e-12)


def test_a_change_of_word_does_not_jump() -> None:
    rate = 48_000.0
    rng = np.random.default_rng(3)
    transmitter = FmTransmitter(TONES27, 1700.0, rate)
    wave = np.concatenate([transmitter.block(rng.random(27) < 0.5, 4801) for _ in range(20)])
    # |v''| <= (2 pi f)^2: a jump of phase by x would show as a second difference of about x.
    most = (2 * math.pi * (1700 + 150) / rate) ** 2 * 1.01
    assert np.abs(np.diff(wave, 2)).max() < most


def test_nothing_drifts_over_a_day() -> None:
    # Every frequency has whole cycles in 100 s, so a day of whole hundreds changes nothing.
    transmitter = FmTransmitter(TONES27, 2600.0, 16_000.0)
    bits = np.arange(27) % 2 == 0
    first = transmitter.block(bits, 1000)
    transmitter._samples = 16_000 * 86_400
    np.testing.assert_allclose(transmitter.block(bits, 1000), first, atol=1e-6)
    transmitter.reset()
    np.testing.assert_array_equal(transmitter.block(bits, 1000), first)


def test_what_is_refused() -> None:
    transmitter = FmTransmitter(TONES27, 1700.0, 16_000.0)
    with pytest.raises(ValueError, match=r"bits must be 27 truth values, got bool of shape \(3,\)"):
        transmitter.block([True] * 3, 10)
    with pytest.raises(ValueError, match="bits must be 27 truth values, got int"):
        transmitter.block([1] * 27, 10)
    with pytest.raises(ValueError, match="samples must be a non-negative integer, got -1"):
        transmitter.block([True] * 27, -1)
    with pytest.raises(ValueError, match="carrier_hz must be above"):
        FmTransmitter(TONES27, 100.0, 16_000.0)
    with pytest.raises(ValueError, match="sample_rate_hz must be above twice"):
        FmTransmitter(TONES27, 1700.0, 3400.0)
    with pytest.raises(ValueError, match="tone_phases_rad must hold 27"):
        FmTransmitter(TONES27, 1700.0, 16_000.0, [0.0])
    assert transmitter.block([True] * 27, 0).size == 0


def test_initial_phases_of_equation_1() -> None:
    profile = dataclasses.replace(load_profile("three_tones"), name="shifted")
    quarter = FmTransmitter(profile, 2000.0, 8000.0, [math.pi / 2] * 3)
    wave = quarter.block([True, False, False], 400)
    time_s = np.arange(400) / 8000
    expected = np.sin(2 * np.pi * 2000 * time_s + np.sin(2 * np.pi * 20 * time_s))
    np.testing.assert_allclose(wave, expected, atol=1e-9)
