"""The two-way chain: station, medium, transponder, medium, station."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.delay import fractional_delay
from rail_signals.ranging.bounds import two_way_range_variance_bound
from rail_signals.ranging.phase_range import phase_to_range_m, range_to_phase_rad, two_tone_range_m
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_signals.ranging.transponder import calibrate_delay, transpond

ONE = RangingSignal()
TWO = RangingSignal(tones_hz=(375e3, 37.5e3), deviations_hz=(375e3, 37.5e3))
DELAY_S = 1.234e-6


def link(
    rng: np.random.Generator, bursts: np.ndarray, range_m: np.ndarray, snr: float
) -> np.ndarray:
    """One way over the air: delay, an arbitrary carrier phase and offset, noise."""
    samples = bursts.shape[-1]
    out = fractional_delay(bursts, range_m / SPEED_OF_LIGHT_M_PER_S, 4e6)
    turn = rng.uniform(-3e3, 3e3, (len(out), 1)) / 4e6 * np.arange(samples)
    out *= np.exp(2j * math.pi * (turn + rng.uniform(size=(len(out), 1))))
    shape = (*out.shape, 2)
    return out + rng.normal(scale=math.sqrt(0.5 / snr), size=shape).view(np.complex128)[..., 0]


@pytest.mark.parametrize(("down_db", "up_db"), [(-6.0, -3.0), (20.0, 10.0)])
def test_chain_is_within_a_tenth_of_its_bound(down_db: float, up_db: float) -> None:
    rng = np.random.default_rng(40)
    receiver = FmToneReceiver(ONE)
    range_m = rng.uniform(0, 350, 1500)
    down, up = 10 ** (down_db / 10), 10 ** (up_db / 10)
    sent = np.broadcast_to(modulate(ONE, [0.0]), (1500, 960))
    heard = receiver.estimate(link(rng, sent, range_m, down))
    found = receiver.estimate(link(rng, transpond(heard, ONE, DELAY_S), range_m, up))
    assert found.detected.all()
    error_m = phase_to_range_m(found.phase_lag_rad[:, 0], 375e3, delay_s=DELAY_S) - range_m
    bound_m2 = float(two_way_range_variance_bound(down, up, 960, 1.0, 375e3))
    assert 0.93 < np.sqrt(np.mean(error_m**2) / bound_m2) < 1.1
    # What the station can know: its own variance and the one of the vehicle.
    claimed = (heard.variance_rad2 + found.variance_rad2).mean()
    assert claimed * (SPEED_OF_LIGHT_M_PER_S / (4 * math.pi * 375e3)) ** 2 == pytest.approx(
        bound_m2, rel=0.05
    )


def test_zones_of_two_kilometres() -> None:
    rng = np.random.default_rng(41)
    receiver = FmToneReceiver(TWO)
    range_m = rng.uniform(0, 2000, 400)
    sent = np.broadcast_to(modulate(TWO, [0.0, 0.0]), (400, 960))
    heard = receiver.estimate(link(rng, sent, range_m, 3.0))
    found = receiver.estimate(link(rng, transpond(heard, TWO, DELAY_S), range_m, 3.0))
    variance = heard.variance_rad2 + found.variance_rad2
    ranged, variance_m2, resolved = two_tone_range_m(
        found.phase_lag_rad, variance, TWO.tones_hz, delay_s=DELAY_S
    )
    assert resolved.all()
    error = (ranged - range_m) / np.sqrt(variance_m2)
    assert abs(error).max() < 5
    assert error.std() == pytest.approx(1.0, abs=0.1)


def test_silence_is_answered_by_silence() -> None:
    bursts = np.zeros((2, 960), dtype=complex)
    bursts[1] = modulate(ONE, [1.0])
    reply = transpond(FmToneReceiver(ONE).estimate(bursts), ONE, DELAY_S)
    assert not reply[0].any()
    lag = 1.0 + 2 * math.pi * 375e3 * DELAY_S
    np.testing.assert_allclose(reply[1], modulate(ONE, [lag]), atol=1e-4)
    alone = transpond(FmToneReceiver(ONE).estimate(bursts[0]), ONE, DELAY_S)
    assert alone.shape == (960,)
    assert not alone.any()


@pytest.mark.parametrize(("signal", "nominal_s"), [(ONE, 1e-6), (TWO, 0.0)])
def test_calibration(signal: RangingSignal, nominal_s: float) -> None:
    rng = np.random.default_rng(42)
    tones = len(signal.tones_hz)
    variance = np.broadcast_to([4e-4, 9e-4][:tones], (200, tones))
    lag = [float(range_to_phase_rad(10.0, f, delay_s=DELAY_S)) for f in signal.tones_hz]
    standardised = []
    for _ in range(200):
        bench = lag + rng.normal(size=variance.shape) * np.sqrt(variance)
        delay_s, variance_s2 = calibrate_delay(
            bench, variance, 10.0, signal.tones_hz, nominal_delay_s=nominal_s
        )
        standardised.append((delay_s - DELAY_S) / math.sqrt(variance_s2))
    assert np.std(standardised) == pytest.approx(1.0, abs=0.15)
    assert abs(np.mean(standardised)) < 0.3
    # 200 bursts of 20 mrad leave 9 cm.
    assert SPEED_OF_LIGHT_M_PER_S / 2 * math.sqrt(variance_s2) == pytest.approx(0.09, abs=0.005)


def test_calibration_refuses_what_it_cannot_use() -> None:
    with pytest.raises(ValueError, match="finite and not empty"):
        calibrate_delay([math.nan], [1e-4], 10.0, (375e3,))
    with pytest.raises(ValueError, match="finite and not empty"):
        calibrate_delay(np.zeros((0, 1)), np.zeros((0, 1)), 10.0, (375e3,))
    with pytest.raises(ValueError, match="variance_rad2 must be above zero"):
        calibrate_delay([1.0], [0.0], 10.0, (375e3,))
    with pytest.raises(ValueError, match=r"must be \[bursts, 1\]"):
        calibrate_delay([1.0, 2.0], [1e-4, 1e-4], 10.0, (375e3,))
