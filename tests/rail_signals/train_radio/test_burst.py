"""Whole bursts through channels with a closed form of the bit error rate."""

from __future__ import annotations

import math
import re
import warnings

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import erfc

from rail_signals.train_radio.burst import (
    RadioBurstFormat,
    RadioBurstReceiver,
    noise_variance,
)
from rail_signals.train_radio.mimo_fading import MimoFading
from rail_signals.train_radio.pulse import root_raised_cosine
from rail_signals.train_radio.space_time_block import scheme
from rail_signals.train_radio.symbol_mapping import constellation

SCHEMES = ["siso", "mrc", "alamouti_2x1", "alamouti_2x2"]
#: 300 km/h at 2.4 GHz and 100 kBd.
DOPPLER_HZ = 667.0


def burst_format(
    name: str = "alamouti_2x2", code: str = "qpsk", bits: int = 40
) -> RadioBurstFormat:
    """A format by the names of its scheme and constellation."""
    return RadioBurstFormat(scheme(name), constellation(code), bits)


def normal(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Circular complex normals of unit variance."""
    return np.asarray(rng.normal(scale=math.sqrt(0.5), size=(*shape, 2)) @ [1, 1j])


def rayleigh_error_rate(name: str, eb_n0_db: float) -> float:
    """BPSK and Gray QPSK over L independent Rayleigh branches, total transmit power fixed."""
    plan = scheme(name)
    g, branches = 10 ** (eb_n0_db / 10) / plan.transmit, plan.diversity
    p = (1 - math.sqrt(g / (1 + g))) / 2
    return p**branches * sum(math.comb(branches - 1 + k, k) * (1 - p) ** k for k in range(branches))


def test_the_closed_form_has_the_published_values() -> None:
    for eb_n0_db, mrc, alamouti in ((0, 5.81e-2, 4.03e-2), (10, 1.60e-3, 1.13e-4)):
        assert rayleigh_error_rate("mrc", eb_n0_db) == pytest.approx(mrc, rel=5e-3)
        assert rayleigh_error_rate("alamouti_2x2", eb_n0_db) == pytest.approx(alamouti, rel=5e-3)


@pytest.mark.parametrize("rolloff", [0.25, 0.35, 0.5, 1.0])
def test_pulses_do_not_disturb_each_other(rolloff: float) -> None:
    """The pulse behind its matched filter is a raised cosine: zero at the other symbols.

    What the cut leaves falls with roll-off and span; a roll-off of 0.25 meets the pole at t = 1.
    """
    pulse = root_raised_cosine(rolloff, 4, 32)
    through = np.convolve(pulse, pulse)[::4]
    assert through[32 * 2] == pytest.approx(1.0)
    through[32 * 2] = 0
    assert np.sum(through**2) < 1e-6
    spectrum = np.abs(np.fft.fft(pulse, 8192)) ** 2
    outside = np.abs(np.fft.fftfreq(8192, 0.25)) > (1 + rolloff) / 2
    assert spectrum[outside].sum() < 1e-4 * spectrum.sum()


def test_the_default_pulse_is_clean_to_50_db() -> None:
    pulse = burst_format().pulse
    through = np.convolve(pulse, pulse)[::4]
    rest = np.sum(through**2) - through.max() ** 2
    assert 10 * math.log10(rest) < -50


@pytest.mark.parametrize("name", SCHEMES)
def test_energy_of_a_burst(name: str) -> None:
    """One unit per symbol over all antennas: the definition behind `noise_variance`."""
    burst = burst_format(name, "16qam", 800)
    bits = np.random.default_rng(1).integers(0, 2, (50, 800))
    wave = burst.transmit(bits)
    assert wave.shape == (50, burst.scheme.transmit, burst.samples)
    energy = np.sum(np.abs(wave) ** 2, axis=(-2, -1)) / burst.pattern.symbols
    assert energy.mean() == pytest.approx(1.0, abs=0.01)


def test_noise_variance() -> None:
    assert noise_variance(0.0, 1) == 1
    assert noise_variance(3.0, 4) == pytest.approx(10**-0.3 / 4)
    assert noise_variance(3.0, 2, channel_power=1e-9) == pytest.approx(1e-9 * 10**-0.3 / 2)
    # Shared out over the bits, the energy of pilots makes each bit dearer.
    assert noise_variance(5.0, 2, pilot_fraction=0.2) == pytest.approx(noise_variance(5.0, 2) / 0.8)


def test_noise_per_sample_is_noise_per_symbol() -> None:
    burst = burst_format(bits=4000)
    noise = normal(np.random.default_rng(2), 2, burst.samples) * math.sqrt(0.3)
    symbols = burst.symbols_of(noise)
    assert symbols.shape == (2, burst.pattern.symbols)
    assert np.mean(np.abs(symbols) ** 2) == pytest.approx(0.3, rel=0.05)
    assert abs(np.mean(symbols[:, 1:] * symbols[:, :-1].conj())) < 0.02


@pytest.mark.parametrize("name", SCHEMES)
@pytest.mark.parametrize("code", ["bpsk", "qpsk", "16qam"])
@pytest.mark.parametrize("known", [False, True])
def test_a_fixed_channel_without_noise(name: str, code: str, known: bool) -> None:
    rng = np.random.default_rng(3)
    for bits in (1, 37, 200):
        burst = burst_format(name, code, bits)
        sent = rng.integers(0, 2, (4, bits), dtype=np.uint8)
        h = 1e-4 * normal(rng, 4, burst.scheme.receive, burst.scheme.transmit, 1)
        wave = np.sum(h * burst.transmit(sent)[:, None], axis=-2)
        channel = h.repeat(burst.pattern.symbols, axis=-1)
        found = RadioBurstReceiver(burst).receive(wave, channel=channel if known else None)
        assert found.detected.all()
        assert found.bits.dtype == np.uint8
        np.testing.assert_array_equal(found.bits, sent)
        np.testing.assert_allclose(found.channel, channel, atol=0.02 * 1e-4)
        assert (found.snr > 1e2).all()


@pytest.mark.parametrize(
    ("name", "code", "eb_n0_db"),
    [
        ("siso", "bpsk", 8.0),
        ("mrc", "bpsk", 4.0),
        ("alamouti_2x1", "qpsk", 5.0),
        ("alamouti_2x2", "qpsk", 2.0),
        ("alamouti_2x2", "bpsk", 5.0),
    ],
)
def test_error_rate_with_a_known_channel(name: str, code: str, eb_n0_db: float) -> None:
    """Flat Rayleigh fading, constant over a burst: the closed form, in the 99.9 % interval."""
    bursts, bits = 4000, 16
    burst = burst_format(name, code, bits)
    plan = burst.scheme
    rng = np.random.default_rng(4)
    sent = rng.integers(0, 2, (bursts, bits), dtype=np.uint8)
    h = normal(rng, bursts, plan.receive, plan.transmit, 1)
    wave = np.sum(h * burst.transmit(sent)[:, None], axis=-2)
    level = noise_variance(eb_n0_db, burst.constellation.bits_per_symbol)
    wave += math.sqrt(level) * normal(rng, *wave.shape)
    found = RadioBurstReceiver(burst).receive(wave, channel=h.repeat(burst.pattern.symbols, -1))
    # The bits of a burst share its fade: bursts, not bits, are independent.
    rate = np.mean(found.bits != sent, axis=-1)
    reach = 3.29 * rate.std() / math.sqrt(bursts)
    assert abs(rate.mean() - rayleigh_error_rate(name, eb_n0_db)) < reach
    assert reach < 0.3 * rate.mean()
    assert found.noise_variance.mean() == pytest.approx(level, rel=0.05)
    gain = np.sum(np.abs(h) ** 2, axis=(1, 2)) / plan.transmit
    np.testing.assert_allclose(
        found.snr * found.noise_variance[:, None], gain.repeat(found.snr.shape[-1], -1)
    )


def moving(name: str, eb_n0_db: float, bursts: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bits sent, bits received and SNR of bursts of 200 bits to a train at 300 km/h."""
    burst = burst_format(name, bits=200)
    plan, rng = burst.scheme, np.random.default_rng(6)
    place = DOPPLER_HZ * np.arange(burst.samples) / burst.sample_rate_hz
    h = np.array(
        [MimoFading(rng, plan.receive, plan.transmit, 1.0).at(place) for _ in range(bursts)]
    )
    sent = rng.integers(0, 2, (bursts, 200), dtype=np.uint8)
    wave = np.sum(h * burst.transmit(sent)[:, None], axis=-2)
    wave += math.sqrt(noise_variance(eb_n0_db, 2)) * normal(rng, *wave.shape)
    found = RadioBurstReceiver(burst, false_alarm=1.0).receive(wave, doppler_hz=DOPPLER_HZ)
    assert found.detected.all()
    return sent, found.bits, found.snr


@pytest.mark.parametrize(("name", "eb_n0_db"), [("mrc", 5.0), ("alamouti_2x2", 4.0)])
def test_the_price_of_pilots(name: str, eb_n0_db: float) -> None:
    """At 300 km/h the estimate costs less than 2 dB of Eb/N0; the SNR it states is right."""
    sent, bits, snr = moving(name, eb_n0_db, 400)
    rate = float(np.mean(bits != sent))
    equal_db = brentq(lambda db: math.log(rayleigh_error_rate(name, db) / rate), -10.0, 20.0)
    assert 0.3 < eb_n0_db - equal_db < 2.0
    predicted = float(np.mean(erfc(np.sqrt(snr / 2)) / 2))
    assert predicted == pytest.approx(rate, rel=0.2)


def test_noise_alone_is_no_burst() -> None:
    burst = burst_format("siso", bits=100)
    noise = normal(np.random.default_rng(7), 4000, 1, burst.samples)
    careless = RadioBurstReceiver(burst, false_alarm=0.05).receive(noise, doppler_hz=DOPPLER_HZ)
    assert 0.001 < careless.detected.mean() < 0.05
    found = RadioBurstReceiver(burst).receive(noise[:200], doppler_hz=DOPPLER_HZ)
    assert not found.detected.any()
    for value in (found.bits, found.snr, found.channel):
        assert not value.any()


@pytest.mark.parametrize("known", [False, True])
def test_silence_and_rubbish_are_not_detected(known: bool) -> None:
    burst = burst_format()
    rng = np.random.default_rng(8)
    sent = rng.integers(0, 2, (6, 40))
    h = normal(rng, 6, 2, 2, 1)
    good = np.sum(h * burst.transmit(sent)[:, None], axis=-2)
    bad = good.copy()
    bad[0] = 0
    bad[1, 0, 7] = math.nan
    bad[2, 1, -1] = math.inf
    bad[3] *= 1e250
    bad[4] = 0
    bad[4, 0, 0] = complex(0, math.nan)
    receiver = RadioBurstReceiver(burst)
    channel = h.repeat(burst.pattern.symbols, -1) if known else None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = receiver.receive(bad, channel=channel)
    assert found.detected.tolist() == [False] * 5 + [True]
    assert np.isfinite(found.snr).all()
    assert np.isfinite(found.channel).all()
    assert np.isfinite(found.noise_variance).all()
    assert not found.bits[:5].any()
    np.testing.assert_array_equal(found.bits[5], sent[5])


def test_one_dead_antenna_leaves_the_link_up() -> None:
    burst = burst_format()
    sent = np.random.default_rng(9).integers(0, 2, 40)
    wave = np.sum(np.array([[1.0, 1j], [0, 0]])[..., None] * burst.transmit(sent), axis=-2)
    found = RadioBurstReceiver(burst).receive(wave)
    assert found.detected
    np.testing.assert_array_equal(found.bits, sent)


def test_a_burst_does_not_depend_on_the_others() -> None:
    burst = burst_format()
    rng = np.random.default_rng(10)
    sent = rng.integers(0, 2, (2, 5, 40))
    wave = np.sum(normal(rng, 2, 5, 2, 2, 1) * burst.transmit(sent)[..., None, :, :], axis=-2)
    wave += 0.3 * normal(rng, *wave.shape)
    receiver = RadioBurstReceiver(burst)
    whole = receiver.receive(wave, doppler_hz=100.0)
    assert whole.bits.shape == (2, 5, 40)
    assert whole.snr.shape == (2, 5, burst.pattern.data_symbols)
    for i, j in np.ndindex(2, 5):
        single = receiver.receive(wave[i, j], doppler_hz=100.0)
        assert np.array_equal(burst.transmit(sent[i, j]), burst.transmit(sent)[i, j])
        assert np.array_equal(single.bits, whole.bits[i, j])
        for name in ("channel", "snr", "noise_variance", "detected"):
            assert np.array_equal(getattr(single, name), getattr(whole, name)[i, j])
    none = receiver.receive(wave[:, :0])
    assert none.bits.shape == (2, 0, 40)
    assert burst.transmit(sent[:, :0]).shape == (2, 0, 2, burst.samples)


def test_symbols_stand_where_the_format_says() -> None:
    burst = burst_format("siso", "bpsk", 1)
    wave = burst.transmit([0])[0]
    middle = burst.symbol_samples[burst.pattern.data_positions[0]]
    assert burst.duration_s * burst.sample_rate_hz == pytest.approx(burst.samples)
    others = burst.symbol_samples[burst.pattern.pilot_positions]
    alone = wave.copy()
    for place in others:
        alone[place - 24 : place + 25] -= burst.pulse
    expected = np.zeros(burst.samples)
    expected[middle - 24 : middle + 25] = burst.pulse
    np.testing.assert_allclose(alone, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: noise_variance(math.nan, 1), "nan"),
        (lambda: noise_variance(0.0, 0), "0"),
        (lambda: noise_variance(0.0, 1, channel_power=-1.0), "-1.0"),
        (lambda: noise_variance(0.0, 1, pilot_fraction=1.0), "1.0"),
        (lambda: root_raised_cosine(0.0, 4, 6), "0.0"),
        (lambda: root_raised_cosine(0.3, 1, 6), "1"),
        (lambda: root_raised_cosine(0.3, 4, 0), "0"),
        (lambda: burst_format(bits=0), "0"),
        (lambda: RadioBurstFormat(scheme("mrc"), constellation("bpsk"), 8, -1.0), "-1.0"),
        (lambda: RadioBurstFormat(scheme("mrc"), constellation("bpsk"), 8, pilot_period=3), "3"),
        (lambda: RadioBurstReceiver(burst_format(), false_alarm=0.0), "0.0"),
        (lambda: burst_format().transmit(np.zeros(39)), "(39,)"),
        (lambda: burst_format().transmit(np.full(40, 3)), "3"),
        (lambda: RadioBurstReceiver(burst_format()).receive(np.zeros((1, 232))), "(1, 232)"),
        (lambda: RadioBurstReceiver(burst_format()).receive([]), "(0,)"),
    ],
)
def test_bad_values_are_quoted(call: object, message: str) -> None:
    with pytest.raises(ValueError, match=re.escape(message)):
        call()  # type: ignore[operator]


def test_a_bad_channel_or_doppler_is_quoted() -> None:
    burst = burst_format()
    receiver, wave = RadioBurstReceiver(burst), np.ones((2, burst.samples))
    with pytest.raises(ValueError, match=re.escape("(2, 2, 3)")):
        receiver.receive(wave, channel=np.zeros((2, 2, 3)))
    with pytest.raises(ValueError, match=re.escape("got -0.01")):
        receiver.receive(wave, doppler_hz=-1e3)
