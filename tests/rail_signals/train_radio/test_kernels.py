"""Compiled kernels beside NumPy and SciPy: the sums of the receiver as one writes them down."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import upfirdn
from scipy.special import j0

import rail_signals.train_radio.burst as burst_module
from rail_signals.train_radio.assembly import assemble_bursts
from rail_signals.train_radio.burst import RadioBurstFormat, RadioBurstReceiver
from rail_signals.train_radio.pilot_estimation import (
    PilotLevel,
    WienerEstimator,
    _channels,
    _levels,
    wiener_estimator,
)
from rail_signals.train_radio.pilot_pattern import PilotPattern
from rail_signals.train_radio.pulse import matched_filter, root_raised_cosine, shape_pulses
from rail_signals.train_radio.reception import receive_bursts
from rail_signals.train_radio.slots import _look_for_signals, used_slots
from rail_signals.train_radio.space_time_block import Scheme, _combined, _encoded, scheme
from rail_signals.train_radio.symbol_mapping import constellation

SCHEMES = ["siso", "mrc", "alamouti_2x1", "alamouti_2x2"]


def normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Circular complex normals of unit variance."""
    return np.asarray(rng.normal(scale=math.sqrt(0.5), size=(*shape, 2)) @ [1, 1j])


@pytest.mark.parametrize("samples_per_symbol", [2, 3, 4])
def test_pulses_are_those_of_a_filter_between_zeros(samples_per_symbol: int) -> None:
    burst = RadioBurstFormat(
        scheme("alamouti_2x2"),
        constellation("16qam"),
        120,
        samples_per_symbol=samples_per_symbol,
    )
    bits = np.random.default_rng(1).integers(0, 2, (3, 120))
    symbols = burst.pattern.insert(burst.scheme.encode(burst.constellation.modulate(bits)))
    expected = upfirdn(burst.pulse, symbols, up=samples_per_symbol, axis=-1)
    wave = burst.transmit(bits)
    length = expected.shape[-1]
    np.testing.assert_allclose(wave[..., :length], expected, atol=1e-14)
    assert not wave[..., length:].any()


@pytest.mark.parametrize("samples_per_symbol", [2, 3, 4])
def test_the_matched_filter_is_a_filter_that_drops_samples(samples_per_symbol: int) -> None:
    burst = RadioBurstFormat(
        scheme("siso"), constellation("bpsk"), 31, samples_per_symbol=samples_per_symbol
    )
    samples = normal(np.random.default_rng(2), 5, 2, burst.samples)
    filtered = upfirdn(burst.pulse, samples, down=samples_per_symbol, axis=-1)
    first = 2 * burst.span_symbols
    expected = filtered[..., first : first + burst.pattern.symbols]
    np.testing.assert_allclose(burst.symbols_of(samples), expected, atol=1e-13)


def pilot_covariance(pattern: PilotPattern, doppler: float) -> np.ndarray:
    """K of the module's docstring [pilots, pilots]."""
    at = pattern.pilot_positions
    jakes = j0(2 * math.pi * doppler * (at[:, None] - at))
    return np.asarray(jakes * (pattern.pilots.T @ pattern.pilots))


def level_of(covariance: np.ndarray, received: np.ndarray) -> PilotLevel:
    """Maximum likelihood over the grid from the covariance of the pilots itself."""
    antennas, count = received.shape
    best: tuple[float, float, float, int] | None = None
    for step, snr in enumerate(10.0 ** (np.arange(-20, 61) / 10)):
        whole = snr * covariance + np.eye(count)
        energy = sum(np.real(y.conj() @ np.linalg.solve(whole, y)) for y in received)
        noise = energy / (antennas * count)
        cost = antennas * (count * math.log(noise) + np.linalg.slogdet(whole)[1])
        if best is None or cost < best[0]:
            best = cost, float(noise), float(snr), step
    assert best is not None
    alone = antennas * count * math.log(np.mean(np.abs(received) ** 2))
    cost, noise, snr, step = best
    values = (np.asarray(v) for v in (snr, noise, max(alone - cost, 0.0)))
    return PilotLevel(*values, np.asarray(step))


