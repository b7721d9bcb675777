"""What the line receiver does beside estimating phases, and with input that is none."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.ranging.receiver import MAX_SNR, FmToneReceiver, ToneEstimate
from rail_signals.ranging.signal import RangingSignal, modulate

ONE = RangingSignal()
TWO = RangingSignal(tones_hz=(375e3, 37.5e3), deviations_hz=(375e3, 37.5e3))
RECEIVERS = {1: FmToneReceiver(ONE), 2: FmToneReceiver(TWO)}


def noise(rng: np.random.Generator, shape: tuple[int, ...], db: float = 0.0) -> np.ndarray:
    """Complex white noise, `db` below unit power."""
    scale = math.sqrt(0.5) * 10 ** (-db / 20)
    return rng.normal(scale=scale, size=(*shape, 2)).view(np.complex128)[..., 0]


@given(
    st.sampled_from([1, 2]),
    st.floats(-10, 10),
    st.floats(-10, 10),
    st.floats(-5e3, 5e3),
    st.floats(1e-6, 1e6),
    st.floats(-4, 4),
)
def test_noiseless_bursts(
    tones: int, high: float, low: float, offset_hz: float, amplitude: float, start: float
) -> None:
    receiver = RECEIVERS[tones]
    lag = [high, low][:tones]
    turn = np.exp(1j * (2 * math.pi * offset_hz / 4e6 * np.arange(960) + start))
    found = receiver.estimate(modulate(receiver.signal, lag) * turn * amplitude)
    assert found.detected
    assert found.phase_lag_rad.shape == (tones,)
    for estimate, true in zip(found.phase_lag_rad, lag, strict=True):
        assert 0 <= estimate < 2 * math.pi
        assert abs(math.remainder(estimate - true, 2 * math.pi)) < 1e-4
    assert float(found.frequency_offset_hz) == pytest.approx(offset_hz, abs=0.5)
    assert float(found.amplitude) == pytest.approx(amplitude, rel=1e-4)
    assert 1e6 < found.snr <= MAX_SNR * (1 + 1e-9)


@pytest.mark.parametrize("max_offset_hz", [0.0, 5e3])
def test_false_alarms_are_as_rare_as_asked(max_offset_hz: float) -> None:
    rng = np.random.default_rng(30)
    trials, rate = 20_000, 1e-2
    signal = RangingSignal(samples=320)
    receiver = FmToneReceiver(signal, max_offset_hz=max_offset_hz, false_alarm=rate)
    strict = FmToneReceiver(signal, max_offset_hz=max_offset_hz)
    bursts = noise(rng, (trials, 320), db=17.0)
    alarms = receiver.estimate(bursts).detected.mean()
    spread = math.sqrt(rate / trials)
    # Exact without a search; with one, the threshold is a bound on the maximum.
    assert (0.4 if max_offset_hz else 1 - 4 * spread / rate) * rate < alarms
    assert alarms < rate + 4 * spread
    assert not strict.estimate(bursts).detected.any()


def test_detection_reaches_far_below_the_noise() -> None:
    rng = np.random.default_rng(31)
    bursts = modulate(ONE, rng.uniform(0, 6, (500, 1)))
    weak = RECEIVERS[1].estimate(bursts + noise(rng, bursts.shape, db=-10.0))
    assert weak.detected.all()
    lost = RECEIVERS[1].estimate(bursts + noise(rng, bursts.shape, db=-25.0))
    assert lost.detected.mean() < 0.05


def test_what_is_not_detected_has_no_phase() -> None:
    found = RECEIVERS[2].estimate(noise(np.random.default_rng(32), (5, 960)))
    assert not found.detected.any()
    assert np.isnan(found.phase_lag_rad).all()
    assert np.isnan(found.frequency_offset_hz).all()
    assert np.isinf(found.variance_rad2).all()
    assert (found.snr == 0).all()
    assert (found.amplitude == 0).all()


@pytest.mark.parametrize("tones", [1, 2])
def test_silence_and_rubbish_are_not_detected(tones: int) -> None:
    receiver = RECEIVERS[tones]
    good = modulate(receiver.signal, np.ones((7, tones)))
    bad = good.copy()
    bad[0] = 0
    bad[1, 100] = math.nan
    bad[2, 959] = math.inf
    bad[3] = 1e-200
    bad[4] *= 1e200
    bad[5] = np.where(np.arange(960) % 2, 1.0, -1.0)  # all energy off the lines
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = receiver.estimate(bad)
    assert found.detected.tolist() == [False] * 6 + [True]
    assert np.isnan(found.phase_lag_rad[:6]).all()
    same_bits(found, receiver.estimate(good), 6, 6)


@pytest.mark.parametrize("shape", [(0,), (3, 0, 2), (), (1,), (2, 3)])
def test_leading_axes(shape: tuple[int, ...]) -> None:
    lag = np.full((*shape, 2), 1.5)
    found = RECEIVERS[2].estimate(modulate(TWO, lag))
    for name, value in found._asdict().items():
        per_tone = name in ("phase_lag_rad", "variance_rad2")
        assert value.shape == (*shape, 2) if per_tone else value.shape == shape
    np.testing.assert_allclose(found.phase_lag_rad, lag, atol=1e-4)


def same_bits(left: ToneEstimate, right: ToneEstimate, i: int, j: int) -> None:
    for name, ours, theirs in zip(ToneEstimate._fields, left, right, strict=True):
        assert ours[i].tobytes() == theirs[j].tobytes(), name


@pytest.mark.parametrize("signal", [ONE, TWO, RangingSignal(samples=3968)])
@pytest.mark.parametrize("max_offset_hz", [0.0, 1e3, 5e3])
@pytest.mark.parametrize("precision", [np.complex64, np.complex128])
def test_result_does_not_depend_on_the_batch(
    signal: RangingSignal, max_offset_hz: float, precision: type
) -> None:
    rng = np.random.default_rng(33)
    receiver = FmToneReceiver(signal, max_offset_hz=max_offset_hz)
    bursts = modulate(signal, rng.uniform(0, 6, (50, len(signal.tones_hz))))
    bursts = (bursts + noise(rng, bursts.shape, db=-3.0)).astype(precision)
    whole = receiver.estimate(bursts)
    strided = receiver.estimate(np.repeat(bursts, 2, axis=0)[::2])
    for i in range(50):
        single = receiver.estimate(bursts[i : i + 1])
        # A copy at another address: alignment must not matter either.
        shifted = np.empty(signal.samples + 1, dtype=precision)[1:]
        shifted[:] = bursts[i]
        same_bits(whole, single, i, 0)
        same_bits(whole, receiver.estimate(shifted[None]), i, 0)
        same_bits(whole, strided, i, i)


def test_single_precision_is_good_to_60_db() -> None:
    rng = np.random.default_rng(36)
    signal = RangingSignal(samples=3968)
    receiver = FmToneReceiver(signal)
    lag = rng.uniform(0, 2 * math.pi, (1000, 1))
    bursts = modulate(signal, lag)
    bursts *= np.exp(2j * math.pi * 4321.0 / 4e6 * np.arange(signal.samples))
    bursts += noise(rng, bursts.shape, db=55.0)
    found = receiver.estimate(bursts.astype(np.complex64))
    error = np.angle(np.exp(1j * (found.phase_lag_rad - lag)))
    assert np.sqrt(np.mean(error**2) * 10**5.5 * 3968) == pytest.approx(1.0, abs=0.05)
    assert found.snr.mean() == pytest.approx(10**5.5, rel=0.1)


def test_two_signals_show_in_the_misfit() -> None:
    rng = np.random.default_rng(34)
    one = modulate(ONE, rng.uniform(0, 2 * math.pi, (300, 1)))
    other = modulate(ONE, rng.uniform(0, 2 * math.pi, (300, 1)))
    turn = np.exp(1j * rng.uniform(0, 2 * math.pi, (300, 1)))
    disturbance = noise(rng, one.shape, db=10.0)
    alone = RECEIVERS[1].estimate(one + disturbance)
    both = RECEIVERS[1].estimate(one + 0.7 * turn * other + disturbance)
    jammed = RECEIVERS[1].estimate(one + 2.0 + disturbance)
    assert alone.reduced_chi_square.mean() == pytest.approx(1.0, abs=0.1)
    # 9 real degrees of freedom: less than one clean burst in 10 000 passes 4.
    assert alone.reduced_chi_square.max() < 4
    assert np.mean(both.reduced_chi_square > 4) > 0.9
    assert (jammed.reduced_chi_square > 4).all()


def test_wrong_parameters() -> None:
    with pytest.raises(ValueError, match="max_offset_hz must be finite"):
        FmToneReceiver(ONE, max_offset_hz=-1.0)
    with pytest.raises(ValueError, match="max_offset_hz must stay below 5625 Hz"):
        FmToneReceiver(TWO, max_offset_hz=6e3)
    with pytest.raises(ValueError, match="false_alarm must lie between"):
        FmToneReceiver(ONE, false_alarm=0.0)
    with pytest.raises(ValueError, match="samples must hold two periods"):
        FmToneReceiver(RangingSignal(samples=32))
    with pytest.raises(ValueError, match="bursts must have 960 samples"):
        RECEIVERS[1].estimate(np.zeros((2, 959)))
