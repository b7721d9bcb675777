"""The compiled receiver beside the same steps in NumPy and beside its own plain form."""

from __future__ import annotations

import numpy as np
import pytest

from rail_signals.ranging import receiver as receiver_module
from rail_signals.ranging.burst_kernel import estimate_bursts
from rail_signals.ranging.offset_search import slepian_sequences
from rail_signals.ranging.receiver import MAX_SNR, MAX_SNR_SINGLE, FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from tests.rail_signals.ranging.plain_receiver import plain_estimate

TWO = {"tones_hz": (375e3, 37.5e3), "deviations_hz": (375e3, 37.5e3)}
# Signal, largest offset, segments of the search, and what tapers leave out.
CASES = {
    "few segments": (RangingSignal(), 5e3, 5, 1e-9),
    "no search": (RangingSignal(), 0.0, 0, 1e-9),
    "even segments": (RangingSignal(samples=320), 5e3, 2, 1e-9),
    "odd periods": (RangingSignal(samples=480), 5e3, 3, 1e-9),
    "odd periods, many segments": (RangingSignal(samples=864), 5e3, 9, 1e-9),
    "two tones": (RangingSignal(**TWO), 5e3, 3, 1e-9),  # type: ignore[arg-type]
    "many segments": (RangingSignal(samples=3968), 5e3, 31, 1e-9),
    "tapers": (RangingSignal(samples=3968), 1e3, 124, 1e-4),
    "tapers, odd periods": (RangingSignal(samples=4000), 1e3, 125, 1e-4),
}


def noisy(signal: RangingSignal, offset_hz: float, count: int) -> np.ndarray:
    rng = np.random.default_rng(8)
    bursts = modulate(signal, rng.uniform(0, 6, (count, len(signal.tones_hz))))
    bursts *= np.exp(2j * np.pi * offset_hz / signal.sample_rate_hz * np.arange(signal.samples))
    return bursts + rng.normal(scale=0.2, size=(*bursts.shape, 2)).view(np.complex128)[..., 0]


@pytest.mark.parametrize("precision", [np.complex64, np.complex128])
@pytest.mark.parametrize("case", CASES)
def test_estimates_are_those_of_numpy(case: str, precision: type) -> None:
    signal, max_offset_hz, segments, close = CASES[case]
    ceiling = MAX_SNR_SINGLE if precision == np.complex64 else MAX_SNR
    bursts = noisy(signal, 0.7 * max_offset_hz, 5).astype(precision)
    found = FmToneReceiver(signal, max_offset_hz=max_offset_hz).estimate(bursts)
    assert found.detected.all()
    close = max(close, 1e-4 if precision == np.complex64 else 0.0)
    for i, burst in enumerate(bursts):
        plain = plain_estimate(signal, burst, max_offset_hz, segments, ceiling)
        for name, wanted in plain.items():
            np.testing.assert_allclose(
                getattr(found, name)[i], wanted, rtol=close, atol=close, err_msg=name
            )


@pytest.mark.parametrize("case", ["few segments", "two tones", "tapers"])
def test_compiled_is_the_plain_form(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    signal, max_offset_hz, _, _ = CASES[case]
    bursts = noisy(signal, 0.5 * max_offset_hz, 2)
    receiver = FmToneReceiver(signal, max_offset_hz=max_offset_hz)
    compiled = receiver.estimate(bursts)
    plain = estimate_bursts.py_func  # type: ignore[attr-defined]
    monkeypatch.setattr(receiver_module, "estimate_bursts", plain)
    again = receiver.estimate(bursts)
    np.testing.assert_allclose(again.phase_lag_rad, compiled.phase_lag_rad, rtol=1e-12)
    np.testing.assert_allclose(again.snr, compiled.snr, rtol=1e-12)


@pytest.mark.parametrize("count", [124, 125, 4096 // 32])
def test_sequences_are_even_and_odd_in_turn(count: int) -> None:
    sequences = slepian_sequences(count, 4.0 / count, 1e-9)
    np.testing.assert_allclose(sequences @ sequences.T, np.eye(len(sequences)), atol=1e-12)
    signs = (-1.0) ** np.arange(len(sequences))[:, None]
    np.testing.assert_allclose(sequences[:, ::-1], signs * sequences, atol=1e-12)
    # They are those of the sinc kernel too: each keeps its shape under the low pass.
    index = np.arange(count)
    passed = sequences @ (8.0 / count * np.sinc(8.0 / count * (index[:, None] - index)))
    kept = np.sum(passed * sequences, axis=1)
    assert np.all(np.diff(kept) < 1e-12)
    np.testing.assert_allclose(passed, kept[:, None] * sequences, atol=1e-10)
