"""The receiver of reference tones against the bound, and against what is no tone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from rail_signals.doppler.receiver import ToneReceiver
from rail_signals.doppler.signal import block_times_s, received_tones
from rail_signals.doppler.tone_plan import TonePlan
from rail_signals.ranging.bounds import complex_tone_frequency_variance_bound

PLAN = TonePlan()
RECEIVER = ToneReceiver(PLAN)


def noise(rng: np.random.Generator) -> np.ndarray:
    """Complex noise of mean power 1 [samples]."""
    parts = rng.normal(scale=np.sqrt(0.5), size=(PLAN.samples, 2))
    return np.asarray(parts.view(np.complex128)[:, 0])


@pytest.mark.parametrize("snr_db", [-8.0, 0.0, 20.0, 40.0])
@pytest.mark.parametrize("speed_mps", [0.0, 139.0])
def test_shifts_are_at_the_cramer_rao_bound(snr_db: float, speed_mps: float) -> None:
    rng, draws = np.random.default_rng(2), 60
    amplitude = 10.0 ** (snr_db / 20.0)
    errors = []
    for _ in range(draws):
        offset_hz = rng.uniform(-1300.0, 1300.0)
        distance = np.stack(
            [800.0 - speed_mps * block_times_s(PLAN), 300.0 + 0 * block_times_s(PLAN)]
        )
        phase = rng.uniform(0.0, 6.28, (2, 1))
        block = received_tones(
            PLAN, [3, 6], distance, amplitude, offset_hz=offset_hz, phase_rad=phase
        )
        found = RECEIVER.estimate(block + noise(rng))
        assert found.slots.tolist() == [3, 6]
        shift = np.array([PLAN.tone_hz(3) / 299792458.0 * speed_mps, 0.0])
        scale = np.array([PLAN.tone_hz(slot) for slot in (3, 6)]) / PLAN.carrier_hz
        errors.append(found.shift_hz - shift - scale * offset_hz)
    bound = complex_tone_frequency_variance_bound(amplitude**2, PLAN.samples, PLAN.sample_rate_hz)
    ratio = float(np.mean(np.square(errors)) / bound)
    low, high = chi2.ppf([1e-4, 1.0 - 1e-4], 2 * draws) / (2 * draws)
    assert low / 1.1 < ratio < 1.1 * high


def test_noise_alone_is_no_tone_and_a_strong_one_hides_none_of_its_neighbours() -> None:
    rng = np.random.default_rng(3)
    assert all(len(RECEIVER.estimate(noise(rng))) == 0 for _ in range(200))
    t = block_times_s(PLAN)
    distance = np.stack([100.0 - 80.0 * t, 900.0 + 80.0 * t])
    block = received_tones(PLAN, [4, 5], distance, np.array([[30.0], [1.0]]))
    found = RECEIVER.estimate(block + 0.3 * noise(rng))
    assert found.slots.tolist() == [4, 5]
    doppler_hz = PLAN.carrier_hz / 299792458.0 * 80.0
    np.testing.assert_allclose(found.shift_hz, [doppler_hz, -doppler_hz], atol=0.5)


def test_what_is_not_a_block_is_refused_or_silent() -> None:
    t = block_times_s(PLAN)
    block = received_tones(PLAN, [4], [100.0 - 80.0 * t], 10.0)
    for wrong in (np.nan * block, np.zeros(PLAN.samples), np.clip(block.real, -2, 2) + 0j):
        assert len(RECEIVER.estimate(wrong)) == 0
    with pytest.raises(ValueError, match="must have 2048 samples"):
        RECEIVER.estimate(block[:-1])