@pytest.mark.parametrize("transmit", [1, 2])
def test_levels_are_the_maximum_of_the_likelihood(transmit: int) -> None:
    pattern = PilotPattern(56, transmit)
    estimator = WienerEstimator(pattern, 0.02)
    rng = np.random.default_rng(3)
    sent = np.sum(normal(rng, 6, 2, transmit, 1) * pattern.pilots, axis=-2)
    received = sent + 0.2 * normal(rng, *sent.shape)
    found = estimator.level(received)
    for i in range(6):
        expected = level_of(pilot_covariance(pattern, 0.02), received[i])
        assert found.step[i] == expected.step
        assert found.snr[i] == expected.snr
        assert found.noise_variance[i] == pytest.approx(float(expected.noise_variance), rel=1e-9)
        assert found.evidence[i] == pytest.approx(float(expected.evidence), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("transmit", [1, 2])
def test_channels_are_those_of_the_wiener_filter(transmit: int) -> None:
    pattern, doppler = PilotPattern(56, transmit), 0.02
    rng = np.random.default_rng(6)
    received = normal(rng, 3, 2, len(pattern.pilot_positions))
    snr = np.array([0.3, 7.0, 1e3])
    between = pilot_covariance(pattern, doppler)
    apart = np.arange(pattern.symbols)[:, None] - pattern.pilot_positions
    ahead = j0(2 * math.pi * doppler * apart) * pattern.pilots[:, None, :]
    found = WienerEstimator(pattern, doppler).estimate(received, snr)
    for i, level in enumerate(snr):
        inverse = np.linalg.inv(level * between + np.eye(len(between)))
        expected = np.einsum("atp,rp->rat", level * ahead @ inverse, received[i])
        np.testing.assert_allclose(found[i], expected, atol=1e-11)


def combined(plan: Scheme, y: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eqs 6, 8 and 9 in NumPy."""
    power = np.abs(h) ** 2
    if plan.transmit == 1:
        matched, gain = np.sum(h[..., 0, :].conj() * y, axis=-2), np.sum(power[..., 0, :], axis=-2)
        return matched / gain, gain
    y1, y2 = y[..., 0::2], y[..., 1::2].conj()
    early, late = h[..., 0::2], h[..., 1::2]
    matched, gain = np.empty((2, *y.shape[:-2], y.shape[-1]), dtype=np.complex128)
    matched[..., 0::2] = np.sum(early[..., 0, :].conj() * y1 + late[..., 1, :] * y2, axis=-2)
    matched[..., 1::2] = np.sum(early[..., 1, :].conj() * y1 - late[..., 0, :] * y2, axis=-2)
    gain[..., 0::2] = np.sum(power[..., 0, 0::2] + power[..., 1, 1::2], axis=-2)
    gain[..., 1::2] = np.sum(power[..., 1, 0::2] + power[..., 0, 1::2], axis=-2)
    return matched * math.sqrt(0.5) / (gain * 0.5), gain.real * 0.5


@pytest.mark.parametrize("name", SCHEMES)
def test_combining_is_that_of_the_equations(name: str) -> None:
    plan, rng = scheme(name), np.random.default_rng(4)
    y, h = normal(rng, 3, plan.receive, 10), normal(rng, 3, plan.receive, plan.transmit, 10)
    symbols, gain = plan.combine(y, h)
    expected, weights = combined(plan, y, h)
    np.testing.assert_allclose(symbols, expected, rtol=1e-12)
    np.testing.assert_allclose(gain, weights, rtol=1e-12)
    # One channel for all bursts is one for each.
    same, _ = plan.combine(y, h[0])
    np.testing.assert_array_equal(same[0], symbols[0])


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("points", ["bpsk", "qpsk", "16qam"])
def test_a_burst_is_received_as_step_by_step(name: str, points: str) -> None:
    burst = RadioBurstFormat(scheme(name), constellation(points), 123)
    plan, pattern, rng = burst.scheme, burst.pattern, np.random.default_rng(7)
    bits = rng.integers(0, 2, (5, 123), dtype=np.uint8)
    air = normal(rng, 5, plan.receive, plan.transmit)
    samples = air @ burst.transmit(bits) + 0.05 * normal(rng, 5, plan.receive, burst.samples)
    samples[1] = 0.0
    samples[2] = normal(rng, *samples[2].shape)
    samples[3, 0, 5] = np.inf
    found = RadioBurstReceiver(burst).receive(samples, doppler_hz=50.0)
    assert found.detected.tolist() == [True, False, False, False, True]
    estimator = wiener_estimator(pattern, 50.0 / burst.symbol_rate_hz)
    for i in range(5):
        if not found.detected[i]:
            assert not (found.bits[i].any() or found.snr[i].any() or found.channel[i].any())
            continue
        y = burst.symbols_of(samples[i])
        level = estimator.level(y[..., pattern.pilot_positions])
        channel = estimator.estimate(y[..., pattern.pilot_positions], level.snr)
        symbols, gain = plan.combine(y, channel)
        excess = 1.0 + level.snr * estimator.error_variance(level.snr).mean(axis=0)
        snr = gain / (level.noise_variance * excess)
        decided = burst.constellation.decide(symbols[pattern.data_positions])[:123]
        np.testing.assert_array_equal(found.bits[i], decided)
        np.testing.assert_array_equal(decided, bits[i])
        np.testing.assert_array_equal(found.channel[i], channel)
        np.testing.assert_allclose(found.snr[i], snr[pattern.data_positions], rtol=1e-12)
        assert found.noise_variance[i] == level.noise_variance
        alone = RadioBurstReceiver(burst).receive(samples[i], doppler_hz=50.0)
        np.testing.assert_array_equal(alone.snr, found.snr[i])


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("points", ["bpsk", "qpsk", "16qam"])
def test_a_burst_is_assembled_as_step_by_step(name: str, points: str) -> None:
    burst = RadioBurstFormat(scheme(name), constellation(points), 123)
    bits = np.random.default_rng(8).integers(0, 2, (3, 123), dtype=np.uint8)
    room = burst.pattern.data_symbols * burst.constellation.bits_per_symbol
    filled = np.concatenate([bits, np.zeros((3, room - 123), dtype=np.uint8)], axis=1)
    data = burst.scheme.encode(burst.constellation.modulate(filled))
    expected = burst.pattern.insert(data)
    given = (
        *(bits, burst.constellation.points, burst.constellation.bits_per_symbol),
        *(burst.pattern.data_positions, burst.pattern.pilot_positions, burst.pattern.pilots),
    )
    for kernel in (assemble_bursts, assemble_bursts.py_func):  # type: ignore[attr-defined]
        made = np.zeros_like(expected)
        kernel(*given, made)
        np.testing.assert_array_equal(made, expected)


def test_slots_with_a_signal_are_found() -> None:
    block = np.zeros((2, 7 * 150 + 3), dtype=np.complex128)
    block[0, 0], block[1, 2 * 150 + 149], block[0, 4 * 150 + 70] = 1j, np.nan, 1e-300
    block[0, 5 * 150 : 6 * 150] = -0.0
    block[1, -1] = 1.0  # behind the last whole slot
    assert used_slots(block, 150) == [0, 2, 4]
    words, used = block.view(np.uint64), np.empty(7, dtype=np.bool_)
    _look_for_signals.py_func(words, 300, used)  # type: ignore[attr-defined]
    assert np.flatnonzero(used).tolist() == [0, 2, 4]


def test_reception_in_plain_python_is_the_same() -> None:
    burst = RadioBurstFormat(scheme("alamouti_2x2"), constellation("qpsk"), 24)
    rng = np.random.default_rng(9)
    samples = normal(rng, 2, 2, 2) @ burst.transmit(rng.integers(0, 2, (2, 24)))
    samples += 0.05 * normal(rng, *samples.shape)
    one = RadioBurstReceiver(burst).receive(samples)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(burst_module, "receive_bursts", receive_bursts.py_func)  # type: ignore[attr-defined]
        other = RadioBurstReceiver(burst).receive(samples)
    assert one.detected.all()
    np.testing.assert_array_equal(one.bits, other.bits)
    np.testing.assert_allclose(one.snr, other.snr, rtol=1e-13)


def test_compiled_and_plain_python_are_one() -> None:
    """Each kernel does what is written: the same operations in the same order."""
    rng = np.random.default_rng(5)
    pulse = root_raised_cosine(0.35, 2, 3)
    waves, symbols = rng.normal(size=(2, 14, 2, 2)), rng.normal(size=(2, 16))
    vectors, shrink = rng.normal(size=(5, 5)), rng.uniform(size=(5, 7))
    pilots, penalty = rng.normal(size=(3, 2, 10)), rng.normal(size=7)
    rows, weight = np.zeros((8, 6)), rng.uniform(size=(3, 5))
    rows[:5] = rng.normal(size=(5, 6))
    y, h = normal(rng, 3, 2, 6), normal(rng, 3, 2, 2, 6)
    for kernel, given, results in (
        (shape_pulses, (symbols, pulse), (np.zeros_like(waves),)),
        (matched_filter, (waves, pulse), (np.zeros_like(symbols),)),
        (
            _levels,
            (pilots, vectors, shrink, penalty),
            (np.zeros(3, dtype=np.intp), np.zeros((2, 3))),
        ),
        (_channels, (pilots, weight, vectors, rows), (np.zeros((3, 2, 12)),)),
        (_encoded, (y[0],), (np.zeros((2, 2, 6), dtype=np.complex128),)),
        (_combined, (y, h), (np.zeros((3, 6), dtype=np.complex128), np.zeros((3, 6)))),
    ):
        plain = tuple(result.copy() for result in results)
        kernel(*given, *results)
        kernel.py_func(*given, *plain)
        for one, other in zip(results, plain, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-13, atol=1e-15)
