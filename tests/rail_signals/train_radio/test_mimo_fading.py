"""The fading field against the closed forms of Jakes, Rayleigh and Rice."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import i0e, i1e, j0

from rail_signals.train_radio.mimo_fading import MimoFading, maximum_doppler_hz

WAVELENGTH_M = 0.125


def ensemble(
    draws: int, place_m: np.ndarray, *, receive: int = 2, transmit: int = 2, factor: float = 0.0
) -> np.ndarray:
    """Gains [draws, rx, tx, n] of independent fields."""
    rng = np.random.default_rng(1)
    return np.array(
        [MimoFading(rng, receive, transmit, WAVELENGTH_M, factor).at(place_m) for _ in range(draws)]
    )


def test_doppler_at_300_km_h() -> None:
    assert maximum_doppler_hz(300 / 3.6, 2.4e9) == pytest.approx(667, abs=0.5)
    assert maximum_doppler_hz(300 / 3.6, 2.6e9) == pytest.approx(722.7, abs=0.1)


@pytest.mark.parametrize("factor", [0.0, 3.0])
def test_the_series_is_the_sum_of_waves(factor: float) -> None:
    """Against the sum itself, rebuilt from the same draws in the same order."""
    waves, place = 24, np.random.default_rng(0).uniform(-50, 5000, 400)
    field = MimoFading(np.random.default_rng(5), 2, 1, WAVELENGTH_M, factor, waves, -0.5)
    rng = np.random.default_rng(5)
    angle = math.pi * (np.arange(waves) + rng.uniform(size=(2, 1, waves))) / waves
    start = 2 * math.pi * rng.uniform(size=(2, 1, waves))
    theta = 2 * math.pi * (rng.uniform(size=(2, 1, 1)) + rng.uniform(size=(1, 1, 1)))
    k = 2 * math.pi * place / WAVELENGTH_M
    scattered = np.exp(1j * (k * np.cos(angle)[..., None] + start[..., None])).sum(axis=-2)
    expected = scattered / math.sqrt(waves * (factor + 1))
    expected += math.sqrt(factor / (factor + 1)) * np.exp(1j * (-0.5 * k + theta))
    # 6e-10 per unit of amplitude, sqrt(waves) of it; rounding of 2 pi 40 000 turns.
    np.testing.assert_allclose(field.at(place), expected, atol=6.1e-10 * math.sqrt(waves))


@pytest.mark.parametrize("factor", [0.0, 5.0])
def test_mean_power_and_independence(factor: float) -> None:
    h = ensemble(1000, np.array([0.0]), factor=factor)[..., 0].reshape(1000, 4)
    covariance = h.T @ h.conj() / len(h)
    # Entries scatter by 1 / sqrt(1000) = 3.2 %.
    np.testing.assert_allclose(covariance, np.eye(4), atol=0.13)
    relation = h.T @ h / len(h)
    np.testing.assert_allclose(relation, np.zeros((4, 4)), atol=0.13)


def test_autocorrelation_is_that_of_jakes() -> None:
    """J0(2 pi d / lambda) within 4 standard deviations of 1 / sqrt(2800) for each lag."""
    lag = np.linspace(0.0, 2.0, 41) * WAVELENGTH_M
    h = ensemble(700, lag).reshape(-1, lag.size)
    found = np.mean(h * h[:, :1].conj(), axis=0)
    np.testing.assert_allclose(
        found, j0(2 * math.pi * lag / WAVELENGTH_M), atol=4 / math.sqrt(2800)
    )


def test_one_draw_is_near_the_ensemble() -> None:
    """Averaged along 500 m of track, one draw keeps to J0 within 0.05 up to two wavelengths."""
    place = np.arange(0.0, 500.0, WAVELENGTH_M / 8)
    h = MimoFading(np.random.default_rng(3), 1, 1, WAVELENGTH_M).at(place)[0, 0]
    assert np.mean(np.abs(h) ** 2) == pytest.approx(1.0, abs=0.01)
    for steps in range(17):
        found = np.mean(h[steps:] * h[: len(h) - steps].conj())
        assert abs(found - j0(2 * math.pi * steps / 8)) < 0.05


def test_the_standing_train_has_a_constant_channel() -> None:
    h = MimoFading(np.random.default_rng(4), 2, 2, WAVELENGTH_M).at(np.full(50, 777.7))
    assert (h == h[..., :1]).all()


def test_rayleigh_envelope() -> None:
    """Moments sqrt(pi) / 2 and 2 - 1 / N of a sum of N = 32 waves."""
    h = np.abs(ensemble(150, np.arange(60) * 3.7 * WAVELENGTH_M)).ravel()
    assert h.mean() == pytest.approx(math.sqrt(math.pi) / 2, rel=0.02)
    assert np.mean(h**4) == pytest.approx(2 - 1 / 32, rel=0.05)
    assert np.mean(h**2 < 0.01) == pytest.approx(0.01, rel=0.3)


@pytest.mark.parametrize("factor", [1.0, 8.0])
def test_rician_envelope(factor: float) -> None:
    """Mean by Laguerre's L_1/2; E|h|^4 = 1 + (2 K + 1) / (K + 1)^2."""
    h = np.abs(ensemble(150, np.arange(60) * 3.7 * WAVELENGTH_M, factor=factor)).ravel()
    half = factor / 2
    laguerre = (1 + factor) * i0e(half) + factor * i1e(half)
    assert h.mean() == pytest.approx(math.sqrt(math.pi / 4 / (factor + 1)) * laguerre, rel=0.02)
    assert np.mean(h**4) == pytest.approx(1 + (2 * factor + 1) / (factor + 1) ** 2, rel=0.05)


