"""Pilots and the Wiener estimate against what theory predicts of its error."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rail_signals.train_radio.mimo_fading import MimoFading
from rail_signals.train_radio.pilot_estimation import (
    MAX_SNR,
    WienerEstimator,
    wiener_estimator,
)
from rail_signals.train_radio.pilot_pattern import PilotPattern


def normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Circular complex normals of unit variance."""
    return np.asarray(rng.normal(scale=math.sqrt(0.5), size=(*shape, 2)) @ [1, 1j])


def fields(draws: int, pattern: PilotPattern, doppler: float, receive: int = 2) -> np.ndarray:
    """Channels [draws, rx, tx, symbols] of independent fields, at a Doppler per symbol."""
    rng = np.random.default_rng(1)
    place = doppler * np.arange(pattern.symbols)
    return np.array(
        [MimoFading(rng, receive, pattern.transmit, 1.0).at(place) for _ in range(draws)]
    )


def at_pilots(pattern: PilotPattern, channel: np.ndarray, snr: float) -> np.ndarray:
    """Pilots [..., rx, pilots] as received in noise."""
    y = np.sum(channel[..., pattern.pilot_positions] * pattern.pilots, axis=-2)
    return np.asarray(y + normal(np.random.default_rng(2), *y.shape) / math.sqrt(snr))


@settings(max_examples=40)
@given(
    pairs=st.integers(1, 60),
    transmit=st.sampled_from([1, 2]),
    block=st.sampled_from([2, 4]),
    free=st.sampled_from([2, 4, 10, 14]),
)
def test_positions(pairs: int, transmit: int, block: int, free: int) -> None:
    pattern = PilotPattern(2 * pairs, transmit, block + free, block)
    data, pilots = pattern.data_positions, pattern.pilot_positions
    assert sorted([*data, *pilots]) == list(range(pattern.symbols))
    assert len(data) == 2 * pairs
    # Pairs stay together, data are enclosed and never further apart from pilots than asked.
    assert (data[1::2] == data[0::2] + 1).all()
    assert pilots[0] == 0
    assert pilots[-1] == pattern.symbols - 1
    assert np.diff(pilots).max() <= free + 1
    assert (np.diff(pilots[::block]) <= block + free).all()
    assert pattern.pilot_fraction == pytest.approx(len(pilots) / pattern.symbols)


@pytest.mark.parametrize("transmit", [1, 2])
def test_pilots_are_orthogonal_in_every_block(transmit: int) -> None:
    pattern = PilotPattern(28, transmit, period=16, block=4)
    blocks = pattern.pilots.reshape(transmit, -1, 4).swapaxes(0, 1)
    product = blocks @ blocks.swapaxes(1, 2)
    expected = np.broadcast_to(4 / transmit * np.eye(transmit), product.shape)
    np.testing.assert_allclose(product, expected, atol=1e-12)
    np.testing.assert_allclose(np.sum(pattern.pilots**2, axis=0), 1.0)


def test_insertion() -> None:
    pattern = PilotPattern(30, 2)
    data = normal(np.random.default_rng(3), 4, 2, 30)
    burst = pattern.insert(data)
    assert burst.shape == (4, 2, pattern.symbols)
    assert (burst[..., pattern.data_positions] == data).all()
    assert (burst[..., pattern.pilot_positions] == pattern.pilots).all()


@pytest.mark.parametrize("transmit", [1, 2])
def test_a_constant_channel_without_noise_is_exact(transmit: int) -> None:
    pattern = PilotPattern(56, transmit)
    h = normal(np.random.default_rng(4), 10, 2, transmit, 1).repeat(pattern.symbols, axis=-1)
    received = at_pilots(pattern, h, math.inf)
    for snr, error in ((1e3, 1e-3), (1e6, 1e-6), (1e9, 1e-6)):
        found = WienerEstimator(pattern, 0.0).estimate(received, snr)
        assert np.abs(found - h).max() < 3 * error
    assert np.abs(wiener_estimator(pattern, 0.0).estimate(received, 1e6) - h).max() < 1e-3


def test_a_constant_channel_is_averaged_over_all_pilots() -> None:
    """Least squares in the limit: error variance tx / (snr pilots)."""
    for transmit in (1, 2):
        pattern = PilotPattern(56, transmit)
        found = WienerEstimator(pattern, 0.0).error_variance(1e4)
        expected = transmit / (1e4 * len(pattern.pilot_positions))
        np.testing.assert_allclose(found, expected, rtol=1e-3)


@pytest.mark.parametrize("transmit", [1, 2])
@pytest.mark.parametrize(("doppler", "snr"), [(0.00667, 3.0), (0.00667, 100.0), (0.02, 10.0)])
def test_the_error_is_as_predicted(transmit: int, doppler: float, snr: float) -> None:
    pattern = PilotPattern(70, transmit)
    estimator = WienerEstimator(pattern, doppler)
    h = fields(400, pattern, doppler)
    found = estimator.estimate(at_pilots(pattern, h, snr), snr)
    error = np.mean(np.abs(found - h) ** 2, axis=(0, 1))
    predicted = estimator.error_variance(snr)
    # 800 draws: 4 % per symbol, and symbols within a coherence time err alike.
    assert error.mean() == pytest.approx(predicted.mean(), rel=0.05)
    np.testing.assert_allclose(error, predicted, rtol=0.15)


