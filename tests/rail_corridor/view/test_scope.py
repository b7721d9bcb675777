"""The scope: levels of tones against their closed forms, and what is drawn of long blocks."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.special import jv

from rail_corridor.view.scope import BINS, POINTS, over_time, plane, scope, spectrum
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.ranging.signal import RangingSignal, modulate

RATE_HZ = 4e6


def tone(power_mw: float, hz: float, count: int = 960) -> np.ndarray:
    return math.sqrt(power_mw) * np.exp(2j * np.pi * hz * np.arange(count) / RATE_HZ)


def at(found: dict[str, object], hz: float) -> float:
    """Highest level within a bin and a half of a frequency."""
    levels = np.array(found["db"])
    places = found["from_hz"] + found["step_hz"] * np.arange(levels.size)
    return float(levels[np.abs(places - hz) <= 1.5 * found["step_hz"]].max())


@pytest.mark.parametrize("hz", [0.0, 375e3, -1.25e6])
def test_a_tone_peaks_at_its_power(hz: float) -> None:
    found = spectrum(tone(1e-3, hz), RATE_HZ, real=False)
    assert at(found, hz) == pytest.approx(-30.0, abs=0.05)
    assert max(found["db"]) == pytest.approx(-30.0, abs=0.05)
    assert found["resolution_hz"] == pytest.approx(RATE_HZ / 960)


def test_a_real_sine_peaks_at_half_its_amplitude_squared() -> None:
    count = np.arange(4000)
    wave = 0.2 * np.cos(2 * np.pi * 1700.0 * count / 16e3) + 0j
    found = spectrum(wave, 16e3, real=True)
    assert found["from_hz"] >= 0.0
    assert at(found, 1700.0) == pytest.approx(10 * math.log10(0.5 * 0.2**2), abs=0.05)


def test_the_lines_of_an_fm_tone_are_bessel_functions() -> None:
    signal = RangingSignal()
    wave = modulate(signal, np.zeros(len(signal.tones_hz)))
    found = spectrum(wave, signal.sample_rate_hz, real=False)
    (index,) = signal.indices
    for order in range(4):
        level_db = 20 * math.log10(abs(jv(order, index)))
        assert at(found, order * signal.tones_hz[0]) == pytest.approx(level_db, abs=0.1)


def test_a_long_block_is_drawn_by_its_range_and_loses_no_peak() -> None:
    samples = np.zeros(40_000, dtype=complex)
    samples[12_345] = 3.0 - 4.0j
    drawn = over_time(samples, 1e6, 1, real=False)
    assert len(drawn["i_low"]) <= POINTS
    assert (max(drawn["i_high"]), min(drawn["q_low"])) == (3.0, -4.0)
    assert max(drawn["i_high"]) == drawn["i_high"][int(12_345e-6 / drawn["step_s"])]
    assert len(spectrum(samples, 1e6, real=False)["db"]) <= BINS


def test_a_part_begins_where_the_signal_does() -> None:
    samples = np.zeros(1600, dtype=complex)
    samples[800:] = 1.0
    drawn = over_time(samples, 1e3, 16, real=True)
    assert drawn["from_s"] == pytest.approx(0.8)
    assert drawn["i"] == [1.0] * 100
    assert "q" not in drawn


def test_the_plane_is_scaled_to_its_largest_sample() -> None:
    drawn = plane(np.array([0.0, 2.0, 2j, -1.0]))
    assert drawn["scale"] == 2.0
    assert list(zip(drawn["i"], drawn["q"], strict=True)) == [(1.0, 0.0), (0.0, 1.0), (-0.5, 0.0)]


def test_silence_is_said_and_not_drawn() -> None:
    shown = scope(silence(0, RATE_HZ, 2.4e9, 1))
    assert shown["silent"]
    assert "time" not in shown
    # As is a block of samples that are all zero.
    assert scope(Waveform(0, RATE_HZ, 2.4e9, 1, np.zeros((1, 8), complex)))["silent"]


def test_an_antenna_that_is_not_there_is_the_last_one() -> None:
    block = Waveform(250_000_000, RATE_HZ, 2.4e9, 3, np.stack([tone(1.0, 0.0), tone(4.0, 0.0)]))
    shown = scope(block, antenna=7)
    assert (shown["antenna"], shown["antennas"], shown["stamp_s"]) == (1, 2, 0.25)
    assert max(shown["spectrum"]["db"]) == pytest.approx(6.0, abs=0.1)
