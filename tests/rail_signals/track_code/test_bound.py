"""The closed forms of the track code agree with counting, and the fit reaches them."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest

from rail_signals.ranging.bounds import tone_phase_variance_bound
from rail_signals.track_code.bound import (
    accepted_probability,
    best_threshold,
    bit_error_bound,
    marcum_q1,
    message_error_bound,
    on_off_error_probability,
    phase_basis,
    snr_of_message_error,
    tone_covariance_bound,
    tone_sigma_bound,
    undetected_error_probability,
    window_probabilities,
)
from rail_signals.track_code.ml import MaximumLikelihoodTones

TONES_HZ = 0.88 + 0.64 * np.arange(27)
RATE_HZ = 128.0
SAMPLES = 200


def test_long_slots_tend_to_the_bound_of_one_tone() -> None:
    samples = 12_800
    variance = np.diag(tone_covariance_bound(TONES_HZ, 3.0, samples, 128.0))
    alone = TONES_HZ**2 * tone_phase_variance_bound(3.0, samples, 1.0)
    assert variance.reshape(2, -1) == pytest.approx(np.stack([alone, alone]), rel=0.01)


def test_bound_depends_on_the_noise_density_and_not_on_the_rate() -> None:
    low = tone_covariance_bound(TONES_HZ, 10.0, 200, 128.0)
    high = tone_covariance_bound(TONES_HZ, 10.0 * 128 / 16_000, 25_000, 16_000.0)
    # The sums differ from the integral by the half samples at the ends of the slot.
    assert np.diag(low) == pytest.approx(np.diag(high), rel=0.02)


def test_unknown_carrier_costs_the_slowest_tone_most() -> None:
    both = np.diag(tone_covariance_bound(TONES_HZ, 1.0, SAMPLES, RATE_HZ)).reshape(2, -1)
    tones_only = np.linalg.inv(2 * _normal()[2:, 2:])
    free = np.diag(tones_only).reshape(2, -1)
    loss = (both / free).max(axis=0)
    assert (both >= free * (1 - 1e-9)).all()
    assert loss.argmax() == 0
    assert 1.05 < loss[0] < 1.5


def _normal() -> np.ndarray:
    basis = phase_basis(TONES_HZ, SAMPLES, RATE_HZ)
    return np.asarray(basis.T @ basis)


def test_marcum_q_without_a_carrier_is_rayleigh() -> None:
    b = np.linspace(0, 6, 13)
    assert marcum_q1(0.0, b) == pytest.approx(np.exp(-(b**2) / 2), rel=1e-12)


@pytest.mark.parametrize("ratio", [0.5, 3.0, 8.0, 30.0])
def test_threshold_is_the_best(ratio: float) -> None:
    best = best_threshold(ratio)
    at = [
        math.exp(-(b**2) / 2) + 1 - float(marcum_q1(ratio, b))
        for b in (best * 0.99, best, best * 1.01)
    ]
    assert at[1] <= min(at) * (1 + 1e-9)
    assert float(on_off_error_probability(ratio)) == pytest.approx(at[1] / 2, rel=1e-6)


def test_message_error_is_that_of_correlated_amplitudes() -> None:
    rng = np.random.default_rng(5)
    snr = snr_of_message_error(0.05, TONES_HZ, 1.0, SAMPLES, RATE_HZ)
    assert message_error_bound(TONES_HZ, 1.0, snr, SAMPLES, RATE_HZ) == pytest.approx(0.05)
    bits, levels, _ = _draw(rng, snr, 40_000)
    sigma = tone_sigma_bound(TONES_HZ, snr, SAMPLES, RATE_HZ)
    threshold = np.array([best_threshold(1 / s) for s in sigma]) * sigma
    wrong = (levels > threshold) != bits
    assert wrong.any(axis=-1).mean() == pytest.approx(0.05, abs=0.005)
    p = bit_error_bound(TONES_HZ, 1.0, snr, SAMPLES, RATE_HZ)
    assert wrong.mean(axis=0)[-8:] == pytest.approx(p[-8:], rel=0.3)


def _draw(
    rng: np.random.Generator, snr: float, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Words [count, tones], levels at the bound, and the true complex amplitudes."""
    tones = len(TONES_HZ)
    bits = rng.integers(0, 2, (count, tones)).astype(bool)
    true = bits * np.exp(2j * math.pi * rng.uniform(size=bits.shape))
    root = np.linalg.cholesky(tone_covariance_bound(TONES_HZ, snr, SAMPLES, RATE_HZ))
    error = rng.normal(size=(count, 2 * tones)) @ root.T
    return bits, np.abs(true + error[:, :tones] - 1j * error[:, tones:]), true


