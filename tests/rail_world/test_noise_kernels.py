"""Compiled noise against NumPy's generator and the transform of Box and Muller in doubles."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.single_precision import phasor_of_turns
from rail_world.ranging.noise import NoiseSource, PlacedWords
from rail_world.track_code.noise import RealNoiseSource


def words(seed: int, stream: int, stage: int, port: int, tick: int, count: int) -> np.ndarray:
    """Words of NumPy's own generator at a place."""
    bits = np.random.Philox(np.random.SeedSequence([seed, stream]))
    state = bits.state
    state["state"]["counter"][:] = (0, stage, port, tick)
    state["buffer_pos"] = 4
    bits.state = state
    return np.asarray(bits.random_raw(count))


def parts(placed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared magnitude and angle in double precision of the numbers of a block."""
    halves = placed.view(np.uint32)
    uniform = (halves[: len(placed)] + 0.5) * 2.0**-32
    return -np.log(uniform), 2.0 * np.pi * halves[len(placed) :] * 2.0**-32


@pytest.mark.parametrize("count", [1, 4, 7, 64, 1001])
def test_words_are_those_of_philox(count: int) -> None:
    drawn = PlacedWords(9, 3).draw(4, [0, 5, 1 << 40], 77, count)
    for row, port in zip(drawn, (0, 5, 1 << 40), strict=True):
        assert np.array_equal(row, words(9, 3, 4, port, 77, count))


@pytest.mark.parametrize("samples", [1, 5, 8, 960])
def test_complex_numbers_are_those_of_box_and_muller(samples: int) -> None:
    found = NoiseSource(9, samples).blocks(2, [6, 7], 5, np.array([1.0, 9.0]))
    for row, port, sigma in zip(found, (6, 7), (1.0, 3.0), strict=True):
        square, angle = parts(words(9, 1, 2, port, 5, samples))
        np.testing.assert_allclose(row, sigma * np.sqrt(square) * np.exp(1j * angle), atol=5e-6)


@pytest.mark.parametrize("samples", [1, 7, 8, 4000])
def test_real_numbers_are_those_of_box_and_muller(samples: int) -> None:
    (found,) = RealNoiseSource(9, samples).blocks(2, [6], 5)
    square, angle = parts(words(9, 4, 2, 6, 5, (samples + 1) // 2))
    radius = np.sqrt(2.0 * square)
    both = np.concatenate((radius * np.cos(angle), radius * np.sin(angle)))
    np.testing.assert_allclose(found, both[:samples], atol=5e-6)


def test_windows_are_cut_from_blocks_of_all_antennas() -> None:
    source = NoiseSource(9, 2 * 16)
    power = np.array([1.0, 1.0, 4.0])
    spans = np.array([[100, 3, 40], [100, 30, 33], [500, 16, 32]])
    found = source.windows(11, spans, 5, power, 2)
    blocks = source.blocks(11, [100, 101, 102, 501], 5, np.ones(4)).reshape(4, 2, 16)
    long = blocks[:3].transpose(1, 0, 2).reshape(2, -1)
    expected = np.concatenate((long[:, 3:40], long[:, 30:33], 2.0 * blocks[3]), axis=1)
    assert np.array_equal(found, expected)


def test_phasors_are_those_of_the_library() -> None:
    turns = np.concatenate((np.linspace(-1.3, 1.3, 1001), [1e7 + 0.375, -123.125]))
    exact = np.exp(2j * np.pi * (turns % 1.0))
    for kernel in (phasor_of_turns, phasor_of_turns.py_func):
        found = np.array([complex(*kernel(turn)) for turn in turns.tolist()])
        assert np.abs(found - exact).max() < 2e-7
