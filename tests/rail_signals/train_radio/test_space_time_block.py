"""Space-time schemes against the algebra of the paper, right and as printed."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import j0

from rail_signals.train_radio.space_time_block import Scheme, scheme
from rail_signals.train_radio.symbol_mapping import constellation

NAMES = ["siso", "mrc", "alamouti_2x1", "alamouti_2x2"]


def normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Circular complex normals of unit variance."""
    return np.asarray(rng.normal(scale=math.sqrt(0.5), size=(*shape, 2)) @ [1, 1j])


def through(channel: np.ndarray, sent: np.ndarray) -> np.ndarray:
    """Received symbols [..., rx, n] of sent ones [..., tx, n] without noise."""
    return np.asarray(np.sum(channel * sent[..., None, :, :], axis=-2))


def constant(rng: np.random.Generator, plan: Scheme, *lead: int, n: int) -> np.ndarray:
    """Channel [..., rx, tx, n] that does not change."""
    h = normal(rng, *lead, plan.receive, plan.transmit, 1)
    return np.repeat(h, n, axis=-1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("code", ["bpsk", "qpsk", "16qam"])
@settings(max_examples=8)
@given(seed=st.integers(0, 10_000), lead=st.sampled_from([(), (3,), (0,), (2, 2)]))
def test_without_noise_every_symbol_comes_back(
    name: str, code: str, seed: int, lead: tuple[int, ...]
) -> None:
    rng = np.random.default_rng(seed)
    plan, mapping = scheme(name), constellation(code)
    bits = rng.integers(0, 2, (*lead, 12 * mapping.bits_per_symbol))
    x = mapping.modulate(bits)
    h = constant(rng, plan, *lead, n=12)
    found, gain = plan.combine(through(h, plan.encode(x)), h)
    np.testing.assert_allclose(found, x, atol=1e-9)
    np.testing.assert_array_equal(mapping.decide(found), bits)
    expected = np.sum(np.abs(h) ** 2, axis=(-3, -2)) / plan.transmit
    np.testing.assert_allclose(gain, expected, rtol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_total_power_is_that_of_the_symbols(name: str) -> None:
    x = normal(np.random.default_rng(1), 5, 8)
    sent = scheme(name).encode(x)
    energy = np.sum(np.abs(sent) ** 2, axis=(-2, -1))
    np.testing.assert_allclose(energy, np.sum(np.abs(x) ** 2, axis=-1))
    per_antenna = np.sum(np.abs(sent) ** 2, axis=-1)
    np.testing.assert_allclose(per_antenna, per_antenna[:, :1].repeat(sent.shape[-2], 1))


def test_the_code_matrix_is_orthogonal() -> None:
    """Equation 2: X X^H = (|x1|^2 + |x2|^2) I, with half the power per antenna."""
    x = normal(np.random.default_rng(2), 50, 2)
    code = scheme("alamouti_2x2").encode(x) * math.sqrt(2)
    product = code @ code.conj().swapaxes(-2, -1)
    energy = np.sum(np.abs(x) ** 2, axis=-1)[:, None, None]
    np.testing.assert_allclose(product, energy * np.eye(2), atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_noise_has_the_variance_that_the_gain_says(name: str) -> None:
    rng = np.random.default_rng(3)
    plan = scheme(name)
    h = constant(rng, plan, n=2)
    noise = normal(rng, 40_000, plan.receive, 2)
    found, gain = plan.combine(noise, h)
    assert np.mean(np.abs(found) ** 2 * gain) == pytest.approx(1.0, abs=0.02)
    # Orthogonality keeps the noises of a pair apart.
    assert abs(np.mean(found[:, 0] * found[:, 1].conj() * gain[:, 0])) < 0.03


def test_equation_4_as_printed_fails_on_noiseless_qpsk() -> None:
    """y2 = +h1 x2* + h2 x1*: 30 to 50 % of the symbols are wrong; with the minus sign none."""
    rng = np.random.default_rng(4)
    plan, code = scheme("alamouti_2x1"), constellation("qpsk")
    bits = rng.integers(0, 2, 40_000)
    x = code.modulate(bits)
    h = normal(rng, 1, 2, 10_000).repeat(2, axis=-1)
    y = through(h, plan.encode(x))
    x1, x2, h1, h2 = x[0::2], x[1::2], h[0, 0, 0::2], h[0, 1, 0::2]
    printed = y.copy()
    printed[0, 1::2] = (h1 * x2.conj() + h2 * x1.conj()) / math.sqrt(2)
    corrected = (-h1 * x2.conj() + h2 * x1.conj()) / math.sqrt(2)
    np.testing.assert_allclose(y[0, 1::2], corrected, atol=1e-12)

    def symbol_errors(received: np.ndarray) -> float:
        found = code.decide(plan.combine(received, h)[0])
        return float(np.mean((found != bits).reshape(-1, 2).any(axis=-1)))

    assert symbol_errors(y) == 0
    assert 0.3 < symbol_errors(printed) < 0.5


def test_equation_9_as_printed_fails_on_noiseless_16qam() -> None:
    """|h22|^2 twice in the denominator of x1: no matter for QPSK, 9.4 % of the x1 of 16-QAM."""
    rng = np.random.default_rng(5)
    plan = scheme("alamouti_2x2")
    h = normal(rng, 2, 2, 40_000).repeat(2, axis=-1)
    power = np.abs(h[..., 0::2]) ** 2
    printed = (power[0, 0] + power[1, 1] + power[1, 0] + power[1, 1]) / 2
    for name, low, high in (("qpsk", 0.0, 0.0), ("16qam", 0.087, 0.1)):
        code = constellation(name)
        bits = rng.integers(0, 2, 80_000 * code.bits_per_symbol)
        found, gain = plan.combine(through(h, plan.encode(code.modulate(bits))), h)
        np.testing.assert_array_equal(code.decide(found), bits)
        found[0::2] *= gain[0::2] / printed
        wrong = (code.decide(found) != bits).reshape(80_000, -1).any(axis=-1)
        assert low <= wrong[0::2].mean() <= high
        assert not wrong[1::2].any()


@pytest.mark.parametrize("name", ["alamouti_2x1", "alamouti_2x2"])
def test_a_channel_that_changes_within_a_pair_leaks(name: str) -> None:
    """The wanted symbol is unbiased; the other leaks in by the difference of h1* h2."""
    rng = np.random.default_rng(6)
    plan = scheme(name)
    h = normal(rng, 200, plan.receive, 2, 2)
    x = normal(rng, 200, 2)
    found, gain = plan.combine(through(h, plan.encode(x)), h)
    product = np.sum(h[:, :, 0].conj() * h[:, :, 1], axis=1)
    leak = (product[:, 0] - product[:, 1]) / 2
    np.testing.assert_allclose(found[:, 0], x[:, 0] + x[:, 1] * leak / gain[:, 0], atol=1e-9)
    np.testing.assert_allclose(found[:, 1], x[:, 1] + x[:, 0] * leak.conj() / gain[:, 1], atol=1e-9)


@pytest.mark.parametrize(("symbol_s", "change_db"), [(10e-6, -30.6), (66.7e-6, -14.1)])
def test_the_leak_of_a_moving_train_is_that_of_the_lost_correlation(
    symbol_s: float, change_db: float
) -> None:
    """Equation 3 at 300 km/h and 2.4 GHz, f_D = 667 Hz, with rho = J0(2 pi f_D T).

    The gain changes by 2 (1 - rho) of its power in one symbol. What leaks is the difference of
    two products h1* h2 of variance 1 and correlation rho^2: 2 (1 - rho^2).
    """
    rng = np.random.default_rng(7)
    rho = j0(2 * math.pi * 667.0 * symbol_s)
    early = normal(rng, 60_000, 1, 2, 1)
    late = rho * early + math.sqrt(1 - rho**2) * normal(rng, 60_000, 1, 2, 1)
    change = np.mean(np.abs(late - early) ** 2)
    assert 10 * math.log10(change) == pytest.approx(change_db, abs=0.1)
    h = np.concatenate([early, late], axis=-1)
    found, gain = scheme("alamouti_2x1").combine(through(h, np.array([[1.0, 0], [0, 1]])), h)
    # Sent is x1 = sqrt(2), x2 = 0; all that x2 shows has leaked.
    leak = found[:, 1] * gain[:, 1] * math.sqrt(2)
    assert np.mean(np.abs(leak) ** 2) == pytest.approx(2 * (1 - rho**2), rel=0.03)


def test_no_gain_gives_zero() -> None:
    for name in NAMES:
        plan = scheme(name)
        h = np.zeros((plan.receive, plan.transmit, 4))
        found, gain = plan.combine(np.ones((plan.receive, 4)), h)
        assert not found.any()
        assert not gain.any()


@pytest.mark.parametrize("name", ["alamouti", "", "MRC", None])
def test_a_bad_name_is_quoted(name: object) -> None:
    with pytest.raises(ValueError, match=re.escape(f"got {name!r}")):
        scheme(name)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: scheme("alamouti_2x2").encode(np.zeros(3)), "(3,)"),
        (lambda: scheme("siso").encode(1.0), "()"),
        (lambda: scheme("mrc").combine(np.zeros((1, 4)), np.zeros((2, 1, 4))), "(1, 4)"),
        (lambda: scheme("mrc").combine(np.zeros((2, 4)), np.zeros((1, 2, 4))), "(1, 2, 4)"),
        (lambda: scheme("alamouti_2x1").combine(np.zeros((1, 3)), np.zeros((1, 2, 3))), "(1, 3)"),
        (lambda: Scheme("three", 3, 1), "3"),
        (lambda: Scheme("none", 1, 0), "0"),
    ],
)
def test_bad_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        call()  # type: ignore[operator]
