"""Waves deviate as their tones say, and noise has the density that is asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.study.baseband import (
    RATE_HZ,
    draw_noise,
    draw_waves,
    slot_samples,
    snr_of,
    with_deviations_scaled,
)

PROFILE = load_profile("tones27")


@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_the_frequency_is_the_sum_of_the_tones_that_are_sent(scale: float) -> None:
    profile = with_deviations_scaled(PROFILE, scale)
    bits = np.stack([np.arange(27) % 2 == 0, np.arange(27) < 3, np.zeros(27, dtype=np.bool_)])
    wave, phases_rad = draw_waves(profile, bits, 1000, np.random.default_rng(1))
    assert np.abs(wave) == pytest.approx(np.ones(wave.shape), abs=1e-5)
    step = wave[:, 1:] * wave[:, :-1].conj()
    frequency_hz = np.angle(step) * RATE_HZ / (2 * math.pi)
    between_s = (np.arange(999) + 0.5) / RATE_HZ
    turn = 2 * math.pi * np.outer(PROFILE.tones_hz, between_s) + phases_rad[..., None]
    deviations_hz = scale * np.array(PROFILE.deviations_hz)
    expected_hz = (bits[:, None, :] * deviations_hz @ np.sin(turn))[:, 0]
    # A step is the mean over a sample, 0.1 % less than the middle for the fastest tone.
    assert frequency_hz == pytest.approx(expected_hz, abs=0.002 * scale * 148.5 + 0.001)


def test_tones_begin_at_one_time_that_is_drawn() -> None:
    _, phases_rad = draw_waves(PROFILE, np.ones((3, 27), np.bool_), 1, np.random.default_rng(2))
    start_s = phases_rad / (2 * math.pi * np.array(PROFILE.tones_hz))
    assert start_s == pytest.approx(np.repeat(start_s[:, :1], 27, axis=1))
    assert len(set(start_s[:, 0].round(6))) == 3


@pytest.mark.parametrize("density_db_hz", [20.0, 34.0])
def test_noise_has_the_density_asked_for(density_db_hz: float) -> None:
    noise = draw_noise((20, 10_000), snr_of(density_db_hz), np.random.default_rng(3))
    # Of unit carrier; 200 000 samples scatter by 0.2 %.
    density = float(np.mean(np.abs(noise) ** 2)) / RATE_HZ
    assert -10 * math.log10(density) == pytest.approx(density_db_hz, abs=0.05)
    assert float(np.mean(noise.real**2)) * 2 == pytest.approx(density * RATE_HZ, rel=0.02)
    assert abs(np.mean(noise[:, 1:] * noise[:, :-1].conj())) < 0.01 * density * RATE_HZ


def test_a_slot_is_as_long_as_that_of_the_profile() -> None:
    assert slot_samples(PROFILE) / RATE_HZ == PROFILE.slot_s
