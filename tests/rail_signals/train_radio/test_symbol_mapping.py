"""Constellations against their closed forms and against a search for the nearest point."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import erfc

from rail_signals.train_radio.symbol_mapping import Constellation, constellation

NAMES = ["bpsk", "qpsk", "16qam"]


@pytest.mark.parametrize("name", NAMES)
def test_points_have_unit_mean_energy_and_differ(name: str) -> None:
    points = constellation(name).points
    assert len(set(points.round(9).tolist())) == 2 ** constellation(name).bits_per_symbol
    assert np.mean(np.abs(points) ** 2) == pytest.approx(1.0, abs=1e-12)
    assert abs(points.mean()) < 1e-12


@pytest.mark.parametrize("name", NAMES)
def test_nearest_neighbours_differ_in_one_bit(name: str) -> None:
    points = constellation(name).points
    distance = np.abs(points[:, None] - points)
    np.fill_diagonal(distance, math.inf)
    for i, j in np.argwhere(distance < distance.min() * 1.001).tolist():
        assert (i ^ j).bit_count() == 1


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=20)
@given(seed=st.integers(0, 1000), shape=st.sampled_from([(0,), (1,), (3, 5), (2, 0, 4)]))
def test_decisions_undo_modulation(name: str, seed: int, shape: tuple[int, ...]) -> None:
    code = constellation(name)
    size = (*shape[:-1], shape[-1] * code.bits_per_symbol)
    bits = np.random.default_rng(seed).integers(0, 2, size, dtype=np.uint8)
    symbols = code.modulate(bits)
    assert symbols.shape == shape
    found = code.decide(symbols)
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, bits)
    np.testing.assert_array_equal(code.modulate(bits.astype(bool)), symbols)


@pytest.mark.parametrize("name", NAMES)
def test_decisions_take_the_nearest_point(name: str) -> None:
    code = constellation(name)
    z = np.random.default_rng(1).normal(size=(2000, 2)) @ [1, 1j]
    label = np.argmin(np.abs(z[:, None] - code.points), axis=1)
    np.testing.assert_allclose(code.modulate(code.decide(z)), code.points[label])


@pytest.mark.parametrize("name", NAMES)
def test_bit_errors_in_white_noise(name: str) -> None:
    """Closed forms over Eb/N0 = 4 dB; 16-QAM is Q(a) 3/4 + Q(3a) / 2 - Q(5a) / 4."""
    code, count = constellation(name), 200_000
    eb_n0 = 10**0.4
    rng = np.random.default_rng(2)
    bits = rng.integers(0, 2, count * code.bits_per_symbol)
    sigma = math.sqrt(0.5 / (code.bits_per_symbol * eb_n0))
    noise = rng.normal(scale=sigma, size=(count, 2)) @ [1, 1j]
    wrong = int(np.sum(code.decide(code.modulate(bits) + noise) != bits))

    def q(x: float) -> float:
        return float(erfc(x / math.sqrt(2)) / 2)

    a = math.sqrt(2 * eb_n0) if code.bits_per_symbol < 4 else math.sqrt(0.8 * eb_n0)
    exact = q(a) if code.bits_per_symbol < 4 else 0.75 * q(a) + 0.5 * q(3 * a) - 0.25 * q(5 * a)
    mean = exact * bits.size
    assert abs(wrong - mean) < 4 * math.sqrt(mean)


def test_what_is_not_a_number_reads_as_zeros() -> None:
    z = np.array([complex(math.nan, math.nan)])
    for name in NAMES:
        assert not constellation(name).decide(z).any()


@pytest.mark.parametrize("name", ["8psk", "", "BPSK", None, []])
def test_a_bad_name_is_quoted(name: object) -> None:
    with pytest.raises(ValueError, match=re.escape(f"got {name!r}")):
        constellation(name)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("code", "bits", "message"),
    [
        (constellation("qpsk"), [0, 1, 0], "(3,)"),
        (constellation("bpsk"), 1, "()"),
        (constellation("bpsk"), [0, 2, 1], "2"),
        (constellation("bpsk"), [0.5], "0.5"),
    ],
)
def test_bad_bits_are_quoted(code: Constellation, bits: object, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        code.modulate(bits)  # type: ignore[arg-type]


def test_symbols_need_an_axis() -> None:
    with pytest.raises(ValueError, match="axis"):
        constellation("qpsk").decide(1j)