def test_windows_refuse_what_lies_between() -> None:
    right, wrong = window_probabilities([6.0], [2.0], [4.0], [8.0])
    rng = np.random.default_rng(2)
    noise = rng.normal(size=(200_000, 2)).view(np.complex128)[:, 0]
    zero, one = np.abs(noise), np.abs(noise + 6.0)
    is_one = [((v > 4) & (v < 8)).mean() for v in (zero, one)]
    is_zero = [(v < 2).mean() for v in (zero, one)]
    assert right[0] == pytest.approx((is_zero[0] + is_one[1]) / 2, abs=0.002)
    assert wrong[0] == pytest.approx((is_zero[1] + is_one[0]) / 2, abs=0.002)


CHECK = np.array([[1, 0, 1, 1, 0, 1], [0, 1, 1, 0, 1, 1]])


def test_undetected_errors_are_those_of_all_patterns() -> None:
    rng = np.random.default_rng(3)
    right = rng.uniform(0.6, 0.9, 6)
    wrong = rng.uniform(0.3, 0.9, 6) * (1 - right)
    for times in (1, 2):
        total = 0.0
        for pattern in itertools.product((0, 1), repeat=6):
            e = np.array(pattern)
            if e.any() and not (CHECK @ e % 2).any():
                total += float(np.prod(np.where(e, wrong, right) ** times))
        found = undetected_error_probability(right, wrong, CHECK, times)
        assert found == pytest.approx(total, rel=1e-9)


def test_random_bits_pass_m_checks_once_in_2_to_the_m() -> None:
    half = np.full(6, 0.5)
    assert undetected_error_probability(half, half, CHECK) == pytest.approx(2**-2 - 2**-6)
    for syndrome in itertools.product((0, 1), repeat=2):
        assert accepted_probability(half, half, CHECK, syndrome) == pytest.approx(0.25)


def test_noise_that_reads_as_zeros_passes_only_if_zeros_are_a_message() -> None:
    zero, one = np.ones(6), np.zeros(6)
    assert accepted_probability(zero, one, CHECK, [0, 0]) == pytest.approx(1.0)
    assert accepted_probability(zero, one, CHECK, [1, 0]) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("density_db_hz", [35.0, 38.4, 45.0])
def test_the_fit_has_the_covariance_of_the_bound(density_db_hz: float) -> None:
    rng = np.random.default_rng(11)
    snr = 10 ** (density_db_hz / 10) / RATE_HZ
    count = 2500
    _, _, true = _draw(rng, snr, count)
    basis = phase_basis(TONES_HZ, SAMPLES, RATE_HZ)
    offset_hz = rng.uniform(-5, 5, count)
    carrier = [rng.uniform(0, 6, count), 2 * math.pi * offset_hz]
    phase = np.column_stack([*carrier, true.real, -true.imag]) @ basis.T
    noise = rng.normal(scale=math.sqrt(0.5 / snr), size=(*phase.shape, 2))
    fit = MaximumLikelihoodTones(TONES_HZ, SAMPLES, RATE_HZ)
    found = fit.estimate(0.3 * (np.exp(1j * phase) + noise.view(np.complex128)[..., 0]))
    error = found.amplitudes_hz - true
    joint = np.concatenate([error.real, -error.imag], axis=-1)
    covariance = joint.T @ joint / count
    bound = tone_covariance_bound(TONES_HZ, snr, SAMPLES, RATE_HZ)
    # Single entries scatter by sqrt(2 / count), 3 %; their mean by 0.4 %.
    ratio = np.diag(covariance) / np.diag(bound)
    assert 0.97 < ratio.mean() < 1.04
    assert (np.abs(ratio - 1) < 0.15).all()
    root = np.linalg.inv(np.linalg.cholesky(bound))
    white = root @ covariance @ root.T
    assert np.linalg.eigvalsh(white)[[0, -1]] == pytest.approx([1, 1], abs=0.4)
    assert np.std(found.offset_hz - offset_hz) < 0.1
    assert found.carrier.mean() == pytest.approx(0.3, rel=0.02)