def test_a_wrong_doppler_costs_more_when_it_is_too_low() -> None:
    doppler, snr = 0.00667, 30.0
    pattern = PilotPattern(84)
    h = fields(300, pattern, doppler)
    received = at_pilots(pattern, h, snr)

    def error(assumed: float) -> float:
        found = WienerEstimator(pattern, assumed).estimate(received, snr)
        return float(np.mean(np.abs(found - h) ** 2))

    best = error(doppler)
    # The bins of the cache reach 19 % up.
    assert best < error(1.19 * doppler) < 1.15 * best
    assert best < error(2 * doppler) < 2 * best < error(doppler / 2) < 4 * best
    assert error(0.0) > 10 * best
    # Never worse than knowing nothing: the estimate shrinks.
    assert error(0.3) < 1


def test_the_cache_rounds_up_and_returns_the_same() -> None:
    pattern = PilotPattern(84)
    for doppler in (1e-6, 1e-4, 0.00667, 0.03):
        found = wiener_estimator(pattern, doppler)
        assert doppler * (1 - 1e-9) <= found.doppler_per_symbol <= 1.19 * doppler
        assert wiener_estimator(PilotPattern(84), found.doppler_per_symbol) is found
    assert wiener_estimator(pattern, 0.0) is wiener_estimator(pattern, 1e-7)


@pytest.mark.parametrize("transmit", [1, 2])
@pytest.mark.parametrize("snr", [1.0, 10.0, 1000.0])
def test_the_level_is_told_from_the_pilots(transmit: int, snr: float) -> None:
    pattern = PilotPattern(98, transmit)
    received = 0.01 * at_pilots(pattern, fields(300, pattern, 0.00667), snr)
    level = WienerEstimator(pattern, 0.00667).level(received)
    assert np.mean(level.noise_variance) == pytest.approx(1e-4 / snr, rel=0.05)
    # One burst holds few independent fades: its own power scatters by some decibels.
    assert abs(np.median(10 * np.log10(level.snr / snr))) < 1.0
    assert np.median(level.evidence) > (3 if snr == 1 else 15)


@pytest.mark.parametrize(("receive", "transmit", "doppler"), [(1, 1, 0.02), (2, 2, 0.00667)])
def test_noise_is_rarely_evident(receive: int, transmit: int, doppler: float) -> None:
    pattern = PilotPattern(84, transmit)
    noise = normal(np.random.default_rng(5), 30_000, receive, len(pattern.pilot_positions))
    evidence = WienerEstimator(pattern, doppler).level(1e-3 * noise).evidence
    for t in (1.0, 3.0, 5.0):
        assert 0.02 * math.exp(-t) < np.mean(evidence >= t) < 0.5 * math.exp(-t)


def test_silence_has_no_evidence_and_no_noise_the_ceiling() -> None:
    pattern = PilotPattern(28, 1)
    estimator = WienerEstimator(pattern, 0.001)
    level = estimator.level(np.zeros((3, 1, len(pattern.pilot_positions))))
    assert level.evidence.tolist() == [0.0] * 3
    assert level.noise_variance.tolist() == [0.0] * 3
    assert float(WienerEstimator(pattern, 0.0).level(pattern.pilots).snr) == MAX_SNR


def test_a_burst_does_not_depend_on_the_others() -> None:
    pattern = PilotPattern(42)
    estimator = WienerEstimator(pattern, 0.01)
    received = at_pilots(pattern, fields(20, pattern, 0.01), 5.0)
    level = estimator.level(received)
    whole = estimator.estimate(received, level.snr)
    for i in range(20):
        single = estimator.level(received[i])
        assert single.snr == level.snr[i]
        assert single.noise_variance == level.noise_variance[i]
        assert np.array_equal(estimator.estimate(received[i], single.snr), whole[i])
    assert estimator.estimate(received[:0], level.snr[:0]).shape == (0, 2, 2, pattern.symbols)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: PilotPattern(0), "0"),
        (lambda: PilotPattern(7, 2), "7"),
        (lambda: PilotPattern(8, 3), "3"),
        (lambda: PilotPattern(8, 2, 15), "15"),
        (lambda: PilotPattern(8, 2, 2), "2"),
        (lambda: PilotPattern(8, 2, 16, 3), "3"),
        (lambda: PilotPattern(8).insert(np.zeros((1, 8))), "(1, 8)"),
        (lambda: WienerEstimator(PilotPattern(8), -0.1), "-0.1"),
        (lambda: wiener_estimator(PilotPattern(8), math.nan), "nan"),
        (lambda: wiener_estimator(PilotPattern(8), 0.4), "0.4"),
        (lambda: wiener_estimator(PilotPattern(8), 0.0).estimate(np.zeros((2, 3)), 1.0), "(2, 3)"),
        (lambda: wiener_estimator(PilotPattern(8), 0.0).estimate(np.zeros((2, 4)), -1.0), "-1.0"),
    ],
)
def test_bad_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(
        ValueError, match=re.escape(f"got {message}" if message[0] != "(" else message)
    ):
        call()  # type: ignore[operator]
