"""The line receiver stays at the Cramer-Rao bound where a discriminator has its threshold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.ranging.bounds import (
    complex_tone_frequency_variance_bound,
    tone_phase_variance_bound,
)
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, discriminate, modulate, tone_of

SIGNAL = RangingSignal(samples=3968)
OFFSETS_HZ = (0.0, 3130.0, -4987.0)
TRIALS = 1500
BATCH = 100


def noise(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Complex white noise of unit power."""
    return rng.normal(scale=math.sqrt(0.5), size=(*shape, 2)).view(np.complex128)[..., 0]


def rms_turn(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.angle(np.exp(1j * error)) ** 2)))


def test_error_is_the_bound_from_minus_10_to_40_db() -> None:
    rng = np.random.default_rng(20)
    receiver = FmToneReceiver(SIGNAL)
    t = np.arange(SIGNAL.samples) / SIGNAL.sample_rate_hz
    errors: dict[tuple[float, float], list[np.ndarray]] = {}
    for _ in range(TRIALS // BATCH):
        lag = rng.uniform(0, 2 * math.pi, (BATCH, 1))
        wave = modulate(SIGNAL, lag)
        disturbance = noise(rng, wave.shape)
        for offset_hz in OFFSETS_HZ:
            carrier = np.exp(2j * math.pi * (offset_hz * t + rng.uniform()))
            for db in (-10.0, 0.0, 40.0) if offset_hz else (-10.0, 0.0, 10.0, 20.0, 40.0):
                found = receiver.estimate(wave * carrier + disturbance * 10 ** (-db / 20))
                assert found.detected.all()
                key = (offset_hz, db)
                errors.setdefault(key, []).append(
                    np.stack(
                        [
                            found.phase_lag_rad[:, 0] - lag[:, 0],
                            found.frequency_offset_hz - offset_hz,
                            found.variance_rad2[:, 0],
                            found.reduced_chi_square,
                        ]
                    )
                )
    for (offset_hz, db), parts in errors.items():
        phase, frequency, variance, misfit = np.concatenate(parts, axis=1)
        snr = 10 ** (db / 10)
        bound = float(tone_phase_variance_bound(snr, SIGNAL.samples, 1.0))
        ratio = rms_turn(phase) / math.sqrt(bound)
        assert 0.95 <= ratio <= 1.05, f"{offset_hz} Hz, {db} dB: {ratio:.3f}"
        assert variance.mean() == pytest.approx(bound, rel=0.03)
        assert misfit.mean() == pytest.approx(1.0, abs=0.05)
        limit = complex_tone_frequency_variance_bound(snr, SIGNAL.samples, 4e6)
        assert np.sqrt(np.mean(frequency**2) / limit) < 1.25


@pytest.mark.parametrize(
    ("db", "low", "high"), [(10.0, 0.97, 1.10), (0.0, 2.3, 3.3), (-10.0, 9.0, 13.0)]
)
def test_discriminator_shows_its_threshold(db: float, low: float, high: float) -> None:
    rng = np.random.default_rng(21)
    lag = rng.uniform(0, 2 * math.pi, (600, 1))
    wave = modulate(SIGNAL, lag)
    wave += noise(rng, wave.shape) * 10 ** (-db / 20)
    error = tone_of(SIGNAL, discriminate(SIGNAL, wave)) - lag[:, 0]
    bound = tone_phase_variance_bound(10 ** (db / 10), SIGNAL.samples, 1.0)
    assert low < rms_turn(error) / math.sqrt(float(bound)) < high


def test_two_tones_reach_both_bounds() -> None:
    rng = np.random.default_rng(22)
    signal = RangingSignal(tones_hz=(375e3, 37.5e3), deviations_hz=(300e3, 37.5e3))
    receiver = FmToneReceiver(signal)
    lag = rng.uniform(0, 2 * math.pi, (3000, 2))
    wave = modulate(signal, lag)
    wave *= np.exp(2j * math.pi * 2222.0 / 4e6 * np.arange(signal.samples))
    for db in (-8.0, 30.0):
        found = receiver.estimate(wave + noise(rng, wave.shape) * 10 ** (-db / 20))
        assert found.detected.mean() > 0.999
        for tone in range(2):
            error = (found.phase_lag_rad - lag)[found.detected, tone]
            bound = tone_phase_variance_bound(10 ** (db / 10), 960, signal.indices[tone])
            assert 0.95 <= rms_turn(error) / math.sqrt(float(bound)) <= 1.05


def test_sums_of_periods_lose_nothing() -> None:
    """Up to a cycle of offset in a burst, a few weighted sums stand for all its periods."""
    rng = np.random.default_rng(23)
    receiver = FmToneReceiver(SIGNAL, max_offset_hz=1e3)
    lag = rng.uniform(0, 2 * math.pi, (1000, 1))
    offset_hz = rng.uniform(-1e3, 1e3, 1000)
    offset_hz[:2] = -1e3, 1e3
    t = np.arange(SIGNAL.samples) / SIGNAL.sample_rate_hz
    wave = modulate(SIGNAL, lag) * np.exp(2j * math.pi * offset_hz[:, None] * t)
    clean = receiver.estimate(wave)
    assert rms_turn(clean.phase_lag_rad - lag) < 1e-5
    np.testing.assert_allclose(clean.frequency_offset_hz, offset_hz, atol=0.05)
    assert (clean.snr > 1e8).all()
    found = receiver.estimate(wave + noise(rng, wave.shape) * 10**0.5)
    bound = float(tone_phase_variance_bound(0.1, SIGNAL.samples, 1.0))
    assert 0.95 <= rms_turn(found.phase_lag_rad - lag) / math.sqrt(bound) <= 1.05
    assert found.snr.mean() == pytest.approx(0.1, rel=0.03)