def test_the_search_finds_waves_of_large_index() -> None:
    """Indices of 3.3 to 0.5 rad, where one start would not do; the bound is at 21 dB Hz."""
    rng = np.random.default_rng(12)
    deviations_hz = np.linspace(2.9, 8.1, 27)
    samples, rate_hz, count = 1000, 640.0, 60
    snr = 10 ** (30.0 / 10) / rate_hz
    bits = rng.integers(0, 2, (count, 27))
    true = bits * deviations_hz * np.exp(2j * math.pi * rng.uniform(size=bits.shape))
    carrier = np.column_stack([rng.uniform(0, 6, count), rng.uniform(-10, 10, count)])
    basis = phase_basis(TONES_HZ, samples, rate_hz)
    phase = np.column_stack([carrier, true.real, -true.imag]) @ basis.T
    noise = rng.normal(scale=math.sqrt(0.5 / snr), size=(*phase.shape, 2))
    wave = np.exp(1j * phase) + noise.view(np.complex128)[..., 0]
    start = MaximumLikelihoodTones(TONES_HZ, samples, rate_hz)
    search = MaximumLikelihoodTones(TONES_HZ, samples, rate_hz, deviations_hz=deviations_hz)

    def right(fit: MaximumLikelihoodTones) -> np.ndarray:
        levels = np.abs(fit.estimate(wave).amplitudes_hz) / deviations_hz
        return np.asarray(((levels > 0.5) == bits).all(axis=1))

    assert right(start).mean() < 0.1
    found = right(search)
    assert found.mean() > 0.95
    error = (search.estimate(wave).amplitudes_hz - true)[found]
    sigma = tone_sigma_bound(TONES_HZ, snr, samples, rate_hz)
    ratio = np.sqrt(np.mean(np.abs(error) ** 2, axis=0) / 2) / sigma
    assert ratio.mean() == pytest.approx(1.0, abs=0.06)


def test_the_fit_says_when_there_is_no_carrier() -> None:
    rng = np.random.default_rng(4)
    fit = MaximumLikelihoodTones(TONES_HZ, SAMPLES, RATE_HZ)
    noise = rng.normal(size=(50, SAMPLES, 2)).view(np.complex128)[..., 0]
    assert fit.estimate(noise).coherence.max() < 0.8
    assert np.isfinite(fit.estimate(np.zeros((2, SAMPLES))).amplitudes_hz).all()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: tone_covariance_bound([2.0, 1.0], 1.0, 100, 10.0), "increasing"),
        (lambda: tone_covariance_bound([1.0], 0.0, 100, 10.0), "0.0"),
        (lambda: phase_basis(TONES_HZ, 30, 128.0), "30"),
        (lambda: best_threshold(-1.0), "-1.0"),
        (lambda: snr_of_message_error(0.7, [1.0], 1.0, 100, 10.0), "0.7"),
        (lambda: MaximumLikelihoodTones([1.0], 100, -5.0), "-5.0"),
        (lambda: MaximumLikelihoodTones([1.0], 100, 5.0, steps=0), "0"),
        (lambda: MaximumLikelihoodTones([1.0], 100, 5.0).estimate(np.zeros(3)), "(3,)"),
    ],
)
def test_bad_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        call()  # type: ignore[operator]
