"""A word followed through noise in which no single slot is found from scratch."""

import numpy as np
import pytest

from rail_signals.track_code.ml import MaximumLikelihoodTones
from rail_signals.track_code.ml_tracker import TrackedTones
from rail_signals.track_code.profile import load_profile

RATE_HZ = 640.0
SLOT = 1040
HOP = 80
PROFILE = load_profile("tones27")
TONES_HZ = np.array(PROFILE.tones_hz)
DEVIATIONS_HZ = np.array(PROFILE.deviations_hz)
FIT = MaximumLikelihoodTones(TONES_HZ, SLOT, RATE_HZ, deviations_hz=DEVIATIONS_HZ)


def wave(bits: np.ndarray, samples: int, start_s: float) -> np.ndarray:
    """Baseband [1, samples] of a word, by eq. 3 of Kim et al."""
    t = start_s + np.arange(samples) / RATE_HZ
    index = bits * DEVIATIONS_HZ / TONES_HZ
    return np.exp(-1j * (index @ np.cos(2 * np.pi * np.outer(TONES_HZ, t))))[None, :]


def follow(tracker: TrackedTones, z: np.ndarray) -> list[np.ndarray]:
    starts = range(0, z.shape[1] - SLOT + 1, HOP)
    return [np.abs(tracker.next(z[:, k : k + SLOT]).amplitudes_hz[0]) for k in starts]


def test_a_word_is_found_in_time_and_then_held() -> None:
    rng = np.random.default_rng(5)
    bits = rng.integers(0, 2, TONES_HZ.size)
    z = wave(bits, SLOT + 40 * HOP, 3.21)
    snr = 10 ** (23.0 / 10) / RATE_HZ
    scale = np.sqrt(0.5 / snr)
    z = z + rng.normal(scale=scale, size=z.shape) + 1j * rng.normal(scale=scale, size=z.shape)
    levels = follow(TrackedTones(FIT, HOP), z)
    right = [bool(((level > DEVIATIONS_HZ / 2) == bits).all()) for level in levels]
    assert all(right[-12:])


def test_the_same_as_each_slot_alone_where_that_is_found() -> None:
    bits = np.arange(TONES_HZ.size) % 2
    z = wave(bits, SLOT + 3 * HOP, 1.0)
    for level in follow(TrackedTones(FIT, HOP), z):
        assert level == pytest.approx(bits * DEVIATIONS_HZ, abs=1e-6)


def test_a_change_of_word_is_followed() -> None:
    first, second = np.arange(27) % 2, np.arange(27) % 3 == 0
    tracker = TrackedTones(FIT, SLOT)  # no slot holds parts of both
    tracker.next(wave(first, SLOT, 0.0))
    last = np.abs(tracker.next(wave(second, SLOT, 7.0)).amplitudes_hz[0])
    assert last == pytest.approx(second * DEVIATIONS_HZ, abs=1e-6)


def test_streams_stay_the_same_in_number() -> None:
    tracker = TrackedTones(FIT, HOP)
    z = wave(np.ones(27), SLOT, 0.0)
    tracker.next(z)
    with pytest.raises(ValueError, match="streams"):
        tracker.next(np.concatenate([z, z]))
    tracker.reset()
    tracker.next(np.concatenate([z, z]))


def test_what_it_is_made_of_is_checked() -> None:
    with pytest.raises(ValueError, match="nominal deviations"):
        TrackedTones(MaximumLikelihoodTones([3.0], 100, 50.0), 1)
    with pytest.raises(ValueError, match="hop_samples must be at least 1, got 0"):
        TrackedTones(FIT, 0)
