"""Compiled passes over sections and roots: beside NumPy and beside their plain form."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.train_bus.root_kernel import principal_roots
from rail_signals.train_bus.section_kernel import section_decay, through_sections


def decay(loss: np.ndarray, phase: np.ndarray, length_m: float) -> np.ndarray:
    re, im = np.empty(len(loss)), np.empty(len(loss))
    section_decay(loss, phase, length_m, np.empty(len(loss), dtype=np.int64), re, im)
    return re + 1j * im


@pytest.mark.parametrize("length_m", [0.0, 1.0, 80.0, 3000.0])
def test_a_decay_is_the_exponential(length_m: float) -> None:
    rng = np.random.default_rng(1)
    loss, phase = rng.uniform(0, 0.1, 4000), rng.uniform(0, 10, 4000)
    found = decay(loss, phase, length_m)
    wanted = np.exp(-loss * length_m) * np.exp(-1j * (phase * length_m))
    np.testing.assert_allclose(np.abs(found - wanted) / np.abs(wanted), 0.0, atol=6e-16)


def test_quarter_turns_and_what_decays_to_nothing() -> None:
    turns = np.arange(-8, 9) * np.pi / 2
    np.testing.assert_allclose(decay(0.0 * turns, turns, 1.0), np.exp(-1j * turns), atol=1e-15)
    gone = decay(np.array([700.0, 1e3, 1e6]), np.zeros(3), 1.0)
    assert np.all(np.abs(gone) < 1e-300)


def test_a_pass_is_that_of_waves_in_numpy() -> None:
    rng = np.random.default_rng(2)
    count, lengths = 1300, rng.uniform(1.0, 50.0, 7)  # two blocks and a part
    ratios = rng.uniform(0.8, 1.2, 7)
    loss, phase = rng.uniform(0, 0.05, count), rng.uniform(0, 10, count)
    voltage, drop = rng.normal(size=(2, count, 2)).view(np.complex128)[..., 0]
    v, d = voltage.copy(), drop.copy()
    plain_v, plain_d = voltage.copy(), drop.copy()
    for length, ratio in zip(lengths, ratios, strict=True):
        drop = drop * ratio
        backward = (voltage - drop) * np.exp(-2 * (loss + 1j * phase) * length)
        voltage, drop = (voltage + drop + backward) / 2, (voltage + drop - backward) / 2
    reals = [x.view(np.float64) for x in (v, d)]
    through_sections(*reals, loss, phase, lengths, ratios)
    np.testing.assert_allclose(v, voltage, atol=1e-12)
    np.testing.assert_allclose(d, drop, atol=1e-12)
    plain = [x.view(np.float64) for x in (plain_v, plain_d)]
    through_sections.py_func(*plain, loss, phase, lengths, ratios)  # type: ignore[attr-defined]
    np.testing.assert_allclose(plain_v, v, rtol=1e-12, atol=1e-14)


def test_roots_are_exact_in_both_parts() -> None:
    rng = np.random.default_rng(3)
    value = rng.normal(size=(500, 2)).view(np.complex128)[:, 0] * 10.0 ** rng.uniform(-60, 60, 500)
    value[:4] = 0.0, -4.0, 4.0, 1e-9 - 4.0j
    root = np.empty(500, dtype=np.complex128)
    principal_roots(value, root)
    np.testing.assert_allclose(root, np.sqrt(value), rtol=1e-14)
