"""Fractional delay against the closed form of a delayed wave."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.delay import fractional_delay, repetition
from rail_signals.ranging.signal import RangingSignal, modulate


@pytest.mark.parametrize("samples", [960, 3968])
def test_delayed_fm_wave(samples: int) -> None:
    signal = RangingSignal(samples=samples)
    delay_s = np.array([0.0, 1e-9, 333.3e-9, 1.7e-6, 5e-3])
    lag = 0.4 + 2 * math.pi * 375e3 * delay_s
    delayed = fractional_delay(modulate(signal, [0.4]), delay_s, 4e6)
    assert delayed.shape == (5, samples)
    # What aliases (1e-9 of the power) is not delayed as its own frequency would be.
    np.testing.assert_allclose(delayed, modulate(signal, lag[:, None]), atol=1e-4)


@given(st.integers(1, 65), st.integers(-200, 200))
def test_whole_samples_are_a_rotation(samples: int, shift: int) -> None:
    block = np.random.default_rng(samples).normal(size=(samples, 2)) @ [1, 1j]
    np.testing.assert_allclose(
        fractional_delay(block, shift / 8.0, 8.0), np.roll(block, shift), atol=1e-12
    )


@given(st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3))
def test_delays_add(first_s: float, second_s: float) -> None:
    block = modulate(RangingSignal(samples=64), [1.0])
    twice = fractional_delay(fractional_delay(block, first_s, 4e6), second_s, 4e6)
    np.testing.assert_allclose(twice, fractional_delay(block, first_s + second_s, 4e6), atol=1e-9)


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 12))
def test_repetition_is_the_shortest_or_the_guess(period: int, repeats: int, guess: int) -> None:
    # Distinct samples: the block repeats after a multiple of the period and nothing else.
    block = np.tile(np.exp(1j * np.arange(period)), repeats)
    taken = guess > 0 and guess < len(block) and len(block) % guess == 0 and guess % period == 0
    assert repetition(block, guess) == (guess if taken else period)


def test_a_block_that_differs_in_one_sample_does_not_repeat() -> None:
    block = np.tile(np.exp(1j * np.arange(8)), 4)
    block[-1] += 1e-15
    assert repetition(block) == repetition(block, 8) == 32


def test_wrong_input() -> None:
    with pytest.raises(ValueError, match="at least one sample"):
        fractional_delay(np.zeros((2, 0)), 0.0, 4e6)
    with pytest.raises(ValueError, match="delay_s must be finite"):
        fractional_delay(np.zeros(4), math.nan, 4e6)
    with pytest.raises(ValueError, match="sample_rate_hz must be finite"):
        fractional_delay(np.zeros(4), 0.0, 0.0)