def test_the_line_of_sight_turns_at_its_own_doppler() -> None:
    speed_mps, rate_hz = 300 / 3.6, 10_000.0
    place = np.arange(4000) * speed_mps / rate_hz
    wavelength_m = 299_792_458.0 / 2.4e9
    for cosine in (1.0, -0.6):
        field = MimoFading(
            np.random.default_rng(6), 1, 1, wavelength_m, 1e6, line_of_sight_cosine=cosine
        )
        h = field.at(place)[0, 0]
        found_hz = np.angle(np.vdot(h[:-1], h[1:])) * rate_hz / (2 * math.pi)
        assert found_hz == pytest.approx(cosine * maximum_doppler_hz(speed_mps, 2.4e9), abs=0.5)
        assert np.abs(h) == pytest.approx(1.0, abs=0.01)


def test_nothing_lies_beyond_the_doppler_limit() -> None:
    speed_mps, rate_hz, count = 300 / 3.6, 4000.0, 16_384
    field = MimoFading(np.random.default_rng(7), 1, 1, 299_792_458.0 / 2.4e9, waves=64)
    h = field.at(np.arange(count) * speed_mps / rate_hz)[0, 0]
    power = np.abs(np.fft.fft(h * np.hanning(count))) ** 2
    outside = np.abs(np.fft.fftfreq(count, 1 / rate_hz)) > 667.2 + 3 * rate_hz / count
    assert power[outside].sum() < 1e-6 * power.sum()


@settings(max_examples=20)
@given(st.integers(0, 300), st.integers(0, 300), st.floats(0, 1e5))
def test_pieces_make_the_whole_to_the_last_bit(one: int, two: int, start_m: float) -> None:
    field = MimoFading(np.random.default_rng(8), 2, 2, WAVELENGTH_M, 2.0)
    place = start_m + np.arange(300) * 2e-3
    first, last = sorted((one, two))
    whole = field.at(place)
    pieces = [field.at(p) for p in (place[:first], place[first:last], place[last:])]
    assert np.array_equal(np.concatenate(pieces, axis=-1), whole)
    assert np.array_equal(field.at(place[::-1]), whole[..., ::-1])


def test_leading_axes() -> None:
    field = MimoFading(np.random.default_rng(9), 2, 1, WAVELENGTH_M)
    place = np.random.default_rng(9).uniform(0, 10, (3, 4, 5))
    h = field.at(place)
    assert h.shape == (3, 4, 2, 1, 5)
    assert np.array_equal(h[1, 2], field.at(place[1, 2]))
    assert field.at(np.zeros((2, 0))).shape == (2, 2, 1, 0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"receive": 0}, "0"),
        ({"transmit": 1.5}, "1.5"),
        ({"wavelength_m": -1.0}, "-1.0"),
        ({"rician_factor": math.inf}, "inf"),
        ({"waves": 7}, "7"),
        ({"line_of_sight_cosine": 1.1}, "1.1"),
    ],
)
def test_bad_parameters_are_quoted(arguments: dict[str, float], message: str) -> None:
    good = {"receive": 1, "transmit": 1, "wavelength_m": 0.125}
    with pytest.raises(ValueError, match=re.escape(f"got {message}")):
        MimoFading(np.random.default_rng(0), **{**good, **arguments})  # type: ignore[arg-type]


@pytest.mark.parametrize("place", [1.0, [math.nan], [0.0, math.inf]])
def test_bad_places(place: object) -> None:
    with pytest.raises(ValueError, match="distance_m"):
        MimoFading(np.random.default_rng(0), 1, 1, 0.125).at(place)  # type: ignore[arg-type]
