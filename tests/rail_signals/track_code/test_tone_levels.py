"""Tone levels against the figures of the source, exact recovery and the Gauss-Markov bound."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.tone_levels import noise_covariance, tone_columns, tone_estimator

TONES_HZ = np.array(load_profile("tones27").tones_hz)


def coloured(frequency: np.ndarray) -> np.ndarray:
    return np.asarray((frequency**2 + 9) / (1 + (frequency / 20) ** 6) + 0.1)


def test_figure_5() -> None:
    time_s = np.arange(100) / 100
    wave = sum(np.sin(2 * np.pi * f * time_s) for f in (20, 25, 30))
    spectrum = np.abs(np.fft.fft(wave))[:50]
    np.testing.assert_allclose(spectrum[[20, 25, 30]], 50)
    assert np.delete(spectrum, [20, 25, 30]).max() < 1e-10
    # At the frequencies of whole bins least squares and transform agree: |X| = L / 2 |a|.
    estimator = tone_estimator(np.arange(1, 45), 100.0, 100)
    levels = np.abs(estimator.amplitudes(wave))
    np.testing.assert_allclose(50 * levels, spectrum[1:45], atol=1e-10)


@pytest.mark.parametrize(
    ("wave_hz", "square", "noisy", "points", "peak", "peak_hz"),
    [
        (400, False, True, 516, 4, 387.6),  # Fig. 8
        (400, False, True, 512, 4, 390.6),
        (300, False, False, 8192, 49, 299.07),  # Fig. 9
        (200, True, True, 8192, 33, 201.42),  # Fig. 10
        (400, False, True, 8192, 66, 402.83),  # Fig. 11
    ],
)
def test_figures_8_to_11(
    wave_hz: float, square: bool, noisy: bool, points: int, peak: int, peak_hz: float
) -> None:
    time_s = np.arange(points) * 20e-6
    wave = np.sin(2 * np.pi * wave_hz * time_s)
    wave = np.sign(wave) if square else wave
    if noisy:
        wave = wave + 0.3 * np.sin(2 * np.pi * 8000 * time_s)
    spectrum = np.abs(np.fft.rfft(wave))
    assert np.argmax(spectrum[1:]) + 1 == peak
    assert peak / (points * 20e-6) == pytest.approx(peak_hz, abs=0.05)


def test_equation_8() -> None:
    assert np.ceil(64 / 0.64 - 1e-9) == 100
    # The slot of that length is well conditioned, one of one second cannot even be solved.
    assert tone_estimator(TONES_HZ, 64.0, 100).condition < 1.6
    with pytest.raises(ValueError, match="samples must exceed the 55 unknowns, got 54"):
        tone_estimator(TONES_HZ, 64.0, 54)


def test_a_slot_of_the_model_is_recovered_exactly() -> None:
    rng = np.random.default_rng(1)
    gain = np.exp(rng.normal(size=27) * 0.2 + 1j * rng.normal(size=27))
    drift = np.exp(-np.arange(104) / 30)[:, None]
    estimator = tone_estimator(
        TONES_HZ, 64.0, 104, noise_spectrum=coloured, gain=gain, nuisance=drift
    )
    amplitude = rng.normal(size=(5, 27)) + 1j * rng.normal(size=(5, 27))
    waves = tone_columns(TONES_HZ, 64.0, 104) * gain
    slots = (amplitude @ waves.T).real + 3.0 + 2.0 * drift.T
    np.testing.assert_allclose(estimator.amplitudes(slots), amplitude, atol=1e-9)
    assert estimator.noise(slots).max() < 1e-9


def test_spread_is_that_of_coloured_noise_and_below_plain_least_squares() -> None:
    rng = np.random.default_rng(2)
    root = np.linalg.cholesky(noise_covariance(coloured, 64.0, 104))
    slots = rng.normal(size=(20_000, 104)) @ root.T
    best = tone_estimator(TONES_HZ, 64.0, 104, noise_spectrum=coloured)
    plain = tone_estimator(TONES_HZ, 64.0, 104)
    spread = np.sqrt(np.mean(np.abs(best.amplitudes(slots)) ** 2, axis=0) / 2)
    np.testing.assert_allclose(spread, best.spread, rtol=0.03)
    # The estimate of the spread from the residuals of each slot alone, on average.
    np.testing.assert_allclose(
        np.sqrt(np.mean(best.noise(slots) ** 2, axis=0)), best.spread, rtol=0.03
    )
    worse = np.sqrt(np.mean(np.abs(plain.amplitudes(slots)) ** 2, axis=0) / 2)
    assert np.all(spread < worse * 1.005)


def test_the_covariance_is_the_transform_of_the_spectrum() -> None:
    # Autoregressive noise: S = 1 / |1 - a e^{-jw}|^2, r[k] = a^k.
    a = 0.8
    covariance = noise_covariance(
        lambda f: 1 / (1 - 2 * a * np.cos(2 * np.pi * f / 64) + a * a), 64.0, 20
    )
    lag = np.abs(np.subtract.outer(np.arange(20), np.arange(20)))
    np.testing.assert_allclose(covariance, a**lag, atol=1e-9)


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="tones_hz must lie between 0 and"):
        tone_estimator([40.0], 64.0, 100)
    with pytest.raises(ValueError, match="gain must hold one value"):
        tone_estimator([4.0], 64.0, 100, gain=[0.0])
    with pytest.raises(ValueError, match="nuisance must have 100 rows"):
        tone_estimator([4.0], 64.0, 100, nuisance=np.zeros((3, 1)))
    with pytest.raises(ValueError, match="samples must tell the tones apart, got 100"):
        tone_estimator([4.0, 4.0000001], 64.0, 100)
    with pytest.raises(ValueError, match="noise_spectrum must return"):
        tone_estimator([4.0], 64.0, 100, noise_spectrum=lambda f: -f)
    with pytest.raises(ValueError, match="noise_spectrum must not be zero"):
        tone_estimator([4.0], 64.0, 100, noise_spectrum=np.zeros_like)
