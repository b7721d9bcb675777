"""The compiled parts of the fast receiver beside SciPy and beside their own pure forms."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import signal

from rail_signals.single_precision import angle
from rail_signals.track_code import block_demodulator, receiver
from rail_signals.track_code.block_demodulator import BlockDemodulator
from rail_signals.track_code.demodulator import DemodulatorChain
from rail_signals.track_code.hop_kernel import _decimate, _filter_band, _filter_sections
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.receiver import TrackCodeReceiver
from rail_signals.track_code.reference_receiver import LOUDEST, input_fault
from rail_signals.track_code.signal import FmTransmitter

PROFILE = load_profile("three_tones")
RATE_HZ, CARRIER_HZ, FRAME = 6400.0, 2000.0, 800


def noisy(hops: int, kind: type[np.floating] = np.float32) -> np.ndarray:
    """A word in noise [hops, frame]."""
    bits = np.array([True] + [False] * (PROFILE.tones - 1))
    wave = FmTransmitter(PROFILE, CARRIER_HZ, RATE_HZ).block(bits, hops * FRAME)
    wave += np.random.default_rng(1).normal(scale=0.1, size=wave.size)
    return wave.reshape(hops, FRAME).astype(kind)


def demodulator() -> BlockDemodulator:
    return BlockDemodulator(DemodulatorChain(PROFILE, CARRIER_HZ, RATE_HZ), 8)


def test_a_hop_is_the_same_in_any_batch() -> None:
    frames = noisy(5)
    frames[2] = np.nan
    whole = demodulator().demodulate(frames)
    one = demodulator()
    for k, frame in enumerate(frames):
        for found, wanted in zip(one.demodulate(frame[None]), whole, strict=True):
            np.testing.assert_array_equal(found[0], wanted[k])


def test_double_precision_is_rounded_once() -> None:
    frames = noisy(2, np.float64)
    found = demodulator().demodulate(frames)
    rounded = demodulator().demodulate(frames.astype(np.float32))
    for a, b in zip(found, rounded, strict=True):
        np.testing.assert_array_equal(a, b)


def test_demodulation_is_its_pure_form(monkeypatch: pytest.MonkeyPatch) -> None:
    frames = noisy(2)
    compiled = demodulator().demodulate(frames)
    pure: Any = block_demodulator.demodulate_hops
    monkeypatch.setattr(block_demodulator, "demodulate_hops", pure.py_func)
    for found, wanted in zip(demodulator().demodulate(frames), compiled, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-6)


def test_measurement_is_its_pure_form(monkeypatch: pytest.MonkeyPatch) -> None:
    wave = noisy(24).ravel()
    compiled = TrackCodeReceiver(PROFILE, CARRIER_HZ, RATE_HZ).feed(wave)
    assert compiled[-1].valid
    pure: Any = receiver.measure_slots
    monkeypatch.setattr(receiver, "measure_slots", pure.py_func)
    again = TrackCodeReceiver(PROFILE, CARRIER_HZ, RATE_HZ).feed(wave)
    for a, b in zip(again, compiled, strict=True):
        np.testing.assert_allclose(a.levels, b.levels, rtol=1e-6)
        assert (a.valid, a.fields, a.reason) == (b.valid, b.fields, b.reason)


def test_filters_are_those_of_scipy() -> None:
    rng = np.random.default_rng(2)
    taps, wave = rng.normal(size=(2, 64)), rng.normal(size=(2, 64 + 39))
    single = [np.ascontiguousarray(row) for row in wave.astype(np.float32)]
    backwards = [np.ascontiguousarray(row) for row in taps[:, ::-1].astype(np.float32)]
    wanted = np.convolve(wave[0] + 1j * wave[1], taps[0] + 1j * taps[1], mode="valid")
    out = np.ones((2, 41), np.float32)
    power = _filter_band(*single, *backwards, out[0], out[1])
    np.testing.assert_allclose(out[:, 1:], [wanted.real, wanted.imag], atol=2e-5)
    assert out[:, 0].tolist() == [1.0, 1.0]
    assert power == pytest.approx(np.sum(np.abs(wanted) ** 2), rel=1e-5)

    every = np.convolve(wave[0], taps[0] + 1j * taps[1], mode="valid")[::10]
    out = np.empty((2, 4), np.float32)
    _decimate(single[0], *backwards, 10, out[0], out[1])
    np.testing.assert_allclose(out, [every.real, every.imag], atol=2e-5)


def test_sections_are_those_of_scipy_to_the_last_digits() -> None:
    sections = signal.ellip(5, 0.1, 60.0, 0.3, output="sos")
    samples = np.random.default_rng(3).normal(size=60).astype(np.float32)
    wanted = signal.sosfilt(sections, samples.astype(np.float64))
    state, out = np.zeros((len(sections), 2)), np.empty((2, 15))
    for hop in range(2):
        _filter_sections(samples[30 * hop : 30 * hop + 30], sections, state, out, hop)
    np.testing.assert_allclose(out.ravel(), wanted[1::2], rtol=1e-12)


def test_angles_are_those_of_the_arc_tangent() -> None:
    turns = np.linspace(-0.5, 0.5, 257)
    for radius in (1e-6, 1.0, 1e6):
        for x, y in zip(np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns), strict=True):
            re, im = np.float32(radius * x), np.float32(radius * y)
            assert angle(re, im) == pytest.approx(np.arctan2(im, re), abs=5e-7)
    assert angle(np.float32(0.0), np.float32(0.0)) == 0.0


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_hops_at_fault_are_those_of_the_plain_check(kind: type[np.floating]) -> None:
    frames = np.random.default_rng(31).normal(size=(9, FRAME)).astype(kind)
    frames[1, 7] = np.nan
    frames[2, -1] = -np.inf
    frames[3] = 0
    frames[4] = np.clip(frames[4], -0.5, 0.5)
    frames[5] = np.minimum(frames[5], 0.5)
    frames[6] *= -1
    if kind is not np.float16:
        frames[7] *= 10 * LOUDEST
    expected = [bool(input_fault(frame.astype(np.float64))) for frame in frames]
    assert expected[:6] == [False, True, True, True, True, False]
    assert demodulator().demodulate(frames)[2].tolist() == expected
    turned = np.asfortranarray(frames)
    assert demodulator().demodulate(turned)[2].tolist() == expected


def test_as_many_samples_at_the_peak_as_are_allowed_are_no_fault() -> None:
    frames = np.random.default_rng(5).uniform(-0.9, 0.9, size=(2, FRAME)).astype(np.float32)
    frames[0, :40], frames[1, :41] = 1.0, -1.0
    assert [bool(input_fault(frame)) for frame in frames] == [False, True]
    assert demodulator().demodulate(frames)[2].tolist() == [False, True]
