"""The closed forms give the published numbers and agree with one another."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.train_radio.ber.closed_form import (
    ALAMOUTI_2X1,
    ALAMOUTI_2X2,
    MRC_1X2,
    SCHEMES,
    SISO,
    awgn_error_rate,
    block_fading_frame_loss,
    conditional_error_rate,
    eb_n0_of_error_rate,
    error_rate,
    frame_loss,
    gain_db,
    mean_messages_until_losses,
    rician_error_rate,
)
from rail_signals.train_radio.ber.stale_channel import jakes_correlation, stale_error_rate
from rail_signals.train_radio.space_time_block import Scheme

LEVELS = 10 ** (np.arange(0, 21, 5) / 10)
ALL = pytest.mark.parametrize("scheme", SCHEMES.values(), ids=SCHEMES)


@pytest.mark.parametrize(
    ("scheme", "expected"),
    [
        (MRC_1X2, [5.81e-2, 1.18e-2, 1.60e-3, 1.78e-4, 1.84e-5]),
        (ALAMOUTI_2X2, [4.03e-2, 3.72e-3, 1.13e-4, 1.75e-6, 2.04e-8]),
    ],
    ids=["mrc_1x2", "alamouti_2x2"],
)
def test_the_curves_of_fig_3(scheme: Scheme, expected: list[float]) -> None:
    found = error_rate(scheme, LEVELS, bits_per_symbol=1)
    assert [f"{p:.2e}" for p in found] == [f"{p:.2e}" for p in expected]
    assert (found == error_rate(scheme, LEVELS, bits_per_symbol=2)).all()


def test_gain_of_four_branches_over_two() -> None:
    gains = [round(gain_db(ALAMOUTI_2X2, MRC_1X2, rate), 2) for rate in (1e-3, 1e-4, 1e-5)]
    assert gains == [4.05, 6.12, 8.36]


def test_two_transmitters_cost_three_decibels_against_two_receivers() -> None:
    assert gain_db(MRC_1X2, ALAMOUTI_2X1, 1e-4) == pytest.approx(10 * math.log10(2))


@ALL
@pytest.mark.parametrize("bits", [1, 2, 4])
def test_without_a_constant_part_rician_is_rayleigh(scheme: Scheme, bits: int) -> None:
    assert rician_error_rate(scheme, LEVELS, 0.0, bits) == pytest.approx(
        error_rate(scheme, LEVELS, bits), rel=1e-12
    )


@ALL
def test_a_strong_constant_part_leaves_noise_only(scheme: Scheme) -> None:
    level = 10**0.5
    limit = awgn_error_rate(scheme, level)
    assert rician_error_rate(scheme, level, math.inf) == limit
    assert rician_error_rate(scheme, level, 1e6) == pytest.approx(limit, rel=1e-3)
    rates = [float(rician_error_rate(scheme, level, k)) for k in (0, 1, 10, 100)]
    assert rates == sorted(rates, reverse=True)


@ALL
@pytest.mark.parametrize("bits", [1, 4])
def test_rayleigh_is_the_mean_over_gamma_distributed_gain(scheme: Scheme, bits: int) -> None:
    gain = np.random.default_rng(3).gamma(scheme.diversity, size=200_000)
    sample = conditional_error_rate(10 / scheme.transmit * gain, bits)
    assert sample.mean() == pytest.approx(
        float(error_rate(scheme, 10.0, bits)), abs=5 * sample.std() / math.sqrt(gain.size)
    )


@ALL
def test_the_inverse_gives_the_rate_back(scheme: Scheme) -> None:
    for rate in (0.1, 1e-3, 1e-8):
        level = eb_n0_of_error_rate(scheme, rate)
        assert error_rate(scheme, level) == pytest.approx(rate, rel=1e-6)


def test_hours_between_spurious_brakings() -> None:
    hours = mean_messages_until_losses([0.1, 0.2, 0.3], 6) * 0.5 / 3600
    assert hours.round(2).tolist() == [154.32, 2.71, 0.27]


def test_messages_until_losses_by_counting() -> None:
    lost = np.random.default_rng(5).random(400_000) < 0.4
    run, ends = 0, []
    last = 0
    for k, bad in enumerate(lost.tolist(), start=1):
        run = run + 1 if bad else 0
        if run == 3:
            ends.append(k - last)
            run, last = 0, k
    error = 5 * np.std(ends) / math.sqrt(len(ends))
    assert np.mean(ends) == pytest.approx(float(mean_messages_until_losses(0.4, 3)), abs=error)


@ALL
def test_a_frame_of_one_bit_is_the_bit_error_rate(scheme: Scheme) -> None:
    assert block_fading_frame_loss(scheme, LEVELS, 1) == pytest.approx(
        error_rate(scheme, LEVELS), rel=1e-10
    )


@ALL
def test_errors_that_come_together_spoil_fewer_frames(scheme: Scheme) -> None:
    together = block_fading_frame_loss(scheme, LEVELS, 400)
    assert (together < frame_loss(error_rate(scheme, LEVELS), 400)).all()
    # SISO at high level: a frame is lost in a fade below one depth, whatever the level.
    far = block_fading_frame_loss(SISO, [1e6, 1e7], 400)
    assert far[0] / far[1] == pytest.approx(10, rel=1e-3)


def test_frame_loss_of_independent_bits() -> None:
    assert frame_loss(1e-12, 100) == pytest.approx(1e-10)
    assert frame_loss(0.5, 2) == 0.75


@pytest.mark.parametrize(("interval_s", "expected"), [(10e-6, -30.6), (66.7e-6, -14.1)])
def test_what_a_constant_channel_neglects(interval_s: float, expected: float) -> None:
    rho = jakes_correlation(300 / 3.6, 2.4e9, interval_s)
    assert round(10 * math.log10(2 * (1 - rho)), 1) == expected


@ALL
@pytest.mark.parametrize("bits", [1, 2])
def test_a_constant_channel_has_no_floor(scheme: Scheme, bits: int) -> None:
    assert stale_error_rate(scheme, LEVELS, 1.0, bits) == pytest.approx(
        error_rate(scheme, LEVELS, bits), rel=1e-11
    )
    assert stale_error_rate(scheme, math.inf, 1.0, bits) == 0


def test_the_floor_of_one_antenna_in_closed_form() -> None:
    # Only the second symbol suffers; BPSK by two correlated Gaussian channels: (1 - rho) / 4.
    for rho in (0.5, 0.9, 0.98):
        floor = stale_error_rate(SISO, math.inf, rho, bits_per_symbol=1)
        assert floor == pytest.approx((1 - rho) / 4, rel=1e-10)


@ALL
def test_the_floor_rises_with_speed_and_is_reached(scheme: Scheme) -> None:
    floors = []
    for speed_kmh in (100, 300, 500):
        rho = jakes_correlation(speed_kmh / 3.6, 2.4e9, 66.7e-6)
        floors.append(float(stale_error_rate(scheme, math.inf, rho)))
        assert stale_error_rate(scheme, 1e8, rho) == pytest.approx(floors[-1], rel=1e-2)
    assert floors == sorted(floors)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Scheme("x", 3, 1), "got 3"),
        (lambda: error_rate(SISO, -1.0), "got -1.0"),
        (lambda: error_rate(SISO, 1.0, 3), "got 3"),
        (lambda: rician_error_rate(SISO, 1.0, -2.0), "got -2.0"),
        (lambda: eb_n0_of_error_rate(SISO, 0.6), "got 0.6"),
        (lambda: block_fading_frame_loss(SISO, 1.0, 0), "got 0"),
        (lambda: mean_messages_until_losses(1.5, 3), r"got 1\.5"),
        (lambda: stale_error_rate(SISO, 1.0, 0.0), r"got 0\.0"),
        (lambda: stale_error_rate(SISO, 1.0, 0.5, 4), "got 4"),
        (lambda: stale_error_rate(SISO, 0.0, 0.5), r"got 0\.0"),
    ],
)
def test_a_bad_value_is_quoted(call: object, message: str) -> None:
    assert callable(call)
    with pytest.raises(ValueError, match=message):
        call()
