"""The ranging signal, its modulator and the classical discriminator."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rail_signals.ranging.signal import RangingSignal, discriminate, modulate, tone_of, wrap_to_turn

ONE = RangingSignal()
TWO = RangingSignal(tones_hz=(375e3, 37.5e3), deviations_hz=(375e3, 37.5e3))


def test_defaults() -> None:
    assert ONE.period_samples == 32
    assert ONE.duration_s == pytest.approx(240e-6)
    assert TWO.period_samples == 320
    assert TWO.indices == (1.0, 1.0)
    assert TWO.cycles_per_period == (30, 3)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"samples": 1000}, "samples must be a multiple of 32"),
        ({"samples": 0}, "samples must be a positive integer"),
        ({"samples": 10.5}, "samples must be a positive integer"),
        ({"samples": 20}, "samples must hold whole periods"),
        ({"tones_hz": (math.nan,)}, "tones_hz must be finite"),
        ({"tones_hz": (-1.0,)}, "tones_hz must be finite and above zero"),
        ({"tones_hz": ()}, "tones_hz must hold one or two tones"),
        ({"tones_hz": (1e3, 2e3), "deviations_hz": (1e3, 1e3)}, "tones_hz must fall"),
        ({"deviations_hz": (1.0, 2.0)}, "deviations_hz must hold one value per tone"),
        ({"deviations_hz": (0.0,)}, "deviations_hz must be finite and above zero"),
        ({"sample_rate_hz": math.inf}, "sample_rate_hz must be finite"),
        ({"sample_rate_hz": 2e6}, "would alias"),
        ({"deviations_hz": (1.5e6,)}, "would alias"),
    ],
)
def test_wrong_fields_are_named(fields: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        RangingSignal(**fields)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("signal", [ONE, TWO])
def test_modulate_is_the_formula(signal: RangingSignal) -> None:
    lag = np.random.default_rng(1).uniform(0, 2 * math.pi, (2, 3, len(signal.tones_hz)))
    t = np.arange(signal.samples) / signal.sample_rate_hz
    phase = sum(
        beta * np.sin(2 * math.pi * f * t - lag[..., i, None])
        for i, (f, beta) in enumerate(zip(signal.tones_hz, signal.indices, strict=True))
    )
    bursts = modulate(signal, lag)
    assert bursts.shape == (2, 3, signal.samples)
    np.testing.assert_allclose(bursts, np.exp(1j * phase), atol=1e-10)


def test_modulate_wants_one_lag_per_tone() -> None:
    with pytest.raises(ValueError, match="phase_lag_rad must have 2 tones last"):
        modulate(TWO, [0.1])
    assert modulate(ONE, np.zeros((0, 1))).shape == (0, 960)


@given(st.floats(-20, 20), st.floats(-20, 20))
def test_discriminator_returns_the_lags(high: float, low: float) -> None:
    demodulated = discriminate(TWO, modulate(TWO, [high, low]))
    for tone, lag in enumerate((high, low)):
        error = float(tone_of(TWO, demodulated, tone)) - lag
        assert abs(math.remainder(error, 2 * math.pi)) < 1e-9


def test_discriminator_reads_deviation_and_offset() -> None:
    offset_hz = 3e3
    turn = np.exp(2j * math.pi * offset_hz * np.arange(960) / 4e6)
    demodulated = discriminate(ONE, modulate(ONE, [1.0]) * turn)
    assert demodulated.mean() == pytest.approx(offset_hz, abs=1e-6)
    # Averaged over a sample, the peak falls from 375 kHz by sinc(f / fs).
    assert np.ptp(demodulated) / 2 == pytest.approx(375e3 * np.sinc(375e3 / 4e6), rel=0.01)
    assert float(tone_of(ONE, demodulated)) == pytest.approx(1.0, abs=1e-9)


@given(st.floats(-1e6, 1e6, allow_nan=False))
def test_wrap_to_turn(phase: float) -> None:
    wrapped = float(wrap_to_turn(phase))
    assert 0 <= wrapped < 2 * math.pi
    assert abs(math.remainder(wrapped - phase, 2 * math.pi)) < 1e-9


def test_wrap_to_turn_never_returns_a_full_turn() -> None:
    assert float(wrap_to_turn(-1e-18)) == 0.0
